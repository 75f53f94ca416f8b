"""The site of the documentation is built, holds together, and asks the network for nothing."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LOADED = re.compile(r"""<(?:script|img|link|source|iframe)[^>]*?(?:src|href)=["']?(https?:[^"'\s>]+)""")

pytestmark = pytest.mark.slow


def test_the_site_is_built_and_no_page_loads_anything_from_the_network(tmp_path: Path) -> None:
    command = [Path(sys.executable).with_name("mkdocs"), "build", "--strict", f"--site-dir={tmp_path}"]
    variables = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    built = subprocess.run(command, cwd=ROOT, env=variables, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    pages = {page.name: page.read_text(encoding="utf-8") for page in tmp_path.rglob("*.html")}
    assert "lerobot_env_bimanual.BimanualEnv.step" in pages["api.html"]
    assert "--episodes_per_shard" in pages["cli.html"]
    assert not {address for text in pages.values() for address in LOADED.findall(text)}
