"""The command `dataset push`: a dataset onto the Hugging Face Hub."""

from dataclasses import dataclass, field
from pathlib import Path

from lerobot_bimanual.dataset.provenance import Provenance
from lerobot_bimanual.terminal import show_next


@dataclass
class DatasetPushConfig:
    """Options of the command `dataset push`."""

    root: Path = field(kw_only=True)  # folder of the dataset; of two views from one run, name one
    repo_id: str = field(kw_only=True)  # where to, USER/NAME or ORGANISATION/NAME
    private: bool = False  # hide a new repository from others; an existing one stays as it is
    # A branch instead of `main`; load it with LeRobotDataset(repo_id, revision=branch).
    branch: str | None = None


def dataset_push(config: DatasetPushConfig) -> None:
    """Upload a dataset with its card to the Hugging Face Hub.

    The repository is made if it does not exist, and then holds exactly this dataset: files of an earlier upload that
    do not belong to it are deleted in the same commit. The commit on `main` gets LeRobot's version tag, which
    LeRobotDataset(repo_id) asks for. The card in ROOT is written again with the name of the repository.

    Examples:
        hf auth login
        lerobot-bimanual dataset push --root=data/lift_ball --repo_id=me/lift_ball --private
    """
    from lerobot_bimanual.dataset.hub import push_dataset

    print(push_dataset(config.root, config.repo_id, private=config.private, branch=config.branch))
    made = Provenance.of_dataset(config.root)
    policy = "peract2" if made is not None and made.is_for_keypose_policies else "act"
    flags = [f"--policy.type={policy}", "--policy.push_to_hub=false", f"--dataset.repo_id={config.repo_id}"]
    flags += [f"--dataset.revision={config.branch}"] if config.branch else []
    show_next("lerobot-bimanual-train", *flags)
