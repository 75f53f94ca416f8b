"""The verb `ladder`: what a trained policy survives."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lerobot_bimanual.errors import check_range

if TYPE_CHECKING:
    from lerobot_env_bimanual.ladder.climb import Climb


@dataclass
class PolicyRobustnessConfig:
    """Options of the verb `ladder`."""

    checkpoint: Path = field(kw_only=True)  # folder pretrained_model of a trained policy
    task: str = field(kw_only=True)  # one task
    axes: tuple[str, ...] = ()  # of perturbation; by default all that apply to the task
    levels: tuple[int, ...] = (1, 2, 3)  # of each axis; level 0, the world as it is, is always played
    episodes: int = 20  # the same on every rung
    first_seed: int = 0  # of the episodes, which are counted up
    split: Literal["val", "test"] = "test"  # the same seeds mean other episodes in each
    variation: str = "any"  # index, or `any` to draw one per episode
    # Environments side by side; a network's answers differ in their last bits between sizes.
    batch_size: int = 2
    device: str | None = None  # of the policy; by default that of its config, or what there is
    # Mixed precision of the policy; by default as in its training. On a CPU LeRobot's loop cannot take every policy's actions then.
    use_amp: bool | None = None
    workers: int = 0  # processes for expert and blind control; 0 takes one per core
    # The result, a JSON file; by default outputs/ladder/TASK_POLICY_HASH.json. Its figure and its records lie beside it.
    output: Path | None = None
    # Folder of what `certify-rungs` has written: the expert on many more seeds, which then decides what is certified.
    certificates: Path | None = None
    dry_run: bool = False  # print the rungs, and after a few episodes an estimate of the time; keep nothing


def policy_robustness(config: PolicyRobustnessConfig) -> None:
    r"""Play a policy on the same seeds at every rung: one axis of perturbation, one level.

    The policy is loaded once and played by LeRobot's own loop, so that level 0 is what `lerobot-eval` gives on these
    seeds. The expert and the blind control play the same episodes, but for axes that change nothing but what is seen or
    said, where both play as at level 0. A rung is certified if the expert solves 97 %; others are played, shown hatched and
    counted nowhere. Prints for each rung the success, the paired difference to level 0 and McNemar's exact p-value,
    corrected by Holm over the axes with a certified rung of that level; writes a JSON file, a figure, and one record per
    rung that `verify-results` plays again. The loader builds what the checkpoint names, as `lerobot-eval` does: look at one
    of a stranger with `policy check` first.

    Every rung is kept when it is played: the same command goes on where it was interrupted, and with other axes or levels
    the same file grows.

    Examples:
        lerobot-bimanual policy robustness --checkpoint=results/checkpoints/peract2_on_all --task=handover_item_easy
        lerobot-bimanual policy robustness --checkpoint=results/checkpoints/peract2_on_all --task=handover_item_easy \
            --axes=camera_moved,mass --levels=1,3 --episodes=50 --dry_run
    """
    from rich.console import Console
    from tqdm import tqdm

    from lerobot_bimanual.reports.drops import print_drops, remarks
    from lerobot_bimanual.reports.robustness_figures import sweep_figure

    climb, console = _climb(config), Console()
    missing = climb.missing()
    console.print(
        f"{climb.task}: {len(climb.rungs.axes)} axes, {len([*climb.rungs])} rungs of {config.episodes} episodes, "
        f"{len(missing)} to be played",
        highlight=False,
    )
    if config.certificates is not None and climb.certificate is None:
        console.print(_no_certificate(config), soft_wrap=True, highlight=False)
    if left_out := climb.rungs.not_applicable:
        console.print(f"not applicable: {', '.join(left_out)}", highlight=False)
    if config.dry_run:
        _estimate(climb)
        return
    try:
        for rung in climb.climb():
            rates = ", ".join(f"{who} {rate.successes}" for who, rate in rung.rates.items())
            tqdm.write(f"{rung.name}: {rates} of {config.episodes}")
    except KeyboardInterrupt:
        raise KeyboardInterrupt("the same command goes on where it stopped") from None
    result = climb.played()
    assert result is not None  # it has level 0 at least
    figure = climb.output.with_suffix(".png")
    sweep_figure(result).save(figure)
    print_drops(result)
    for line in (
        *remarks(result),
        f"result  {climb.output}",
        f"figure  {figure}",
        f"records {climb.records}",
    ):
        console.print(line, soft_wrap=True, highlight=False)


def _climb(config: PolicyRobustnessConfig) -> Climb:
    """What is to be played; refuses what cannot be, before anything heavy is imported."""
    from lerobot_bimanual.ladder.rung_certificate import read_rung_certificates
    from lerobot_bimanual.output_file import check_output_file
    from lerobot_env_bimanual.checkpoint import Checkpoint
    from lerobot_env_bimanual.ladder.rungs import rungs_of
    from lerobot_env_bimanual.tasks.registry import get_task

    for name in ("episodes", "batch_size", "first_seed"):
        least = 0 if name == "first_seed" else 1
        check_range(name, getattr(config, name), least)
    get_task(config.task).spec.variation_index(config.variation)
    checkpoint = Checkpoint.read(config.checkpoint)
    rungs = rungs_of(config.task, config.axes, config.levels)
    certificates = {} if config.certificates is None else read_rung_certificates(config.certificates)
    name = f"{config.task}_{checkpoint.policy}_{checkpoint.sha256[:8]}.json"
    output = config.output or Path("outputs/ladder", name)
    check_output_file(output)

    from lerobot_env_bimanual.configuration_bimanual import BimanualEnvConfig
    from lerobot_env_bimanual.ladder.climb import Climb

    return Climb(
        checkpoint=checkpoint,
        config=BimanualEnvConfig(
            task=config.task, split=config.split, variation=config.variation, **checkpoint.options
        ),
        rungs=rungs,
        seeds=range(config.first_seed, config.first_seed + config.episodes),
        batch_size=min(config.batch_size, config.episodes),
        policy_flags=tuple(
            f"--{name}={str(value).lower()}"  # LeRobot reads true and false
            for name in ("device", "use_amp")
            if (value := getattr(config, name)) is not None
        ),
        workers=config.workers,
        output=output,
        certificate=certificates.get(config.task),
    )


def _no_certificate(config: PolicyRobustnessConfig) -> str:
    from lerobot_bimanual.ladder.rung_certificate import read_rung_certificates

    assert config.certificates is not None
    others = ", ".join(read_rung_certificates(config.certificates))
    return (
        f"{config.certificates} holds no certificate of {config.task}, only of {others}; `certify-rungs "
        f"--task={config.task} --output={config.certificates}` makes it. Till then the expert on these episodes decides"
    )


def _estimate(climb: Climb) -> None:
    """Print the rungs, and about how long they take."""
    import tempfile

    for axis in climb.rungs.axes:
        levels = ", ".join(f"{axis.levels[level - 1]:g}" for level in climb.rungs.levels)
        print(f"  {axis.name}: {levels} {axis.unit}; {axis.summary}")
    with tempfile.TemporaryDirectory() as folder:
        print(f"about {climb.estimate_s(Path(folder)) / 60:.0f} minutes")
