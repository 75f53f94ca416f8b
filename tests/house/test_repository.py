"""Things that must agree across the repository, and things that must not be in it."""

import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

import lerobot_env_bimanual
from lerobot_env_bimanual.experts.world_version import CERTIFIED_MUJOCO
from lerobot_env_bimanual.gl import INSTALL

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


REQUIREMENTS = [
    Requirement(line)
    for folder in DISTRIBUTIONS.values()
    for lines in (project(folder)["dependencies"], *project(folder).get("optional-dependencies", {}).values())
    for line in lines
]


def files_of_the_repository() -> list[Path]:
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listing = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return [path for line in listing.stdout.splitlines() if (path := ROOT / line).is_file()]


def pinned(requirements: list[str]) -> dict[str, str]:
    """Versions by the name of the distribution, whatever its extras."""
    return {required.name: str(required.specifier) for required in map(Requirement, requirements)}


def test_the_four_distributions_have_one_version_and_require_each_other_in_it() -> None:
    projects = {name: project(folder) for name, folder in DISTRIBUTIONS.items()}
    assert [declared["name"] for declared in projects.values()] == [*projects]
    (version,) = {declared["version"] for declared in projects.values()}
    init = (ROOT / "lerobot_bimanual/__init__.py").read_text()
    assert f'__version__ = "{version}"' in init
    assert f"## [{version}]" in (ROOT / "CHANGELOG.md").read_text()
    assert f"version: {version}\n" in (ROOT / "CITATION.cff").read_text()
    together = pinned(project(ROOT)["optional-dependencies"]["all"])
    for plugin in [*DISTRIBUTIONS][1:]:
        assert pinned(projects[plugin]["dependencies"])["lerobot_bimanual"] == f"=={version}"
        assert together[plugin] == f"=={version}"


@pytest.mark.parametrize("name", ["LICENSE", "NOTICE"])
def test_every_distribution_carries_the_same_licence_texts(name: str) -> None:
    texts = {(folder / name).read_text() for folder in DISTRIBUTIONS.values()}
    assert len(texts) == 1


def test_the_lock_pins_every_direct_dependency_and_the_certified_mujoco_and_names_no_address() -> None:
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    assert all(re.match(r"[a-z0-9-]+==[^\s/@]+( ; .*)?$", line) for line in lines)
    groups = tomllib.loads((ROOT / "pyproject.toml").read_text())["dependency-groups"].values()
    direct = [*REQUIREMENTS, *(Requirement(line) for group in groups for line in group)]
    names = {each.name.lower().replace("_", "-") for each in direct if "bimanual" not in each.name}
    assert names <= {line.partition("==")[0] for line in lines}
    assert f"mujoco=={CERTIFIED_MUJOCO}" in (ROOT / "requirements.lock").read_text().splitlines()


def test_no_file_names_a_private_path_or_a_registry() -> None:
    offenders = []
    for path in files_of_the_repository():
        text = path.read_bytes().decode("utf-8", errors="replace")
        offenders += [f"{path.relative_to(ROOT)}: {word}" for word in FORBIDDEN if word in text]
    assert not offenders


def test_no_file_but_trained_weights_is_larger_than_a_megabyte() -> None:
    large = {path.relative_to(ROOT) for path in files_of_the_repository() if path.stat().st_size > 1_000_000}
    assert not [path for path in large if not path.match("results/checkpoints/*/model.safetensors")]


def test_every_distribution_claims_the_same_versions_of_python_and_no_other_is_allowed() -> None:
    for declared in map(project, DISTRIBUTIONS.values()):
        claimed = [name.split()[-1] for name in declared["classifiers"] if "Python :: 3" in name]
        assert claimed == ["3.12", "3.13"]
        allowed = SpecifierSet(declared["requires-python"])
        assert [minor for minor in range(8, 20) if f"3.{minor}.5" in allowed] == [12, 13]


def test_the_page_of_compatibility_states_the_declared_ranges() -> None:
    page = (ROOT / "docs/compatibility.md").read_text()
    stated = dict(re.findall(r"^\| `([\w-]+)` \| `([^`]+)` \|", page, re.MULTILINE))
    declared = {
        name: {str(found.specifier) for found in REQUIREMENTS if found.name.lower() == name}
        for name in ("lerobot", "mujoco", "gymnasium", "torch", "transformers", "wordllama", "numpy", "av")
    }
    assert {name: {range_} for name, range_ in stated.items()} == declared


def test_every_public_name_of_the_environment_is_there_and_none_besides() -> None:
    package = lerobot_env_bimanual
    assert dir(package) == sorted(package.__all__)
    assert all(hasattr(package, name) for name in package.__all__)
    assert not hasattr(package, "Keypoze")


FOLDERS = ("lerobot_bimanual", "envs", "policies", "robots", "benchmarks", "scripts", "examples", "docs")
INSTEAD = {
    r"\b(some|any|every|no)body\b|\bwhoever\b": "the subject by its name, or the passive",
    r"\bunless it is asked for\b": "by default ...; the flag that changes it",
    r"\bjust if\b": "if and only if",
    r"\bis none of\b": "is not one of",
    r"\blooks? again\b|\breread\w*": "replanning",
    r"\bthe world as it is\b|\blevel[ _]0\b": "nominal",
    r"\b(stands?|lies?) (there|once)\b|\bstands in (its|the dataset's) metadata": "is stored, exists",
    r"\bblam\w+": "failure attribution",
    r"\brungs?\b": "condition",
    r"\bwitness\w*": "episode monitor",
    r"\b(LEAST|MOST)_\w+": "MIN_, MAX_",
    r"\bladders?\b": "robustness sweep",
    r"\bblind (control|baseline)\b": "open-loop baseline",
    r"\bsolo\b|\blearners?\b|\bcampaigns?\b": "single_arm, run, evaluator",
    r"\bcertificates? (of|for)\b|\bcertif(y|ied)\b": "expert report",
    r"\bthe verb\b": "the command",
}
"""Pattern of words -> what to write."""
EXEMPT = ("benchmarks/results/", "envs/lerobot_env_bimanual/perturbations/instruction.toml")
"""Dated reports, which keep the words of their time, and instructions to a policy, which are colloquial on purpose."""


def test_no_text_uses_words_that_the_glossary_replaces() -> None:
    paths = [*ROOT.glob("*.md"), *(path for folder in FOLDERS for path in (ROOT / folder).rglob("*"))]
    texts = [path for path in paths if path.suffix in (".py", ".md", ".sh", ".toml", ".jinja", ".html")]
    assert len(texts) > 200
    found = []
    for path in texts:
        name = str(path.relative_to(ROOT))
        if name.startswith(EXEMPT) or "__pycache__" in name:
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            found += [
                f"{name}:{number}: {word[0]} -> {instead}"
                for pattern, instead in INSTEAD.items()
                for word in re.finditer(pattern, line)
            ]
    assert not found, "\n".join(found)


def test_the_drivers_to_install_are_the_same_everywhere() -> None:
    texts = (path.read_text() for path in files_of_the_repository() if path.suffix in (".md", ".yml", ".py"))
    lists = [
        found.split()
        for text in texts
        for found in re.findall(r"apt-get install (?:-y )?(lib[\w\s-]+)", text)
    ]
    wanted = set(INSTALL.split("apt-get install ")[1].split())
    assert len(lists) >= 4
    assert all(wanted.issubset(each) for each in lists)
