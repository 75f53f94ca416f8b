"""The command `policy robustness`: what a trained policy loses under perturbations."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lerobot_bimanual.errors import check_range
from lerobot_bimanual.files import check_output_file
from lerobot_bimanual.terminal import show_next
from lerobot_env_bimanual.tasks.registry import get_task

if TYPE_CHECKING:
    from lerobot_env_bimanual.sweep.robustness import PolicySweep


@dataclass
class PolicyRobustnessConfig:
    """Options of the command `policy robustness`."""

    checkpoint: Path = field(kw_only=True)  # folder pretrained_model of a trained policy
    task: str = field(kw_only=True)  # one task
    axes: tuple[str, ...] = ()  # axes of perturbation; by default all that apply to the task
    levels: tuple[int, ...] = (1, 2, 3)  # levels of each axis; the nominal world is always added
    episodes: int = 20  # number of episodes of each condition, the same in all
    first_seed: int = 0  # seed of the first episode; the others follow
    split: Literal["val", "test"] = "test"  # the same seeds mean other episodes in each
    variation: str = "any"  # index, or `any` to draw one per episode
    # Environments side by side; a network's answers differ in their last bits between sizes.
    eval_batch_size: int = 2
    device: str | None = None  # device of the policy; by default that of its config, or what there is
    # Mixed precision of the policy; by default as in its training. On a CPU LeRobot's loop cannot take every policy's actions then.
    use_amp: bool | None = None
    workers: int = 0  # processes for the expert and the open-loop baseline; 0 takes one per core
    # The result, a JSON file; by default outputs/robustness/TASK_POLICY_HASH.json. Its records are written beside it.
    output: Path | None = None
    # Folder of `expert evaluate --axes`: the expert on many more seeds, which then decides which conditions are valid.
    expert_reports: Path | None = None
    trust_checkpoint: bool = False  # load what the checkpoint names, without `policy check`
    dry_run: bool = False  # print the conditions, and play nothing


def policy_robustness(config: PolicyRobustnessConfig) -> None:
    r"""Play a policy on the same seeds in every condition: one axis of perturbation at one level.

    The policy is loaded once and played by LeRobot's own loop, so that the nominal condition is what `lerobot-eval` gives
    on these seeds. The expert and the open-loop baseline play the same episodes; for axes that change only what is seen or
    said, their nominal episodes count. A condition is valid if the expert solves 97 %; others are played, marked `not valid` and
    counted in no sum. Prints for each condition the success, the paired difference to the nominal world and McNemar's exact
    p-value, corrected by Holm over the axes with a valid condition of that level; writes a JSON file, and one
    record per condition that `results verify` plays again. The loader builds what the checkpoint names, as `lerobot-eval`
    does, so a checkpoint that `policy check` does not pass is refused unless `--trust_checkpoint` is given.

    Every condition is kept when it is played: the same command continues where it was interrupted, and with other axes or
    levels the same file grows.

    Examples:
        lerobot-bimanual policy robustness --checkpoint=results/checkpoints/peract2_on_all --task=handover_item_easy
        lerobot-bimanual policy robustness --checkpoint=results/checkpoints/peract2_on_all --task=handover_item_easy \
            --axes=camera_moved,mass --levels=1,3 --episodes=50 --dry_run
    """
    from tqdm import tqdm

    from lerobot_bimanual.reports.robustness import print_robustness
    from lerobot_env_bimanual.sweep.checkpoint import require_safe

    sweep = _sweep(config)
    missing = sweep.missing()
    print(
        f"{sweep.task}: {len(sweep.conditions.axes)} axes, {len([*sweep.conditions])} conditions of {config.episodes} "
        f"episodes, {len(missing)} to be played"
    )
    if config.expert_reports is not None and sweep.expert_report is None:
        print(
            f"{config.expert_reports} holds no report of {config.task}; `expert evaluate --task={config.task} --axes=all "
            f"--output={config.expert_reports}` makes it. Until then the expert on these episodes decides"
        )
    if left_out := sweep.conditions.not_applicable:
        print(f"not applicable: {', '.join(left_out)}")
    if config.dry_run:
        for axis in sweep.conditions.axes:
            levels = ", ".join(f"{axis.levels[level - 1]:g}" for level in sweep.conditions.levels)
            print(f"  {axis.name}: {levels} {axis.unit}; {axis.summary}")
        return
    if missing and not config.trust_checkpoint:
        require_safe(config.checkpoint)
    try:
        for condition in sweep.run():
            rates = ", ".join(f"{who} {rate.successes}" for who, rate in condition.rates.items())
            tqdm.write(f"{condition.name}: {rates} of {config.episodes}")
    except KeyboardInterrupt:
        raise KeyboardInterrupt("the same command continues where it stopped") from None
    result = sweep.played()
    assert result is not None  # it has the nominal condition at least
    print_robustness(result)
    print(f"result  {sweep.output}\nrecords {sweep.records}")
    show_next("lerobot-bimanual", "results", "diagnose", f"--results={sweep.records}")


def _sweep(config: PolicyRobustnessConfig) -> PolicySweep:
    """The sweep that the options describe; refuses impossible options before heavy imports."""
    from lerobot_bimanual.results.robustness import read_expert_robustness
    from lerobot_env_bimanual.sweep.checkpoint import Checkpoint
    from lerobot_env_bimanual.sweep.conditions import conditions_of

    for name, minimum in (("episodes", 1), ("eval_batch_size", 1), ("first_seed", 0)):
        check_range(name, getattr(config, name), minimum)
    get_task(config.task).spec.variation_index(config.variation)
    checkpoint = Checkpoint.read(config.checkpoint)
    conditions = conditions_of(config.task, config.axes, config.levels)
    reports = {} if config.expert_reports is None else read_expert_robustness(config.expert_reports)
    name = f"{config.task}_{checkpoint.policy}_{checkpoint.sha256[:8]}.json"
    output = config.output or Path("outputs/robustness", name)
    check_output_file(output)

    from lerobot_env_bimanual.configuration_bimanual import BimanualEnvConfig
    from lerobot_env_bimanual.sweep.robustness import PolicySweep

    return PolicySweep(
        checkpoint=checkpoint,
        env_config=BimanualEnvConfig(
            task=config.task, split=config.split, variation=config.variation, **checkpoint.options
        ),
        conditions=conditions,
        seeds=range(config.first_seed, config.first_seed + config.episodes),
        batch_size=min(config.eval_batch_size, config.episodes),
        policy_flags=tuple(
            f"--{name}={str(value).lower()}"  # LeRobot reads true and false
            for name in ("device", "use_amp")
            if (value := getattr(config, name)) is not None
        ),
        workers=config.workers,
        output=output,
        expert_report=reports.get(config.task),
    )
