"""What MkDocs asks for while it builds the site: pages that are generated, and files of the repository that pages name.

The home page is README.md. Every page of a task is written from the registry, the expert reports and the board of results.
What a page links to outside docs/ becomes a page, too, below repository/.

As a program it films the experts for these pages, where that has not been done in their present world.
"""

import posixpath
import re
import subprocess
import sys
from functools import cache
from pathlib import Path, PurePosixPath
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
LINK = re.compile(r"\]\(([^)#:\s]+)(#[^)\s]*)?\)")
CODE = {".py": "python", ".sh": "bash", ".yaml": "yaml", ".toml": "toml", ".cff": "yaml", "": "text"}
"""Suffixes of files that are shown as a page, and their languages; others are copied as they are."""
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
    """Add the home page, the tasks' pages with their films, and the files of the repository."""
    for name, text in _task_pages().items():
        files.append(File.generated(config, name, content=text))
    for film in FILMS.glob("*.*"):
        files.append(File.generated(config, f"tasks/{film.name}", abs_src_path=str(film)))
    known = {Path("README.md"), *(path.relative_to(ROOT) for path in ROOT.glob("docs/**/*.md"))}
    left = list(known)
    while left:
        source = left.pop()
        for link, _ in LINK.findall(_text(source)) if (ROOT / source).suffix in ("", ".md") else ():
            target = Path(posixpath.normpath((source.parent if (ROOT / source).is_file() else source) / link))
            if target not in known and (ROOT / target).exists():
                known.add(target)
                left.append(target)
    for path in known:
        if path.parts[0] != "docs":
            uri = _uri(path)
            content = {"content": _text(path)} if uri.endswith(".md") else {"abs_src_path": str(ROOT / path)}
            files.append(File.generated(config, uri, **content))
            _SOURCES[uri] = path
        elif path.suffix == ".md":
            _SOURCES[_uri(path)] = path


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let links lead to where the site has what the repository has elsewhere."""
    uri = page.file.src_uri
    if uri not in _SOURCES:
        return markdown
    source = _SOURCES[uri]
    folder = source.parent if (ROOT / source).is_file() else source

    def moved(link: re.Match[str]) -> str:
        target = Path(posixpath.normpath(folder / link[1]))
        if not (ROOT / target).exists():
            return link[0]
        return f"]({posixpath.relpath(_uri(target), posixpath.dirname(uri) or '.')}{link[2] or ''})"

    return LINK.sub(moved, markdown)


_SOURCES: dict[str, Path] = {}
"""Where in the repository the text of a page comes from."""


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


def _uri(path: Path) -> str:
    """Where the site has a file or folder of the repository."""
    if path == Path("README.md"):
        return "index.md"
    if path.parts[0] == "docs":
        return PurePosixPath(*path.parts[1:]).as_posix()
    place = f"repository/{path.as_posix()}"
    if (ROOT / path).is_dir():
        return f"{place}/index.md"
    return f"{place}.md" if path.suffix in CODE else place


def _text(path: Path) -> str:
    """What a page shows of a file or folder: Markdown as it is, a folder's README or names, a program as one."""
    whole = ROOT / path
    if whole.is_dir():
        readme = whole / "README.md"
        names = sorted(each.name for each in whole.iterdir() if not each.name.startswith((".", "_")))
        listing = "\n".join(f"- [`{name}`]({name})" for name in names if name != "README.md")
        head = readme.read_text(encoding="utf-8") if readme.is_file() else f"# {path.as_posix()}\n"
        return f"{head}\n{listing}\n"
    text = whole.read_text(encoding="utf-8") if whole.suffix in (*CODE, ".md") else ""
    return f"# {path.as_posix()}\n\n```{CODE[whole.suffix]}\n{text}\n```\n" if whole.suffix in CODE else text


if __name__ == "__main__":
    _film_experts()
