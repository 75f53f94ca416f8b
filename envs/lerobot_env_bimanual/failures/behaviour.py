"""Behaviour beside success: how far episodes came, how hard the arms pressed, and how long it took."""

from collections.abc import Mapping, Sequence
from statistics import fmean, median

from lerobot_bimanual.results.episode import Episode, success_rate
from lerobot_env_bimanual.failures.attribution import Attribution

ABSENT = "–"


def behaviour(
    episodes: Sequence[Episode], failures: Sequence[Attribution], expert_ticks: Mapping[int, int]
) -> dict[str, str]:
    """Measures of behaviour in the episodes of one policy on one task, as cells of a table by heading.

    `failures` may be a sample; `expert_ticks`, the control ticks that the expert took by seed, may lack seeds.
    """
    rate = success_rate(episodes)
    shares = [each.reached for each in failures if each.reached is not None]
    is_known = bool(shares) or rate.rate == 1
    reached = rate.rate + (1 - rate.rate) * fmean(shares or [0])
    forces_n = [each.load.contact_force_n for each in episodes if each.load is not None]
    times = [
        each.ticks / expert_ticks[each.seed]
        for each in episodes
        if each.success and each.ticks and expert_ticks.get(each.seed)
    ]
    return {
        "solved": f"{rate.successes}/{rate.trials}",
        "keyposes reached": f"{reached:.0%}" if is_known else ABSENT,
        "force, N": f"{median(forces_n):.0f}, {max(forces_n):.0f}" if forces_n else ABSENT,
        "time / expert's": f"{median(times):.2f}" if times else ABSENT,
    }
