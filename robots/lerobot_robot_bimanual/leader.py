"""Base of the teleoperators: LeRobot's interface around a pair of virtual leader arms and an input device."""

from __future__ import annotations

import abc
from typing import Any, Protocol

from lerobot.teleoperators.config import TeleoperatorConfig
from lerobot.teleoperators.teleoperator import Teleoperator
from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected

from lerobot_bimanual.dataset import schema
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_robot_bimanual.leader_arms import LeaderArms


class Device(Protocol):
    """An input device of an operator."""

    def stop(self) -> None:
        """Release the device; it may be opened again."""
        ...


class Leader[D: Device](Teleoperator):
    """A pair of virtual leader arms, which an input device moves.

    A teleoperator of LeRobot does not see the robot, so this one has arms of its own, like leader arms of real robots:
    they begin at home, and their joints are the action. Where LeRobot hands over from a policy to a person
    (`lerobot-rollout --strategy.type=dagger`), it moves these arms to where the robot is.
    """

    def __init__(self, config: TeleoperatorConfig):
        super().__init__(config)
        self._arms = LeaderArms(PANDA_PAIR)
        self._device: D | None = None

    @abc.abstractmethod
    def _open(self) -> D:
        """Open the device."""

    @abc.abstractmethod
    def _follow(self, device: D) -> None:
        """Move the arms by the device's input since the last call."""

    @abc.abstractmethod
    def _forget(self, device: D) -> None:
        """Discard the device's input since the last call."""

    @property
    def action_features(self) -> dict[str, Any]:
        """The sixteen numbers of a joint action, by name."""
        return dict.fromkeys(schema.JOINT_NAMES, float)

    @property
    def feedback_features(self) -> dict[str, Any]:
        """Joints of the robot, by the same names."""
        return self.action_features

    @property
    def is_connected(self) -> bool:
        """Whether the device is being read."""
        return self._device is not None

    @property
    def is_calibrated(self) -> bool:
        """Virtual arms always are."""
        return True

    def calibrate(self) -> None:
        """Nothing to do."""

    def configure(self) -> None:
        """Nothing to do."""

    def enable_torque(self) -> None:
        """Nothing to do; its presence tells LeRobot that these arms can be moved to where the robot is."""

    def disable_torque(self) -> None:
        """Nothing to do."""

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:
        """Open the device.

        Raises:
            BimanualError: the device is not there.
            DeviceAlreadyConnectedError: it is open already.
        """
        self._device = self._open()

    @check_if_not_connected
    def get_action(self) -> dict[str, float]:
        """Joints of the leader arms after the device's input since the last call.

        Raises:
            DeviceNotConnectedError: before `connect`.
        """
        assert self._device is not None
        self._follow(self._device)
        return dict(zip(schema.JOINT_NAMES, self._arms.joint_action.tolist(), strict=True))

    @check_if_not_connected
    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Move the leader arms to where the robot is, and discard the device's input until now.

        Args:
            feedback: joint targets and openings by name, of which some may be missing.

        Raises:
            DeviceNotConnectedError: before `connect`.
        """
        assert self._device is not None
        self._forget(self._device)
        present = dict(zip(schema.JOINT_NAMES, self._arms.joint_action.tolist(), strict=True))
        self._arms.go_to([feedback.get(name, value) for name, value in present.items()])

    @check_if_not_connected
    def disconnect(self) -> None:
        """Release the device.

        Raises:
            DeviceNotConnectedError: before `connect`.
        """
        assert self._device is not None
        self._device.stop()
        self._device = None
