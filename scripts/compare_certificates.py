"""Compare two certificates episode by episode: the same ones, with the same final states?

Usage: compare_certificates.py COMMITTED NEW. Prints how many final states are equal, names the first that are not, and
exits with 1 unless all of them are.
"""

import json
import sys
from pathlib import Path
from typing import Any

SHOWN = 10


def main() -> int:
    """Compare the two files named on the command line."""
    committed, new = (_states(Path(name)) for name in sys.argv[1:3])
    if missing := committed.keys() ^ new.keys():
        print(f"{len(missing)} episodes are in one of them only, such as {min(missing)}")
    shared = sorted(committed.keys() & new.keys())
    different = [key for key in shared if committed[key] != new[key]]
    for key in different[:SHOWN]:
        print(f"{key}: {committed[key]} and {new[key]}")
    print(f"{len(shared) - len(different)} of {len(shared)} final states are equal")
    return 1 if missing or different or not shared else 0


def _states(path: Path) -> dict[tuple[str, int, int], Any]:
    """(task, variation, seed) -> hash of the final state and whether the episode was solved."""
    episodes = json.loads(path.read_text(encoding="utf-8"))["episodes"]
    return {
        (episode["task"], episode["variation"], episode["seed"]): (episode["state_hash"], episode["success"])
        for episode in episodes
    }


if __name__ == "__main__":
    sys.exit(main())
