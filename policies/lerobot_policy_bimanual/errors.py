"""Errors of the policies: each says what was got and what is allowed."""

from lerobot_bimanual.errors import BimanualError


class BadConfig(BimanualError):
    """A value of a config that no policy can work with."""


class CheckpointError(BimanualError):
    """A checkpoint that is damaged, does not fit its config, or asks for what a checkpoint must not do."""


class NotSafeToSay(CheckpointError):
    """A checkpoint that names something beyond what is known to load nothing.

    Args:
        what: the part of the checkpoint that names it.
        named: that part's options that may do so, as text.
    """

    exit_code = 3

    def __init__(self, what: str, named: str):
        super().__init__(
            f"not safe to say: {what} loads {named or 'something'} by name and may run its code; where you trust its source, "
            "programs that load it take --trust_checkpoint=true"
        )


class BadObservation(BimanualError):
    """An observation on which no policy should act: incomplete, in other units, or of a camera that sees nothing."""
