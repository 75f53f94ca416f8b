"""Measure what the five cameras see while the experts play, and write it for `lerobot-bimanual report`.

Prints per task and keypose the pixels of every object in every view, and in how many views each arm's target is seen.

Usage: visibility.py [--task=all] [--split=test] [--seeds=61000:61010] [--output=FILE]
"""

import argparse
import json
from dataclasses import asdict
from pathlib import Path

from lerobot_bimanual.output_file import check_output_file, write_file
from lerobot_env_bimanual.expert.seed_range import parse_seeds
from lerobot_env_bimanual.expert.world_version import world_version
from lerobot_env_bimanual.pictures.visibility import Moment, sights, summarise
from lerobot_env_bimanual.reports.visibility import Visibility, targets_table
from lerobot_env_bimanual.tasks.registry import get_task, resolve_tasks


def main() -> None:
    """Measure the tasks named on the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--task", default="all", help="task and suite names, comma separated")
    parser.add_argument("--split", default="test")
    parser.add_argument("--seeds", default="61000:61010", help="first:stop, the same of every task")
    parser.add_argument("--output", type=Path, help="JSON file; in one of the same seeds other tasks stay")
    options = parser.parse_args()
    if options.output is not None:
        check_output_file(options.output)
    visibility = _stored(options.output, options.split, options.seeds)
    for task in sorted(resolve_tasks(options.task), key=lambda name: get_task(name).spec.id):
        visibility.tasks[task] = summarise(sights(task, parse_seeds(options.seeds), options.split))
        visibility.worlds[task] = world_version(task)
        _print(task, visibility.tasks[task])
    print(f"\n{targets_table(visibility)}")
    if options.output is not None:
        write_file(options.output, json.dumps(asdict(visibility), indent=1) + "\n")


def _stored(path: Path | None, split: str, seeds: str) -> Visibility:
    """What the file holds if it is of these seeds, otherwise nothing yet."""
    if path is not None and path.exists():
        stored = Visibility.read(path)
        if (stored.split, stored.seeds) == (split, seeds):
            return stored
    return Visibility(split, seeds, worlds={}, tasks={})


def _print(task: str, moments: tuple[Moment, ...]) -> None:
    print(task)
    for moment in moments:
        print(f"  before {moment.step + 1}. {moment.move}")
        for name, pixels in moment.items.items():
            print(f"    {name:20}" + "".join(f"{number:8}" for number in pixels))
        for arm, target in moment.targets.items():
            print(f"    {arm} to {', '.join(target.names)}: at least {target.least_views} views", end="")
            print(f", two or more in {target.seen} of {target.episodes} episodes", flush=True)


if __name__ == "__main__":
    main()
