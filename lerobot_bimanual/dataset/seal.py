"""The seal of a dataset: `meta/SHA256SUMS`, the hash of every file that was published together.

`generate` writes it last, it travels to the Hub with the rest, and `sha256sum --check meta/SHA256SUMS` reads it in
the dataset's folder. It says that a dataset is whole and unchanged, not who made it: whoever changes a file on purpose
can seal it again, and only replay shows that.

Everything is sealed, the card included, because nothing changes a card by itself: the Hub leaves it alone, and `push`,
which writes the name of the repository into it, seals it anew. Whoever edits a card on the Hub's pages, or pushes with
LeRobot's own card, has another card than was published, and is told so.
"""

from collections.abc import Collection, Iterator
from pathlib import Path

from lerobot_bimanual import checksums
from lerobot_bimanual.checksums import SUMS_FILE, is_as_listed, sums_problems, write_sums

SEAL_FILE = Path("meta", SUMS_FILE)

HARMLESS = (".cache", ".git", ".gitattributes")
"""What the Hub, its downloads and git add beside a dataset; no loader looks into it."""


def write_seal(root: Path) -> None:
    """List the hash of every file of a finished dataset.

    Args:
        root: folder of the dataset, one view.

    Raises:
        DatasetError: there is something that is not a plain file.
    """
    write_sums(root, SEAL_FILE.as_posix(), HARMLESS)


def seal_problems(root: Path, rewritten: Collection[Path] = ()) -> Iterator[str]:
    """In what a dataset is not as it was published, in one sentence each; nothing if it is.

    Reads every file once, and none outside the dataset, whatever the seal or a link says.

    Args:
        root: folder of the dataset, one view.
        rewritten: files that the caller is about to write anew, so that it does not matter what they are.
    """
    files = [path.as_posix() for path in rewritten]
    yield from sums_problems(root, SEAL_FILE.as_posix(), HARMLESS, files)


def what_is_no_file(root: Path) -> list[str]:
    """A sentence for everything in a dataset through which a reader would leave it or wait for ever: links and pipes."""
    return checksums.what_is_no_file(root, HARMLESS)


def is_as_sealed(root: Path, file: Path) -> bool:
    """Whether one file of a dataset is as it was published; False also if the seal is damaged or does not list it.

    Args:
        root: folder of a dataset that has a seal.
        file: path of the file in the dataset.
    """
    return is_as_listed(root, SEAL_FILE.as_posix(), file.as_posix())
