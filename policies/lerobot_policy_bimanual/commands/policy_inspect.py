"""The command `policy inspect`: one prediction of a trained policy beside the truth."""

from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class PolicyInspectConfig:
    """Options of the command `policy inspect`."""

    checkpoint: Path = field(kw_only=True)  # folder pretrained_model of a trained keypose policy
    root: Path = field(kw_only=True)  # folder of a dataset that `dataset generate` made, view `keyframes`
    trust_checkpoint: bool = False  # load what the checkpoint names, without `policy check`
    index: int = 0  # row of the dataset
    output: Path = Path("outputs/inspect")  # folder of the picture


def policy_inspect(config: PolicyInspectConfig) -> None:
    r"""Draw what a keypose policy sees in one row of a dataset, and what it predicts.

    One picture, row_INDEX.png: the occupied voxels from three sides, over them the translation heat map of each arm,
    and the predicted hands beside the true ones; below, the errors of each arm.

    Examples:
        lerobot-bimanual policy inspect --checkpoint=outputs/peract2/checkpoints/last/pretrained_model --root=data/lift_ball
        lerobot-bimanual policy inspect --checkpoint=outputs/peract2/checkpoints/last/pretrained_model \
            --root=data/lift_ball --index=7
    """
    from io import BytesIO

    from lerobot_bimanual.checkpoint_folder import require_checkpoint
    from lerobot_bimanual.dataset.reader import find_view, read_info
    from lerobot_bimanual.errors import DatasetError
    from lerobot_bimanual.files import check_output_file, write_file
    from lerobot_bimanual.terminal import show_next

    require_checkpoint(config.checkpoint)
    path = config.output / f"row_{config.index:05d}.png"
    check_output_file(path)
    root = find_view(config.root, ("keyframes", "frames"))
    rows = read_info(root).get("total_frames")
    if not isinstance(rows, int) or not 0 <= config.index < rows:
        raise DatasetError(
            f"{root} has {rows} rows, counted from 0, so --index={config.index} is not among them"
        )

    from lerobot_policy_bimanual.inspection.loading import batch_of, load_policy, open_dataset
    from lerobot_policy_bimanual.inspection.sheet import draw_sheet

    policy, preprocess = load_policy(config.checkpoint, config.trust_checkpoint)
    batch, picture = preprocess(batch_of(open_dataset(root), [config.index])), BytesIO()
    draw_sheet(policy, batch, f"{policy.name}, row {config.index} of {config.root}").savefig(picture)
    write_file(path, picture.getvalue())
    print(path)
    paths = (f"--checkpoint={config.checkpoint}", f"--root={config.root}")
    show_next("lerobot-bimanual", "policy", "accuracy", *paths)
