"""The five cameras of the paper."""

ROOM_CAMERA_NAMES = ("front", "left_shoulder", "right_shoulder")
WRIST_CAMERA_NAMES = ("left_wrist", "right_wrist")
CAMERA_NAMES = (*ROOM_CAMERA_NAMES, *WRIST_CAMERA_NAMES)
"""In the order of every calibration vector: those fixed in the room, then those on the hands."""
