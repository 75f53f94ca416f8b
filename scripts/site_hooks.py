"""What MkDocs asks for while it builds the site: pages that are generated, and files of the repository that pages name.

The home page is README.md. Every page of a task is written from the registry, the expert reports and the board of results.
A link to what the site does not have becomes its text.

As a program it films the experts for these pages, where that has not been done in their present world.
"""

import posixpath
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from lerobot_bimanual.pages import markdown_table
from lerobot_bimanual.reports.benchmark_page import read_results, success_table
from lerobot_env_bimanual.reports.expert_tables import ExpertReports
from lerobot_env_bimanual.reports.task_pages import task_pages

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "results"
FILMS = ROOT / "build/films"
TASKS_ENTRY = "Tasks"
"""Of the navigation, to which the tasks' pages are added."""
SOURCES = {"index.md": "README.md", "contributing.md": "CONTRIBUTING.md", "changelog.md": "CHANGELOG.md"}
"""Pages from outside docs/, and where they come from."""
LINK = re.compile(r"\[([^\[\]]*)\]\(([^)#:\s]+)(#[^)\s]*)?\)")
FILM = """\
<video controls muted loop playsinline preload="metadata"><source src="{name}.mp4" type="video/mp4"></video>

![The expert's episode, at the start and at the end of every keypose]({name}.png)
"""
NO_ROWS = "No policy has been scored on this task in this world yet."
ROWS = """\
Successes of unseen episodes, and their 95 % Wilson intervals; [results](../results.md) says how each was trained.

{table}"""


def on_config(config: MkDocsConfig) -> None:
    """Add the tasks' pages to the navigation."""
    assert config.nav is not None
    pages: list[Any] = next(entry[TASKS_ENTRY] for entry in config.nav if TASKS_ENTRY in entry)
    pages += [{task: f"tasks/{task}.md"} for task in _expert_reports().tasks]


def on_files(files: Files, config: MkDocsConfig) -> None:
    """Add the pages from outside docs/, and the tasks' pages with their films."""
    pages = {uri: (ROOT / source).read_text(encoding="utf-8") for uri, source in SOURCES.items()}
    for name, text in (pages | _task_pages()).items():
        files.append(File.generated(config, name, content=text))
    for film in FILMS.glob("*.*"):
        files.append(File.generated(config, f"tasks/{film.name}", abs_src_path=str(film)))


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let links lead to where the site has what the repository has elsewhere."""
    uri = page.file.src_uri
    folder = posixpath.dirname(SOURCES.get(uri, f"docs/{uri}"))
    uris = {source: page_uri for page_uri, source in SOURCES.items()}

    def moved(link: re.Match[str]) -> str:
        text, target, place = link[1], posixpath.normpath(posixpath.join(folder, link[2])), link[3] or ""
        if not (ROOT / target).exists():
            return link[0]
        if not target.startswith("docs/") and target not in uris:
            return text
        there = uris.get(target, target.removeprefix("docs/"))
        return f"[{text}]({posixpath.relpath(there, posixpath.dirname(uri) or '.')}{place})"

    return LINK.sub(moved, markdown)


@cache
def _expert_reports() -> ExpertReports:
    return ExpertReports.read(RESULTS / "expert_reports")


def _film_name(task: str) -> str:
    """Name of a task's film, without suffix: it says in which world it was taken."""
    return f"{task}-{_expert_reports().reports['expert'].worlds[task]}"


def _film_experts() -> None:
    names = {task: _film_name(task) for task in _expert_reports().tasks}
    missing = [task for task, name in names.items() if not (FILMS / f"{name}.mp4").is_file()]
    if not missing:
        return
    print(f"filming {len(missing)} experts, about ten seconds each on one core", flush=True)
    program, made = Path(sys.executable).with_name("lerobot-bimanual"), ROOT / "build/render"
    words = ["task", "render", f"--task={','.join(missing)}", "--quality=observation", f"--output={made}"]
    subprocess.run([program, *words], check=True)
    FILMS.mkdir(parents=True, exist_ok=True)
    for task in missing:
        for suffix in (".png", ".mp4"):
            (made / f"{task}{suffix}").replace(FILMS / f"{names[task]}{suffix}")


def _task_pages() -> dict[str, str]:
    reports, results = _expert_reports(), read_results(RESULTS / "leaderboard").values()
    pictures, policies = {}, {}
    for task in reports.tasks:
        scored = [result for result in results if result.task == task]
        name = _film_name(task)
        pictures[task] = FILM.format(name=name) if (FILMS / f"{name}.mp4").is_file() else ""
        policies[task] = ROWS.format(table=markdown_table(success_table(scored))) if scored else NO_ROWS
    return {f"tasks/{task}.md": page for task, page in task_pages(reports, pictures, policies).items()}


if __name__ == "__main__":
    _film_experts()
