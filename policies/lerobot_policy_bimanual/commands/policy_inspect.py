"""The verb `inspect`: one prediction of a trained policy beside the truth."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class PolicyInspectConfig:
    """Options of the verb `inspect`."""

    checkpoint: Path = field(kw_only=True)  # folder pretrained_model of a trained keypose policy
    dataset: Path = field(kw_only=True)  # folder of a dataset that `generate` made, either view
    index: int = 0  # row of the dataset
    rerun: bool = False  # also write a file for the viewer rerun; needs `pip install 'lerobot[viz]'`
    output: Path = Path("outputs/inspect")  # folder of the files


def policy_inspect(config: PolicyInspectConfig) -> None:
    r"""Draw what a keypose policy sees in one row of a dataset, and what it predicts.

    One picture, row_INDEX.png: the occupied voxels from three sides, over them the translation heat map of each arm,
    and the predicted hands beside the true ones; below, errors and probabilities per arm.

    Examples:
        lerobot-bimanual policy inspect --checkpoint=outputs/peract2/checkpoints/last/pretrained_model --dataset=data/lift_ball
        lerobot-bimanual policy inspect --checkpoint=outputs/peract2/checkpoints/last/pretrained_model \
            --dataset=data/lift_ball/keyframes --index=7 --rerun
    """
    from io import BytesIO

    from lerobot_bimanual.dataset.reader import find_view
    from lerobot_bimanual.output_file import check_output_file, write_file
    from lerobot_policy_bimanual.checkpoint.folder import require_checkpoint
    from lerobot_policy_bimanual.inspection.row import require_row

    require_checkpoint(config.checkpoint)
    require_row(find_view(config.dataset, ("keyframes", "frames")), config.index)
    path = config.output / f"row_{config.index:05d}.png"
    check_output_file(path)

    from lerobot_policy_bimanual.inspection.inspection import look
    from lerobot_policy_bimanual.inspection.loading import load_policy, load_row
    from lerobot_policy_bimanual.inspection.rerun_file import require_rerun, write_rerun
    from lerobot_policy_bimanual.inspection.sheet import draw_sheet

    if config.rerun:
        require_rerun()
    policy, preprocess = load_policy(config.checkpoint)
    inspection = look(policy, preprocess(load_row(config.dataset, config.index, policy.config)))
    drawn = BytesIO()
    draw_sheet(inspection, f"{policy.name}, row {config.index} of {config.dataset}").save(drawn, "PNG")
    write_file(path, drawn.getvalue())
    print(path)
    if config.rerun:
        write_rerun(inspection, path.with_suffix(".rrd"))
        print(path.with_suffix(".rrd"))
