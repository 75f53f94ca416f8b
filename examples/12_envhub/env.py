"""The environments as a repository on the Hub: LeRobot calls `make_env` of a file with this name.

Choose tasks and options below and upload this folder, with a requirements.txt that names the distribution and version:

    echo "lerobot_env_bimanual==0.1.0" > examples/12_envhub/requirements.txt
    hf upload me/bimanual examples/12_envhub

Anyone who has installed the requirements then loads the environments by that name:

    from lerobot.envs.factory import make_env
    envs = make_env("me/bimanual@COMMIT", n_envs=2, trust_remote_code=True)
    env = envs["all"][0]  # the suite, and the number of the task in the alphabet

LeRobot runs this file on the user's machine, so users should read it and name its commit.
"""

from importlib.metadata import version

from lerobot_env_bimanual import BimanualEnvConfig

VERSION = "0.1.0"
OPTIONS = {"task": "all", "image_size": 128, "obs": "rgb"}

if version("lerobot_env_bimanual") != VERSION:
    raise ImportError(
        f"these environments are those of lerobot_env_bimanual {VERSION}; worlds of another version may differ. "
        f"pip install lerobot_env_bimanual=={VERSION}"
    )


def make_env(n_envs=1, use_async_envs=False, cfg=None):
    """Vector environments as `{suite: {number: environment}}`; none starts before its first reset.

    Args:
        n_envs: parallel episodes per task.
        use_async_envs: one process per episode.
        cfg: LeRobot's config of the environment; its `task`, if any, replaces the tasks above.
    """
    chosen = OPTIONS if cfg is None or cfg.task is None else OPTIONS | {"task": cfg.task}
    return BimanualEnvConfig(**chosen).create_envs(n_envs=n_envs, use_async_envs=use_async_envs)
