"""The environment as a repository on the Hub, from which LeRobot loads it by its name.

LeRobot's `make_env("USER/NAME", trust_remote_code=True)` downloads `env.py` from there and calls its `make_env`. The
simulation stays in this distribution: the repository says which version of it, and with which tasks and options.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from importlib.metadata import version
from pathlib import Path

from huggingface_hub import HfApi, ModelCardData, constants

from lerobot_bimanual.distributions import entries
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.hub import plain_errors
from lerobot_bimanual.output_file import write_file
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.tasks.registry import TASKS_GROUP, get_task, resolve_tasks

DISTRIBUTION = "lerobot_env_bimanual"
FILES = ("env.py", "README.md", "requirements.txt")
TAGS = ("LeRobot", "robotics", "simulation", "mujoco", "bimanual", "environment")

ENV_PY = '''"""Bimanual manipulation tasks in MuJoCo: `make_env` is what LeRobot calls.

The simulation is the distribution {distribution} {version}; requirements.txt installs it.
"""

from importlib.metadata import version

from lerobot_env_bimanual import BimanualEnvConfig

VERSION = "{version}"
OPTIONS = {options}

if version("{distribution}") != VERSION:
    raise ImportError(
        f"these environments are those of {distribution} {{VERSION}}, in another version they may differ: "
        f"pip install {distribution}=={{VERSION}}"
    )


def make_env(n_envs=1, use_async_envs=False, cfg=None):
    """Vector environments as `{{task name: {{task id: environment}}}}`; none starts before its first reset.

    Args:
        n_envs: parallel episodes per task.
        use_async_envs: one process per episode.
        cfg: LeRobot's config of the environment; its `task`, unless that is None, takes the place of the tasks here.
    """
    chosen = OPTIONS if cfg is None or cfg.task is None else OPTIONS | {{"task": cfg.task}}
    return BimanualEnvConfig(**chosen).create_envs(n_envs=n_envs, use_async_envs=use_async_envs)
'''

CARD = """---
{metadata}
---

# {repo_id}

Bimanual manipulation tasks with two Franka arms in MuJoCo, for LeRobot: RGB-D and calibration of five cameras, and two
kinds of action, joints or whole motions of both hands. The simulation is the Python distribution `{distribution}`,
version {version}; this repository chooses tasks and options.

```bash
pip install -r requirements.txt
```

```python
from lerobot.envs.factory import make_env

# `env.py` of this repository is run on your machine: read it first, and name its commit, "{repo_id}@COMMIT".
envs = make_env("{repo_id}", n_envs=1, trust_remote_code=True)
env = envs["{task}"][{id}]
observation, info = env.reset(seed=[0])
```

| task | id | instruction | variations |
|---|---|---|---|
{rows}

Options other than the defaults: {options}. A LeRobot config with a `task` (a name, a suite or a comma list) chooses other
tasks than these.
"""


def environment_files(tasks: str, options: EnvOptions, repo_id: str) -> dict[str, str]:
    """The files of the repository, by name.

    Args:
        tasks: names and suites, comma separated.
        options: of the environments.
        repo_id: USER/NAME on the Hub.

    Raises:
        UnknownTask: there is no such task.
        UnknownVariation: one of the tasks does not have the chosen variation.
        BimanualError: an option names a folder of this machine.
    """
    names = resolve_tasks(tasks)
    specs = [get_task(name).spec for name in names]
    for spec in specs:
        spec.variation_index(options.variation)
    chosen = _departures(options)
    if folders := [name for name in chosen if name.endswith("_dir")]:
        raise BimanualError(
            f"{', '.join(folders)} names a folder of this machine, and the environment is for all: leave it out"
        )
    installed = version(DISTRIBUTION)
    code = ENV_PY.format(
        distribution=DISTRIBUTION, version=installed, options=repr({"task": ",".join(names)} | chosen)
    )
    card = CARD.format(
        metadata=ModelCardData(license="apache-2.0", library_name="lerobot", tags=list(TAGS)).to_yaml(),
        repo_id=repo_id,
        distribution=DISTRIBUTION,
        version=installed,
        task=specs[0].name,
        id=specs[0].id,
        rows="\n".join(
            f"| `{spec.name}` | {spec.id} | {spec.instructions[0]} | {len(spec.variations)} |"
            for spec in specs
        ),
        options=", ".join(f"`{name}={value}`" for name, value in chosen.items()) or "none",
    )
    return dict(zip(FILES, (code, card, "".join(f"{line}\n" for line in _requirements(names))), strict=True))


def write_environment(folder: Path, files: dict[str, str]) -> None:
    """Write the repository into a folder, in the place of an earlier one.

    Raises:
        UnwritableOutput: it cannot be written.
    """
    for name, text in files.items():
        write_file(folder / name, text)


def upload_environment(folder: Path, repo_id: str, branch: str | None = None) -> str:
    """Make an existing repository hold the environment, in one commit; its other files stay.

    Args:
        folder: where `write_environment` has written.
        repo_id: USER/NAME or ORGANISATION/NAME.
        branch: branch instead of `main`; made if it does not exist.

    Returns:
        What LeRobot's `make_env` takes: the repository at the new commit.

    Raises:
        BimanualError: the Hub refuses or cannot be reached.
    """
    hub = HfApi()
    with plain_errors(repo_id):
        if branch is not None:
            hub.create_branch(repo_id, branch=branch, exist_ok=True)
        commit = hub.upload_folder(
            repo_id=repo_id,
            folder_path=folder,
            revision=branch,
            allow_patterns=list(FILES),
            commit_message="Upload environment with lerobot_bimanual",
        )
    return f"{constants.ENDPOINT}/{repo_id}, to be loaded as {repo_id}@{commit.oid}"


def _departures(options: EnvOptions) -> dict[str, object]:
    """The options that are not at their defaults, by name."""
    return {
        field.name: value
        for field in fields(EnvOptions)
        if (value := getattr(options, field.name)) != field.default
    }


def _requirements(tasks: Sequence[str]) -> list[str]:
    """This distribution, and those that bring the tasks that are not its own."""
    others = entries(TASKS_GROUP)
    needed = {(DISTRIBUTION, version(DISTRIBUTION))}
    for task in tasks:
        if task in others and (brought_by := others[task].dist) is not None:
            needed.add((brought_by.name, brought_by.version))
    return [f"{name}=={installed}" for name, installed in sorted(needed)]
