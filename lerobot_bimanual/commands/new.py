"""The commands `task new` and `policy new`: a distribution that works, in which every form of its name is replaced."""

import importlib.util
import keyword
import re
import sys
from collections.abc import Collection
from dataclasses import dataclass, field
from importlib.metadata import distributions, packages_distributions
from pathlib import Path

from lerobot_bimanual.distributions import module_path
from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.files import write_file
from lerobot_bimanual.terminal import say, show_next


@dataclass
class NewConfig:
    """Flags of the commands."""

    name: str = field(kw_only=True)  # in small letters, digits and underscores, such as stack_cups
    output: Path | None = None  # new folder; by default in the current folder, with the distribution's name


def task_new(config: NewConfig) -> None:
    """Write a distribution with a task of your own, which works as it is.

    Its one file defines a block, its placement, an expert that raises it, and the conditions of success; a test plays the
    expert.
    The task's number comes from its name. Once it is installed, every command, Gymnasium and LeRobot know it.

    Examples:
        lerobot-bimanual task new --name=raise_block
    """
    package = _folder("lerobot_env_bimanual")
    tasks = [path.stem for path in package.glob("tasks/*.py")]
    hidden = (*sys.stdlib_module_names, *packages_distributions())  # a module of such a name would hide them
    taken = (*tasks, *hidden, "all", "two_armed", "test", "stage", "pose")  # suites, modules and classes
    _write(package / "new_task", "raise_block", config.name, config.output or Path(config.name), taken)


def policy_new(config: NewConfig) -> None:
    """Write a distribution with a policy of your own, which works as it is.

    Its network predicts the next keypose from where the hands are. Config, network and processors are in the files where
    LeRobot looks for them, a recipe is there for `policy benchmark`, and a test overfits a batch.

    Examples:
        lerobot-bimanual policy new --name=blind_mlp
    """
    target = config.output or Path(f"lerobot_policy_{config.name}")
    packages = [_folder("lerobot.policies"), ours := _folder("lerobot_policy_bimanual")]
    configs = [path.stem for package in packages for path in package.glob("*/configuration_*.py")]
    plugins = [str(each.name) for each in distributions()]
    taken = [re.sub("^(configuration|lerobot_policy)_", "", each) for each in (*configs, *plugins)]
    _write(ours / "new_policy", "blind_mlp", config.name, target, taken)


def _folder(package: str) -> Path:
    return module_path(package) or Path()


def _write(source: Path, old: str, name: str, target: Path, taken: Collection[str]) -> None:
    """Copy a folder to a new one, and replace its name by another one that is not taken."""
    if not re.fullmatch("[a-z][a-z0-9]*(_[a-z0-9]+)*", name) or keyword.iskeyword(name):
        raise InvalidChoice("name", name, "small letters and digits, underscores between words, no keyword")
    if name in taken:
        raise BimanualError(f"name is {name!r}, which is taken: choose another --name")
    if target.exists():
        raise BimanualError(f"{target} is there already: choose another --output")
    forms = list(zip(_forms(old), _forms(name), strict=True))
    for path in sorted(source.rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            text = path.read_text(encoding="utf-8")
            for before, after in forms:
                text = text.replace(before, after)
            written = target / str(path.relative_to(source)).replace(old, name)
            write_file(written, text)
            say(written)
    isolation = ["--no-build-isolation"] if importlib.util.find_spec("hatchling") else []
    show_next("pip", "install", *isolation, "--no-deps", "-e", target)


def _forms(name: str) -> tuple[str, str, str]:
    """A name as identifier, as class and in words."""
    return name, name.title().replace("_", ""), name.replace("_", " ")
