"""Errors of the policies: each says what was got and what is allowed."""

from lerobot_bimanual.errors import BimanualError


class BadConfig(BimanualError):
    """A value of a config that no policy can work with."""


class CheckpointError(BimanualError):
    """A checkpoint that is damaged, does not fit its config, or asks for what a checkpoint must not do."""


class BadObservation(BimanualError):
    """An observation on which no policy should act: incomplete, in other units, or of a camera that sees nothing."""
