"""Put the newly certified tasks into a certificate of more tasks, after the world of some has changed.

Usage: renew_certificate.py CERTIFICATE NEW. Both must be of the same control, seeds, replay and versions. Rows, episodes,
worlds and complaints of NEW's tasks take the place of those in CERTIFICATE, which is then read as every reader does, so
that nothing is written that contradicts itself.
"""

import json
import re
import sys
import tempfile
from operator import itemgetter
from pathlib import Path
from typing import Any

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.output_file import write_file
from lerobot_env_bimanual.experts.stored_certificate import StoredCertificate

OF_TASKS = ("worlds", "complaints", "rates", "episodes")


def main() -> int:
    """Renew the first file named on the command line by the second."""
    path, new_path = map(Path, sys.argv[1:3])
    old, new = (json.loads(each.read_text(encoding="utf-8")) for each in (path, new_path))
    for name in old.keys() - set(OF_TASKS):
        if old[name] != new[name]:
            print(f"{new_path}: {name} is {new[name]!r}, but {old[name]!r} in {path}: certify all tasks anew")
            return 1
    text = renewed(old, new)
    with tempfile.TemporaryDirectory() as folder:
        draft = Path(folder) / path.name
        draft.write_text(text, encoding="utf-8")
        try:
            StoredCertificate.read(draft)
        except BimanualError as error:
            print(error)
            return 1
    write_file(path, text)
    return 0


def renewed(old: dict[str, Any], new: dict[str, Any]) -> str:
    """The file's text; episodes stay in the order in which their tasks were played, those of a further task come last."""
    worlds = old["worlds"] | new["worlds"]
    kept = [
        line for line in old["complaints"] if not any(re.match(rf"{task}\b", line) for task in new["worlds"])
    ]
    fields = {
        "worlds": {task: worlds[task] for task in sorted(worlds)},
        "complaints": [*kept, *new["complaints"]],
        "rates": sorted(_exchanged(old["rates"], new["rates"]), key=itemgetter("task", "variation")),
    }
    head = {name: fields.get(name, value) for name, value in old.items() if name != "episodes"}
    episodes = [json.dumps(line) for line in _exchanged(old["episodes"], new["episodes"])]
    # One episode per line, as certificates are written.
    body = json.dumps(head, indent=1).removesuffix("\n}")
    return f'{body},\n "episodes": [\n  {",\n  ".join(episodes)}\n ]\n}}\n'


def _exchanged(old: list[dict[str, Any]], new: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Lines of tasks, in the order of the tasks in the old ones, those of a task in the new ones as they are there."""
    tasks = dict.fromkeys(line["task"] for line in [*old, *new])
    fresh = {line["task"] for line in new}
    return [line for task in tasks for line in (new if task in fresh else old) if line["task"] == task]


if __name__ == "__main__":
    sys.exit(main())
