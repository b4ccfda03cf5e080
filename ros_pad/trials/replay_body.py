# SPDX-License-Identifier: Apache-2.0
"""Replay the body estimator of a bag: IMU, joints and forces through the sensing stage again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from ros_pad.bags import BagReader
from ros_pad.bags.topics import CONTACT_VELOCITY
from ros_pad.bags.topics import FOOT_WRENCH
from ros_pad.bags.topics import IMU
from ros_pad.bags.topics import JOINT_STATES
from ros_pad.bags.topics import ODOM
from ros_pad.bags.topics import STAMP
from ros_pad.errors import BagError
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.errors import PadError
from ros_pad.errors import reason
from ros_pad.robots import Robot
from ros_pad.sensing import BodyEstimate
from ros_pad.sensing import SensingStage
from ros_pad.sensing.stage import SETTINGS
from ros_pad.sensing.stage import JointOrder
from ros_pad.sensing.stage import estimator_of
from ros_pad.sensing.stage import foot_readings
from ros_pad.trials.comparison import Comparison
from ros_pad.trials.comparison import Track
from ros_pad.trials.comparison import compare
from ros_pad.trials.label import PARAMETERS
from ros_pad.trials.recorded import OF_ROBOT

_NAMES = {each.name for each in SETTINGS}


def compare_body(
    bag: BagReader, wanted: Mapping[str, tuple[int, str]]
) -> tuple[list[Comparison], str]:
    """Replay the body estimator with its recorded parameters, and compare what it published.

    Parameters
    ----------
    bag : BagReader
        What was recorded.
    wanted : mapping
        Leg and kind of each topic, as :func:`ros_pad.trials.recorded.wanted_topics` returns them.

    Returns
    -------
    comparisons : list of Comparison
        Those of ``odom`` and of the velocity of each contact. Empty unless the bag has the
        parameters of one body estimator and all of its inputs. Without ``/clock`` the order in
        which its inputs arrived is not in the bag, so that differences are excused.
    note : str
        Why the body estimator cannot be replayed although the bag has all of this: the file of
        the robot is not in the bag, and may be gone or changed. Else empty.

    Raises
    ------
    BagError
        When the recorded parameters are not valid.
    """
    nodes = json.loads(bag.custom_data.get(PARAMETERS, '{}')).values()
    found = [each for each in nodes if each.keys() >= _NAMES]
    feet = {leg: topic for topic, (leg, kind) in wanted.items() if kind == CONTACT_VELOCITY.kind}
    if len(found) != 1 or not feet:
        return [], ''
    (values,) = found
    legs = values['legs']
    if set(legs) != set(feet):
        return [], ''
    prefix = feet[legs[0]].removesuffix(CONTACT_VELOCITY.name(legs[0]))
    try:
        player = _Player(bag, prefix, values)
        if not player.complete:
            return [], ''
        player.play()
    except (ConfigError, InvalidInput) as error:
        return [], f'the body estimator is not replayed: {error}'
    period_ns = round(1e9 / values['rate'])
    gap_ns = None if bag.counts.get('/clock') else -1
    comparisons = [
        compare(topic, leg, kind, player.recorded[topic], player.replayed[topic], bag.start,
                period_ns, gap_ns)
        for topic, leg, kind in player.outputs
    ]  # fmt: skip
    return comparisons, ''


class _Player:
    """Pass the recorded inputs of a body estimator to a sensing stage."""

    def __init__(self, bag: BagReader, prefix: str, values: Mapping[str, Any]) -> None:
        self._bag, legs = bag, values['legs']
        self._imu, self._joints = prefix + IMU.name(), prefix + JOINT_STATES.name()
        self._forces = {prefix + FOOT_WRENCH.name(leg): i for i, leg in enumerate(legs)}
        self._odom = prefix + ODOM.name()
        self._velocities = [prefix + CONTACT_VELOCITY.name(leg) for leg in legs]
        self.outputs = [(self._odom, OF_ROBOT, ODOM.kind)]
        self.outputs += [
            (topic, leg, CONTACT_VELOCITY.kind)
            for topic, leg in zip(self._velocities, legs, strict=True)
        ]
        topics = (self._imu, self._joints, *self._forces, self._odom)
        self.complete = all(bag.counts.get(topic) for topic in topics)
        self.recorded = {topic: Track(self._width(kind)) for topic, _, kind in self.outputs}
        self.replayed = {topic: Track(self._width(kind)) for topic, _, kind in self.outputs}
        self._log_ns = 0
        try:
            robot = Robot.load(
                values['robot'],
                [each.strip() for each in values['feet'].split(',') if each.strip()],
                values['imu_link'],
                values['foot_radius'] if values['foot_radius'] >= 0.0 else None,
            )
        except KeyError as error:
            raise self._not_valid(error) from error
        try:
            estimator = estimator_of(robot, values)
        except (KeyError, PadError) as error:
            raise self._not_valid(error) from error
        self._order, self._wrong = JointOrder(robot), InvalidInput('no reading can be used')
        self._stage = SensingStage(
            robot, estimator, self._take, lambda _: None, _ignore, values['forces']
        )

    def _not_valid(self, error: Exception) -> BagError:
        return BagError(
            f'{self._bag.path}: in the custom data {PARAMETERS!r} a parameter of the body'
            f' estimator is missing or not valid: {reason(error)}'
        )

    @staticmethod
    def _width(kind: str) -> int:
        return len(ODOM.values) if kind == ODOM.kind else len(CONTACT_VELOCITY.values)

    def _paths(self) -> dict[str, tuple[str, ...]]:
        """Return the fields to read of each topic."""
        return {
            self._imu: (*STAMP, *IMU.values),
            self._joints: (*STAMP, 'name', 'position', 'velocity', 'effort'),
            self._odom: (*STAMP, *ODOM.values),
            **dict.fromkeys(self._forces, (*STAMP, *FOOT_WRENCH.values)),
            **dict.fromkeys(self._velocities, (*STAMP, *CONTACT_VELOCITY.values)),
        }

    def play(self) -> None:
        """Play the bag once."""
        for topic, (seconds, fraction, *numbers), log_ns in self._bag.values(self._paths()):
            self._log_ns = log_ns
            stamp_ns = seconds * 1_000_000_000 + fraction
            if topic in self._forces:
                self._stage.force(self._forces[topic], stamp_ns, numbers)
            elif topic == self._imu:
                self._stage.imu(stamp_ns, numbers[:3], numbers[3:])
            elif topic == self._joints:
                self._take_joints(stamp_ns, *numbers)
            else:
                self.recorded[topic].add(log_ns, tuple(numbers), stamp_ns)
        if not self._stage.samples:
            raise self._wrong

    def _take_joints(self, stamp_ns: int, *values: Any) -> None:
        try:
            ordered = self._order(*values)
        except InvalidInput as error:
            self._wrong = error
            self._stage.reject(error)
            return
        self._stage.joints(stamp_ns, *ordered)

    def _take(self, stamp_ns: int, estimate: BodyEstimate) -> None:
        pose = (*estimate.position.tolist(), *estimate.orientation.tolist())
        self.replayed[self._odom].add(self._log_ns, pose, stamp_ns)
        for topic, foot in zip(self._velocities, foot_readings(estimate), strict=True):
            values = (*foot.velocity, foot.variance, foot.variance)
            self.replayed[topic].add(self._log_ns, values, stamp_ns)


def _ignore(error: InvalidInput) -> None:
    """Ignore a rejected reading, as the node did."""


__all__ = ['compare_body']
