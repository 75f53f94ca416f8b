"""What MkDocs asks for while it builds the site: pages that are generated, and files of the repository that pages name.

The home page is README.md. A link to what the site does not have becomes its text.

As a program it films the experts for the page of the tasks, where that has not been done in their present world.
"""

import posixpath
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from lerobot_env_bimanual.experts.world_version import world_versions
from lerobot_env_bimanual.tasks.registry import list_tasks

ROOT = Path(__file__).parents[1]
FILMS = ROOT / "build/films"
SOURCES = {"index.md": "README.md", "contributing.md": "CONTRIBUTING.md", "changelog.md": "CHANGELOG.md"}
"""Pages from outside docs/, and where they come from."""
LINK = re.compile(r"\[([^\[\]]*)\]\(([^)#:\s]+)(#[^)\s]*)?\)")
FILM = """
## Film of `{task}`

<video controls muted loop playsinline preload="metadata"><source src="{name}.mp4" type="video/mp4"></video>
"""


def on_files(files: Files, config: MkDocsConfig) -> None:
    """Add the pages from outside docs/, and the films."""
    for uri, source in SOURCES.items():
        files.append(File.generated(config, uri, content=(ROOT / source).read_text(encoding="utf-8")))
    for film in FILMS.glob("*.mp4"):
        files.append(File.generated(config, film.name, abs_src_path=str(film)))


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let links lead to where the site has what the repository has elsewhere, and show the films."""
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

    films = [
        each for each in _film_names().items() if uri == "tasks.md" and (FILMS / f"{each[1]}.mp4").is_file()
    ]
    return LINK.sub(moved, markdown) + "".join(FILM.format(task=task, name=name) for task, name in films)


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
        words = ["task", "view", f"--task={task}", "--window=false", f"--output={made}"]
        subprocess.run([program, *words], check=True)
        (film,) = made.glob(f"{task}_v*.mp4")
        film.replace(FILMS / f"{_film_names()[task]}.mp4")


if __name__ == "__main__":
    _film_experts()
