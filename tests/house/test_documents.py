"""Tables and links in the documents are true; their site is built, holds together, and asks the network for nothing."""

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from documents import DOCUMENTS, ROOT

LINK = re.compile(r"\]\(([^)#:]+)(?:#[^)]*)?\)")


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_to_files(document: Path) -> None:
    for link in LINK.findall(document.read_text()):
        is_githubs = link.startswith("../../actions/")
        assert is_githubs or (document.parent / link).exists(), link


def test_the_readme_is_at_most_six_kilobytes_and_the_pages_are_short() -> None:
    assert len((ROOT / "README.md").read_bytes()) <= 6 * 1024
    words = {page: _words(page) for page in (ROOT / "README.md", *ROOT.glob("docs/*.md"))}
    assert {page.name: count for page, count in words.items() if count > 2500} == {}
    assert sum(words.values()) <= 20_000


def _words(page: Path) -> int:
    """Words of a page; in one that a command writes whole, rows of tables are figures to look up, and not counted."""
    text = page.read_text(encoding="utf-8")
    return len((re.sub(r"(?m)^\|.*", "", text) if "; do not edit." in text else text).split())


def test_every_page_is_in_the_navigation_of_the_site() -> None:
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:\n")[2]
    assert {path.name for path in ROOT.glob("docs/*.md")} <= {*re.findall(r"[\w/]+\.md", navigation)}


def test_the_files_and_classes_that_the_page_of_the_architecture_names_exist() -> None:
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    plugins = [path.parent for path in ROOT.glob("*/lerobot_*_bimanual/__init__.py")]
    packages = [ROOT, ROOT / "lerobot_bimanual", *plugins]
    named = set(re.findall(r"`([\w/.]+(?:\.py|/))`", page))
    assert [name for name in named if not any((package / name).exists() for package in packages)] == []
    sources = "".join(path.read_text() for package in packages[1:] for path in package.rglob("*.py"))
    assert [name for name in re.findall(r"`([A-Z]\w+)`", page) if f"class {name}" not in sources] == []


def test_the_table_of_the_schema_names_every_column() -> None:
    from lerobot_bimanual.dataset import feature_table, schema

    text = (ROOT / "docs/schema.md").read_text()
    columns = [*schema.VECTORS.items(), *((schema.ACTION, names) for names in feature_table.ACTIONS.values())]
    for key, elements in columns:
        assert f"| `{key}` | ({len(elements)},) |" in text
    assert all(re.search(rf"^\|.*`{key}`.* \| \(1,\) \|", text, re.M) for key in feature_table.SCALARS)


def test_the_table_of_options_is_that_of_the_environment() -> None:
    from dataclasses import fields

    from lerobot_env_bimanual import BimanualEnvConfig
    from lerobot_env_bimanual.options import EnvOptions

    section = (ROOT / "docs/environment.md").read_text().partition("## Options\n")[2]
    shown = dict(re.findall(r"^\| `(\w+)` \| `([^`]*)` \|", section, re.MULTILINE))
    options = {field.name: str(field.default) for field in fields(EnvOptions)}
    assert shown == {"task": str(BimanualEnvConfig().task)} | options


def test_the_table_of_cameras_is_the_scene() -> None:
    from lerobot_env_bimanual.world.arena import FIXED_CAMERAS

    text = (ROOT / "docs/environment.md").read_text()
    for name, (*ends, fovy_deg) in FIXED_CAMERAS.items():
        places = " | ".join(", ".join(f"{value:.2f}" for value in end) for end in ends)
        assert f"| `{name}` | {places} | {fovy_deg:g}° |" in text


def test_tables_of_pages_are_those_of_the_results_and_the_registry() -> None:
    tables = runpy.run_path(str(ROOT / "scripts/tables.py"))
    for name, (place, _) in tables["TABLES"].items():
        page = (ROOT / place).read_text(encoding="utf-8")
        assert tables["with_table"](page, name) == page, "run scripts/tables.py"


def test_the_sums_of_shifted_hands_are_those_of_their_page() -> None:
    pages = [(ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("hands.md", "coordination.md")]
    _, measured = pages[0].split("## Shifted hands in `standard`\n")
    by_task = [
        [[int(count) for count in cell.split(",")] for cell in row.split("|")[2:4]]
        for row in re.findall(r"^\| `.*", measured.partition("\n## ")[0], re.MULTILINE)
    ]
    for line, solved in zip(
        ("both hands the same way", "opposite ways"), zip(*by_task, strict=True), strict=True
    ):
        assert (
            f"| {line} | {' | '.join(str(sum(shift)) for shift in zip(*solved, strict=True))} |" in pages[1]
        )


LOADED = re.compile(r"""<(?:script|img|link|source|iframe)[^>]*?(?:src|href)=["']?(https?:[^"'\s>]+)""")


@pytest.mark.slow
def test_the_site_is_built_and_no_page_loads_anything_from_the_network(tmp_path: Path) -> None:
    command = [Path(sys.executable).with_name("mkdocs"), "build", "--strict", f"--site-dir={tmp_path}"]
    variables = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    built = subprocess.run(command, cwd=ROOT, env=variables, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    pages = {page.name: page.read_text(encoding="utf-8") for page in tmp_path.rglob("*.html")}
    assert "lerobot_env_bimanual.BimanualEnv.step" in pages["api.html"]
    assert "--episodes_per_shard" in pages["cli.html"]
    assert not {address for text in pages.values() for address in LOADED.findall(text)}
