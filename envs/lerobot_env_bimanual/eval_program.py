"""The program `lerobot-bimanual-eval`: `lerobot-eval`, with flags and checkpoints checked first, and one progress bar."""

import logging
import sys
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

from lerobot_bimanual.checkpoint_folder import CONFIG_FILE
from lerobot_bimanual.cli.flags import parse_flags
from lerobot_bimanual.cli.lerobot_flags import is_trusted
from lerobot_bimanual.cli.lerobot_program import run_program
from lerobot_bimanual.dataset.schema import ACTION, IMAGE_PREFIX
from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.files import read_json
from lerobot_bimanual.joint_action import JOINT_ACTION_DIM
from lerobot_bimanual.keypose_layout import KEYPOSE_DIM
from lerobot_env_bimanual.options import ANY_VARIATION, EnvOptions

OPTIONS_OF_LEROBOT = (
    *("type", "task", "fps", "max_parallel_tasks"),
    *("features", "features_map", "disable_env_checker", "discover_packages_path"),
)
"""LeRobot's own options of any environment, listed here because importing LeRobot takes half a minute."""

logger = logging.getLogger(__name__)


def main() -> int:
    """Run `lerobot-eval` with the flags of this process; `--env.type` is `bimanual` unless it is given."""
    if not any(word.partition("=")[0] in ("--env.type", "--config_path") for word in sys.argv):
        sys.argv.insert(1, "--env.type=bimanual")
    return run_program("lerobot-bimanual-eval", _check, _evaluate, progress=False)


def _check(values: Mapping[str, str]) -> None:
    """Refuse flags that LeRobot would refuse half a minute later, or would take for a name on the Hub."""
    if not values.get("policy.path"):
        raise BimanualError(
            "--policy.path=FOLDER is missing: the folder `pretrained_model` of a trained policy"
        )
    # A batch of 0 leaves its size to LeRobot.
    for name, least in (("eval.n_episodes", 1), ("eval.batch_size", 0)):
        given = values.get(name, "1")
        if not given.isdecimal() or int(given) < least:
            raise InvalidChoice(f"--{name}", given, f"an integer of at least {least}")
    if values.get("env.type") == "bimanual":
        from lerobot_env_bimanual.tasks.registry import get_task, resolve_tasks

        texts = {name.removeprefix("env."): text for name, text in values.items() if name.startswith("env.")}
        ours = [each.name for each in fields(EnvOptions)]
        known = [*ours, *OPTIONS_OF_LEROBOT]
        for name in texts:
            if name.partition(".")[0] not in known:
                raise InvalidChoice("flag", f"--env.{name}", [f"--env.{each}" for each in known])
        parse_flags(EnvOptions, [f"--{name}={text}" for name, text in texts.items() if name in ours])
        for task in resolve_tasks(values.get("env.task", "push_box")):
            get_task(task).spec.variation_index(values.get("env.variation", ANY_VARIATION))


def _evaluate(values: Mapping[str, str]) -> None:
    from lerobot.scripts import lerobot_eval

    import lerobot_env_bimanual.configuration_bimanual  # noqa: F401  registers the type: the package came before LeRobot
    from lerobot_env_bimanual.sweep.checkpoint import require_safe

    if "help" in values:
        lerobot_eval.main()
        return
    checkpoint = Path(values["policy.path"])  # of the command line or of the file `--config_path`
    if not is_trusted(sys.orig_argv):
        require_safe(checkpoint)
    learned = _learned_from(checkpoint) if values.get("env.type") == "bimanual" else []
    size = f"--env.image_size={EnvOptions(image_size=values.get('env.image_size', EnvOptions.image_size)).image_size}"
    if size not in learned and any(flag.startswith("--env.image_size=") for flag in learned):
        logger.warning("the policy learned with %s, but is scored with %s", " ".join(learned), size)
    try:
        lerobot_eval.main()
    except RuntimeError as error:
        if not learned or "size mismatch" not in str(error):
            raise
        raise BimanualError(f"the policy does not fit: it learned with {' '.join(learned)}") from error


def _learned_from(checkpoint: Path) -> list[str]:
    """Flags of the environment (image size, control mode) with which a checkpoint was trained, if its config has them."""
    config = read_json(checkpoint / CONFIG_FILE) if (checkpoint / CONFIG_FILE).is_file() else {}
    images = [
        each for key, each in (config.get("input_features") or {}).items() if key.startswith(IMAGE_PREFIX)
    ]
    sizes = [EnvOptions(image_size="{}x{}".format(*each["shape"][-2:])).image_size for each in images]
    (length,) = (config.get("output_features") or {}).get(ACTION, {"shape": [0]})["shape"]
    modes = {KEYPOSE_DIM: "keypose", JOINT_ACTION_DIM: "joint"}
    flags = [f"--env.image_size={size}" for size in dict.fromkeys(sizes)]
    return [*flags, f"--env.control_mode={modes[length]}"] if length in modes else flags
