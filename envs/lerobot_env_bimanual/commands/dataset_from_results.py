"""The command `dataset from-results`: a dataset of the episodes that policies have played."""

import os
from dataclasses import dataclass, field
from functools import partial
from itertools import batched, chain
from pathlib import Path
from typing import Literal

from lerobot_bimanual.errors import BimanualError, DatasetError

EPISODES_PER_PART = 5
"""Enough that opening files costs little, few enough to keep all processes busy."""


@dataclass
class DatasetFromResultsConfig:
    """Options of the command `dataset from-results`."""

    # A file, or a folder of files: results of `policy benchmark`, or records that `lerobot-eval --env.results_dir` has left.
    results: Path = field(kw_only=True)
    root: Path = field(kw_only=True)  # new folder of the dataset
    outcome: Literal["all", "solved", "failed"] = "all"  # which episodes are stored
    # What is stored: `frames` (every tick, as video), `keyframes` (start, reached keyposes and end, lossless), or both, in
    # root/frames and root/keyframes.
    view: Literal["frames", "keyframes", "both"] = "both"
    image_size: str = ""  # side in pixels, or HEIGHTxWIDTH; by default that of the first result
    cameras: str = ""  # whose images are stored, separated by commas; by default those of the first result
    depth: bool | None = None  # store depth beside the colours; by default in `keyframes` alone
    repo_id: str | None = None  # LeRobot's name of the dataset; without it, local/ and the folder's name
    workers: int = 0  # processes; 0 takes one per core


def dataset_from_results(config: DatasetFromResultsConfig) -> None:
    """Make a LeRobot dataset of the episodes that policies have played, by replaying them exactly.

    No policy is needed: the recorded actions are played again, and every state is compared with the record. Rows are those of
    `dataset generate`, with five more columns: `success`, `failure_class`, as `results diagnose` names it, `policy`, `setting`
    and `perturb`. The keyposes are those that the policy gave; of joint actions they are the poses at the keyframes that discovery finds. Episodes of
    which no tick was played, or that replay otherwise, are left out and listed. Subtasks are not known: a policy does not
    name what it does.

    Examples:
        lerobot-bimanual dataset from-results --results=outputs/records --root=data/played
        lerobot-bimanual dataset from-results --results=outputs/records --outcome=solved --view=frames --root=data/solved
    """
    from lerobot_bimanual.dataset.checksums import write_checksums
    from lerobot_bimanual.dataset.schema import VIEWS
    from lerobot_bimanual.files import move_durably
    from lerobot_bimanual.results.record import result_paths
    from lerobot_bimanual.terminal import say, show_next
    from lerobot_env_bimanual.generation.build import PRELOADED
    from lerobot_env_bimanual.generation.from_results import Part, record_replays
    from lerobot_env_bimanual.generation.settings import check_video_size, repo_id_of
    from lerobot_env_bimanual.generation.staging import new_folder, plain_write_errors
    from lerobot_env_bimanual.options import EnvOptions
    from lerobot_env_bimanual.verification.result_files import ResultFile
    from lerobot_env_bimanual.workers import WorkerPool

    root = Path(os.path.realpath(config.root))  # of a link, the folder that it leads to
    repo_id = repo_id_of(config.repo_id, config.root)
    if root.exists():
        raise DatasetError(f"{config.root} is there already; choose another --root or remove it")
    results = [ResultFile.read(path) for path in result_paths(config.results)]
    for result in results:
        result.check_world()
    usual = results[0].record.options
    given = {"image_size": config.image_size, "cameras": config.cameras}
    image_options = EnvOptions.of(**{name: value or usual.get(name, value) for name, value in given.items()})
    views = VIEWS if config.view == "both" else (config.view,)
    check_video_size(image_options.size, views)
    is_perturbed = any(result.record.options.get("perturb") for result in results)
    selected_outcomes = {"all": (True, False), "solved": (True,), "failed": (False,)}[config.outcome]
    with plain_write_errors(config.root):
        root.parent.mkdir(parents=True, exist_ok=True)

    from lerobot_bimanual.dataset.merging import merge_datasets  # LeRobot and torch take seconds

    with plain_write_errors(config.root), new_folder(root.parent) as folder:
        jobs = list[Part]()
        for result in results:
            head = result.record.task, result.policy_id, tuple(result.record.options.items())
            episodes = (episode for episode in result.record.episodes if episode.success in selected_outcomes)
            for some in batched(episodes, EPISODES_PER_PART):
                jobs.append((*head, some, folder / f"{len(jobs):06d}"))
        images = {"cameras": image_options.camera_names, "size": image_options.size, "depth": config.depth}
        how = {"repo_id": repo_id, "views": views, "is_perturbed": is_perturbed, **images}
        with WorkerPool(config.workers, preload=PRELOADED) as pool:
            replay = partial(record_replays, **how)
            found = pool.map(replay, jobs, "replay", "part", name=lambda job: job[0])
            left_out = [*chain.from_iterable(found)]
        parts = [place for *_, place in jobs if place.exists()]
        if not parts:
            reasons = "; ".join(left_out[:3]) or config.outcome
            raise BimanualError(f"{config.results} holds no episode to store ({reasons})")
        merged = folder / "merged"
        for view in views:
            target = merged / view if len(views) > 1 else merged
            merge_datasets([part / view for part in parts], target)
            write_checksums(target)
        move_durably(merged, root)
    say(*(f"left out: {text}" for text in left_out))
    stored = sum(len(some) for *_, some, _ in jobs) - len(left_out)
    print(f"{config.root}: {stored} episodes")
    show_next("lerobot-bimanual", "dataset", "verify", f"--root={config.root}")
