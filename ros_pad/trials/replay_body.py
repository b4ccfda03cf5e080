# SPDX-License-Identifier: Apache-2.0
"""Replay the body estimator of a bag: IMU, joints and forces through the sensing stage again."""

from __future__ import annotations

import heapq
import json
import math
from collections.abc import Iterator
from collections.abc import Mapping
from typing import Any

import numpy as np

from ros_pad.bags import BagReader
from ros_pad.bags.topics import FORCE
from ros_pad.bags.topics import IMU
from ros_pad.bags.topics import JOINT_STATES
from ros_pad.bags.topics import ODOM
from ros_pad.bags.topics import SAMPLE
from ros_pad.bags.topics import STAMP
from ros_pad.errors import BagError
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.errors import PadError
from ros_pad.errors import reason
from ros_pad.records import SAMPLE as SAMPLES
from ros_pad.records import Block
from ros_pad.records import Field
from ros_pad.robots import Robot
from ros_pad.sensing import BodyEstimate
from ros_pad.sensing import BodyEstimator
from ros_pad.sensing import SensingStage
from ros_pad.sensing.stage import SETTINGS
from ros_pad.sensing.stage import JointOrder
from ros_pad.sensing.stage import estimator_of
from ros_pad.sensing.stage import sample_of
from ros_pad.trials.comparison import Comparison
from ros_pad.trials.comparison import Stream
from ros_pad.trials.comparison import Track
from ros_pad.trials.comparison import compare
from ros_pad.trials.comparison import compare_streams
from ros_pad.trials.label import PARAMETERS
from ros_pad.trials.recorded import Wanted

OF_BODY = -1
"""In place of the number of a leg, for the pose of the body."""

_NAMES = {each.name for each in SETTINGS}
_POSE = Field('odom', '', 'position, m, and orientation of the body')


def compare_body(bag: BagReader, wanted: Mapping[str, Wanted]) -> tuple[list[Comparison], str]:
    """Replay the body estimator with its recorded parameters, and compare what it published.

    Parameters
    ----------
    bag : BagReader
        What was recorded.
    wanted : mapping
        What each topic is, as :func:`ros_pad.trials.recorded.wanted_topics` returns it.

    Returns
    -------
    comparisons : list of Comparison
        Those of ``odom`` and of the samples of the feet. Empty unless the bag has the parameters
        of one body estimator and all of its inputs. Without ``/clock`` the order in which its
        inputs arrived is not in the bag, so that differences are excused.
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
    sample = next((name for name, each in wanted.items() if each.topic is SAMPLE), '')
    prefix = sample.removesuffix(SAMPLE.name())
    needed = [prefix + each.name() for each in (FORCE, IMU, JOINT_STATES, ODOM)]
    if len(found) != 1 or not sample or not all(bag.counts.get(name) for name in needed):
        return [], ''
    try:
        player = _Player(bag, found[0])
        player.play(needed)
    except (ConfigError, InvalidInput) as error:
        return [], f'the body estimator is not replayed: {error}'
    gap_ns = math.inf if bag.counts.get('/clock') else -math.inf
    recorded = Stream(SAMPLES, *bag.records({sample: SAMPLES})[sample])
    # At moments without an estimate, the node sends records without values.
    felt = recorded.where(np.isfinite(recorded.block.rows['force']).any(axis=(1, 2)))
    feet = Stream.of(SAMPLES, tuple(found[0]['legs']), player.feet)
    poses = compare(
        needed[-1], OF_BODY, _POSE, _track(player.recorded), _track(player.poses), bag.start,
        gap_ns,
    )  # fmt: skip
    return [poses, *compare_streams(sample, felt, feet, bag.start, gap_ns)], ''


def _stage_of(bag: BagReader, values: Mapping[str, Any]) -> tuple[Robot, BodyEstimator]:
    """Return the robot and the estimator that recorded parameters describe."""
    try:
        robot = Robot.load(
            values['robot'],
            [each.strip() for each in values['feet'].split(',') if each.strip()],
            values['imu_link'],
            values['foot_radius'] if values['foot_radius'] >= 0.0 else None,
        )
    except KeyError as error:
        raise _not_valid(bag, error) from error
    try:
        return robot, estimator_of(robot, values)
    except (KeyError, PadError) as error:
        raise _not_valid(bag, error) from error


def _not_valid(bag: BagReader, error: Exception) -> BagError:
    return BagError(
        f'{bag.path}: in the custom data {PARAMETERS!r} a parameter of the body estimator is'
        f' missing or not valid: {reason(error)}'
    )


def _track(poses: list[tuple[int, int, list[float]]]) -> Track:
    times, stamps, values = zip(*poses, strict=True)
    return Track(np.array(times), np.array(stamps), np.array(values))


class _Player:
    """Pass the recorded inputs of a body estimator to a sensing stage."""

    def __init__(self, bag: BagReader, values: Mapping[str, Any]) -> None:
        self._bag = bag
        robot, estimator = _stage_of(bag, values)
        self._order, self._wrong = JointOrder(robot), InvalidInput('no reading can be used')
        self._stage = SensingStage(
            robot, estimator, self._take, lambda doubt: None, lambda error: None, values['forces']
        )
        self._log_ns = 0
        self.feet: list[tuple[int, Block]] = []
        self.poses: list[tuple[int, int, list[float]]] = []  # log time, stamp, values
        self.recorded: list[tuple[int, int, list[float]]] = []

    def play(self, topics: list[str]) -> None:
        """Play the bag once: topics of forces, IMU, joints and odom."""
        force, imu, joints, odom = topics
        paths = {
            imu: (*STAMP, *IMU.values),
            joints: (*STAMP, 'name', 'position', 'velocity', 'effort'),
            odom: (*STAMP, *ODOM.values),
        }
        messages = (
            (log_ns, topic, seconds * 1_000_000_000 + fraction, values)
            for topic, (seconds, fraction, *values), log_ns in self._bag.values(paths)
        )
        # Forces come first: readings of the joints wait for those of the same moment.
        both = heapq.merge(self._forces(force), messages, key=lambda each: each[0])
        for self._log_ns, topic, stamp_ns, values in both:
            if topic == force:
                for index, each in enumerate(values):
                    if math.isfinite(each.sum()):
                        self._stage.force(index, stamp_ns, each)
            elif topic == odom:
                self.recorded.append((self._log_ns, stamp_ns, values))
            elif topic == joints:
                self._take_joints(stamp_ns, *values)
            elif math.isfinite(sum(values)):
                self._stage.imu(stamp_ns, values[:3], values[3:])
        if not self._stage.samples:
            raise self._wrong

    def _forces(self, topic: str) -> Iterator[tuple[int, str, int, Any]]:
        _, times, block = self._bag.records({topic: SAMPLES})[topic]
        columns = times.tolist(), block.stamps.tolist(), block.rows['force']
        for time_ns, stamp_ns, forces in zip(*columns, strict=True):
            yield time_ns, topic, stamp_ns, forces

    def _take_joints(self, stamp_ns: int, *values: Any) -> None:
        try:
            ordered = self._order(*values)
        except InvalidInput as error:
            self._wrong = error
            self._stage.reject(error)
            return
        if math.isfinite(ordered[0].sum()):
            self._stage.joints(stamp_ns, *ordered)

    def _take(self, stamp_ns: int, estimate: BodyEstimate) -> None:
        pose = [*estimate.position.tolist(), *estimate.orientation.tolist()]
        self.poses.append((self._log_ns, stamp_ns, pose))
        self.feet.append((self._log_ns, Block.of(stamp_ns, sample_of(estimate))))


__all__ = ['compare_body']
