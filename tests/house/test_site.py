"""The site of the documentation is built, holds together, and asks the network for nothing."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

ROOT = Path(__file__).parents[2]
LOADED = re.compile(r"""<(?:script|img|link|source|iframe)[^>]*?(?:src|href)=["']?(https?:[^"'\s>]+)""")

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    command = [Path(sys.executable).with_name("mkdocs"), "build", "--strict", f"--site-dir={folder}"]
    variables = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    built = subprocess.run(command, cwd=ROOT, env=variables, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    return folder


def test_every_task_has_a_page_with_its_sentences_and_conditions(site: Path) -> None:
    for name in list_tasks():
        page = (site / f"tasks/{name}.html").read_text(encoding="utf-8")
        task = get_task(name)
        variation = task.spec.variations[-1]
        assert all(sentence in page for sentence in task.spec.instructions_for(variation))
        assert all(each.name in page for each in task.conditions(task.spec.variations[0]))
        assert "Departures from the original" in page
        assert f"tasks/{name}.html" in (site / "index.html").read_text(encoding="utf-8")


def test_no_page_loads_anything_from_the_network(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 30
    found = {address for page in pages for address in LOADED.findall(page.read_text(encoding="utf-8"))}
    assert not found
