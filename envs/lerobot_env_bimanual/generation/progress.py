"""The progress bar: episodes, time to go, and demonstrations per hour of this run."""

from __future__ import annotations

from typing import IO, Self

from tqdm import tqdm


class Progress:
    """A bar that counts episodes, those of earlier runs included; its rate and time to go are of this run alone.

    Args:
        total: episodes of the whole dataset.
        file: where it is drawn; standard error by default.
    """

    def __init__(self, total: int, file: IO[str] | None = None):
        self._bar = tqdm(total=total, unit="demo", smoothing=0, file=file)
        self._base: int | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the bar as it stands."""
        self._bar.close()

    def start_from(self, episodes: int, successes: int) -> None:
        """Say how many episodes are there.

        Args:
            episodes: in finished shards.
            successes: episodes recorded by this run until now.
        """
        if self._base is None:
            self._bar.initial = episodes
        self._base = episodes - successes
        self.show(successes)

    def show(self, successes: int) -> None:
        """Draw the bar with so many episodes recorded by this run."""
        assert self._base is not None
        self._bar.n = self._base + successes
        elapsed_s = max(self._bar.format_dict["elapsed"], 1e-9)
        self._bar.set_postfix_str(f"{3600 * successes / elapsed_s:.0f} demos/h")
