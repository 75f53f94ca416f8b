"""Film the experts for the pages of their tasks, where that has not been done in their present world.

Usage: site_films.py
"""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
FILMS = ROOT / "build/films"
REPORT = ROOT / "results/expert_reports/expert.json"


def main() -> None:
    """Film them."""
    worlds = json.loads(REPORT.read_text(encoding="utf-8"))["worlds"]
    missing = [task for task in worlds if not (FILMS / f"{film_name(task)}.mp4").is_file()]
    if not missing:
        return
    print(f"filming {len(missing)} experts, about ten seconds each on one core", flush=True)
    program = Path(sys.executable).with_name("lerobot-bimanual")
    made = ROOT / "build/render"
    words = ["task", "render", f"--task={','.join(missing)}", "--quality=observation", f"--output={made}"]
    subprocess.run([program, *words], check=True)
    FILMS.mkdir(parents=True, exist_ok=True)
    for task in missing:
        for suffix in (".png", ".mp4"):
            (made / f"{task}{suffix}").replace(FILMS / f"{film_name(task)}{suffix}")


def film_name(task: str) -> str:
    """Name of a task's film, without suffix: it says in which world it was taken."""
    return f"{task}-{json.loads(REPORT.read_text(encoding='utf-8'))['worlds'][task]}"


if __name__ == "__main__":
    main()
