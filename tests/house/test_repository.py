"""Things that must agree across the repository, and things that must not be in it."""

import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
DISTRIBUTIONS = {
    "lerobot_bimanual": ROOT,
    "lerobot_env_bimanual": ROOT / "envs",
    "lerobot_policy_bimanual": ROOT / "policies",
    "lerobot_robot_bimanual": ROOT / "robots",
}
# Put together from halves, so that this file passes its own test.
FORBIDDEN = [
    *("/" + folder for folder in ("work/", "root/", "tmp/team", "opt/pypi")),
    *("pypi" + ".org", "files.python" + "hosted", "index" + "-url", "DESIGN" + ".md", "CONTRACT" + ".md"),
]


def project(folder: Path) -> dict[str, Any]:
    return tomllib.loads((folder / "pyproject.toml").read_text())["project"]


def files_of_the_repository() -> list[Path]:
    listing = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    if listing.returncode != 0:
        pytest.skip("not a git checkout")
    return [path for line in listing.stdout.splitlines() if (path := ROOT / line).is_file()]


def test_the_four_distributions_have_one_version_and_require_each_other_in_it() -> None:
    projects = {name: project(folder) for name, folder in DISTRIBUTIONS.items()}
    assert {name: declared["name"] for name, declared in projects.items()} == {
        name: name for name in projects
    }
    (version,) = {declared["version"] for declared in projects.values()}
    init = (ROOT / "lerobot_bimanual/__init__.py").read_text()
    assert f'__version__ = "{version}"' in init
    assert f"## [{version}]" in (ROOT / "CHANGELOG.md").read_text()
    assert f"version: {version}\n" in (ROOT / "CITATION.cff").read_text()
    for plugin in [*DISTRIBUTIONS][1:]:
        assert f"lerobot_bimanual=={version}" in projects[plugin]["dependencies"]
        assert f"{plugin}=={version}" in project(ROOT)["optional-dependencies"]["all"]


@pytest.mark.parametrize("name", ["LICENSE", "NOTICE"])
def test_every_distribution_carries_the_same_licence_texts(name: str) -> None:
    texts = {(folder / name).read_text() for folder in DISTRIBUTIONS.values()}
    assert len(texts) == 1


def test_the_lock_pins_every_direct_dependency_and_names_no_address() -> None:
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    assert all(re.match(r"[a-z0-9-]+==[^\s/@]+( ; .*)?$", line) for line in lines)
    pinned = {line.partition("==")[0] for line in lines}
    for folder in DISTRIBUTIONS.values():
        declared = tomllib.loads((folder / "pyproject.toml").read_text())
        requirements = [
            *declared["project"]["dependencies"],
            *(each for group in declared.get("dependency-groups", {}).values() for each in group),
        ]
        names = {
            re.split(r"[^A-Za-z0-9_-]", requirement)[0].replace("_", "-") for requirement in requirements
        }
        ours = {name.replace("_", "-") for name in DISTRIBUTIONS}
        assert names - ours <= pinned


def test_no_file_names_a_private_path_or_a_registry() -> None:
    offenders = []
    for path in files_of_the_repository():
        text = path.read_bytes().decode("utf-8", errors="replace")
        offenders += [f"{path.relative_to(ROOT)}: {word}" for word in FORBIDDEN if word in text]
    assert not offenders


def test_no_file_but_trained_weights_is_larger_than_a_megabyte() -> None:
    large = {path.relative_to(ROOT) for path in files_of_the_repository() if path.stat().st_size > 1_000_000}
    assert not [path for path in large if not path.match("results/checkpoints/*/model.safetensors")]
