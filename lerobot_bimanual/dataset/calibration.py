"""Calibration that holds for all rows of a dataset, stored once in its metadata."""

import json
from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from lerobot_bimanual.cameras import CAMERA_NAMES, ROOM_CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.results.record import BadRecord, Record


class Calibration(Record):
    """Intrinsics of all cameras, and poses of those in the room; rows then hold the poses of the wrist cameras alone.

    It is in the `info` of the feature `WRIST_EXTRINSICS`, which LeRobot keeps when it merges datasets.

    Attributes:
        intrinsics: camera -> row-major 3 x 3 pinhole matrix in pixels.
        world_T_camera: camera in the room -> row-major 4 x 4 matrix, OpenCV axes, m.
    """

    intrinsics: dict[str, Annotated[list[float], Field(min_length=9, max_length=9)]]
    world_T_camera: dict[str, Annotated[list[float], Field(min_length=16, max_length=16)]]  # noqa: N815

    @model_validator(mode="after")
    def _of_every_camera(self) -> Self:
        cameras = {*self.intrinsics}, {*self.world_T_camera}
        if cameras != ({*CAMERA_NAMES}, {*ROOM_CAMERA_NAMES}):
            raise ValueError("a camera is missing or unknown")
        return self

    @classmethod
    def of_observation(cls, observation: Mapping[str, NDArray]) -> Self:
        """The calibration in an observation of all five cameras, by the dataset's keys."""
        intrinsics = observation[schema.CAMERA_INTRINSICS].reshape(len(CAMERA_NAMES), -1).tolist()
        extrinsics = observation[schema.CAMERA_EXTRINSICS].reshape(len(CAMERA_NAMES), -1).tolist()
        return cls(
            intrinsics=dict(zip(CAMERA_NAMES, intrinsics, strict=True)),
            world_T_camera=dict(zip(ROOM_CAMERA_NAMES, extrinsics, strict=False)),
        )

    @classmethod
    def of_features(cls, features: Mapping[str, Mapping[str, Any]]) -> Self | None:
        """The calibration in a dataset's feature table; None where every row holds all of it, as in a perturbed world.

        Raises:
            DatasetError: it is damaged.
        """
        info = features.get(schema.WRIST_EXTRINSICS, {}).get("info") or {}
        if schema.CALIBRATION_INFO not in info:
            return None
        try:
            return cls.from_json(json.dumps(info[schema.CALIBRATION_INFO]))
        except BadRecord as error:
            raise DatasetError(f"the calibration in meta/info.json is damaged: {error}") from None

    @cached_property
    def vectors(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Extrinsics (48,) of the cameras in the room, and intrinsics (45,) of all cameras."""
        extrinsics = np.concatenate([self.world_T_camera[name] for name in ROOM_CAMERA_NAMES])
        intrinsics = np.concatenate([self.intrinsics[name] for name in CAMERA_NAMES])
        return extrinsics.astype(np.float32), intrinsics.astype(np.float32)

    def row_without_calibration(self, columns: Mapping[str, Any]) -> dict[str, Any]:
        """What a row holds beside this calibration, of all columns of an observation.

        Raises:
            DatasetError: the row has another calibration.
        """
        others = dict(columns)
        room, moving = np.split(others.pop(schema.CAMERA_EXTRINSICS), [len(self.vectors[0])])
        if not all(map(np.array_equal, (room, others.pop(schema.CAMERA_INTRINSICS)), self.vectors)):
            raise DatasetError(
                "the calibration of a row differs from that in meta/info.json, which holds for all rows"
            )
        return others | {schema.WRIST_EXTRINSICS: moving}
