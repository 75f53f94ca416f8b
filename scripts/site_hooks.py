"""Hooks that MkDocs calls while it builds the site: they add generated pages, and rewrite links to files of the repository.

The home page is README.md. A link to a file that is not on the site leads to the repository, or becomes plain text if the
repository has no address yet.

Run as a program, it films the experts for those task pages that have no film of their present world.
"""

import posixpath
import re
import subprocess
import sys
from contextlib import redirect_stdout
from functools import cache
from io import StringIO
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from lerobot_bimanual.cli import find_commands, main
from lerobot_env_bimanual.experts.world_version import world_versions
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

ROOT = Path(__file__).parents[1]
FILMS = ROOT / "build/films"
SOURCES = {
    "index.md": "README.md",
    "contributing.md": "CONTRIBUTING.md",
    "changelog.md": "CHANGELOG.md",
    **{f"{name}.md": f"policies/lerobot_policy_bimanual/{name}/README.md" for name in ("peract2", "rvt_lf")},
}
"""Pages from outside docs/, and where they come from."""
LINK = re.compile(r"\[([^\[\]]*)\]\(([^)#:\s]+)(#[^)\s]*)?\)")
BADGE = re.compile(r"^\[!\[.*\n", re.MULTILINE)
"""Shown by GitHub; a page that can be read without network has none."""
TASK = """# {spec.name}

{text}

Variations: {variations}. Instructions: {instructions}. Suites: {suites}.
"""
FILM = """
<video controls muted loop playsinline preload="metadata"><source src="{name}.mp4" type="video/mp4"></video>
"""


def on_config(config: MkDocsConfig) -> None:
    """Put a page for each task into the navigation."""
    (tasks,) = [section["Tasks"] for section in config.nav or [] if "Tasks" in section]
    tasks += [f"tasks/{name}.md" for name in list_tasks()]


def on_files(files: Files, config: MkDocsConfig) -> None:
    """Add the pages from outside docs/, those of tasks and commands, and the films."""
    pages = {uri: (ROOT / source).read_text(encoding="utf-8") for uri, source in SOURCES.items()}
    pages |= {f"tasks/{name}.md": _task(name) for name in list_tasks()} | {"cli.md": _command_line()}
    for uri, content in pages.items():
        files.append(File.generated(config, uri, content=content))
    for film in FILMS.glob("*.mp4"):
        files.append(File.generated(config, f"tasks/{film.name}", abs_src_path=str(film)))


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Rewrite links between files of the repository so that they work on the site."""
    uri = page.file.src_uri
    folder = posixpath.dirname(SOURCES.get(uri, f"docs/{uri}"))
    uris = {source: page_uri for page_uri, source in SOURCES.items()}

    def moved(link: re.Match[str]) -> str:
        text, target, place = link[1], posixpath.normpath(posixpath.join(folder, link[2])), link[3] or ""
        if not (ROOT / target).exists():
            return link[0]
        if not target.startswith("docs/") and target not in uris:
            return f"[{text}]({config.repo_url}/blob/HEAD/{target})" if config.repo_url else text
        there = uris.get(target, target.removeprefix("docs/"))
        return f"[{text}]({posixpath.relpath(there, posixpath.dirname(uri) or '.')}{place})"

    return LINK.sub(moved, BADGE.sub("", markdown))


def _task(name: str) -> str:
    """The page of a task: its module's docstring, its instructions, and its film if there is one."""
    task = get_task(name)
    page = TASK.format(
        spec=task.spec,
        text=sys.modules[type(task).__module__].__doc__,
        instructions=", ".join(f"`{words}`" for words in task.spec.instructions),
        variations=len(task.spec.variations),
        suites=", ".join(task.spec.suites),
    )
    film = _film_names()[name]
    return page + FILM.format(name=film) if (FILMS / f"{film}.mp4").is_file() else page


def _command_line() -> str:
    """The help of every command."""
    sections = ["# Command line\n"]
    for name in ("", *find_commands()):
        with redirect_stdout(StringIO()) as text:
            main([*name.split(), "--help"])
        sections.append(f"## {name or 'lerobot-bimanual'}\n\n```text\n{text.getvalue()}```\n")
    return "\n".join(sections)


@cache
def _film_names() -> dict[str, str]:
    """Names of the tasks' films, without suffix: they say in which world they were taken."""
    return {task: f"{task}-{world}" for task, world in world_versions(list_tasks()).items()}


def _film_experts() -> None:
    missing = [task for task, name in _film_names().items() if not (FILMS / f"{name}.mp4").is_file()]
    if not missing:
        return
    print(f"filming {len(missing)} experts, about ten seconds each on one core", flush=True)
    program, made = Path(sys.executable).with_name("lerobot-bimanual"), ROOT / "build/render"
    FILMS.mkdir(parents=True, exist_ok=True)
    for task in missing:
        words = ["task", "view", f"--task={task}", f"--output={made}"]
        subprocess.run([program, *words], check=True)
        (film,) = made.glob(f"{task}_v*.mp4")
        film.replace(FILMS / f"{_film_names()[task]}.mp4")


if __name__ == "__main__":
    _film_experts()
