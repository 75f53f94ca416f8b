"""The verb `envhub`: the environment as a repository on the Hugging Face Hub."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from lerobot_env_bimanual.options import EnvOptions


@dataclass
class EnvhubConfig(EnvOptions):
    """Flags of the verb `envhub`: what is chosen here is what everybody gets."""

    task: str = "all"  # task and suite names, comma separated
    root: Path = field(kw_only=True)  # folder of the repository's files
    repo_id: str = "local/bimanual"  # name on the Hub, USER/NAME or ORGANISATION/NAME
    push_to_hub: bool = False  # upload it there
    private: bool = False  # hide a new repository from others; an existing one stays as it is
    branch: str | None = None  # a branch instead of `main`


def envhub(config: EnvhubConfig) -> None:
    """Make the repository from which LeRobot loads these environments by a name, and upload it.

    It holds `env.py`, whose `make_env` LeRobot calls, a card, and the distributions that have to be installed. The
    simulation is not in it: whoever loads it needs `lerobot_env_bimanual` in the same version. In Python:

        from lerobot.envs.factory import make_env
        envs = make_env("me/bimanual", n_envs=1, trust_remote_code=True)

    Examples:
        lerobot-bimanual envhub --root=outputs/envhub
        lerobot-bimanual envhub --root=outputs/envhub --task=symmetric --image_size=128
        lerobot-bimanual envhub --root=outputs/envhub --repo_id=me/bimanual --push_to_hub --private
    """
    from lerobot_bimanual.hub import check_name, open_repository
    from lerobot_env_bimanual.envhub import environment_files, upload_environment, write_environment

    check_name(config.repo_id)
    files = environment_files(config.task, config, config.repo_id)
    if config.push_to_hub:
        open_repository(config.repo_id, repo_type="model", private=config.private)
    write_environment(config.root, files)
    print(f"{config.root}: {', '.join(files)}")
    if config.push_to_hub:
        print(upload_environment(config.root, config.repo_id, config.branch))
