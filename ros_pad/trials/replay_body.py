# SPDX-License-Identifier: Apache-2.0
"""Replay the body estimator of a bag: IMU, joints and forces through the sensing stage again."""

from __future__ import annotations

import heapq
import json
import math
import operator
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from ros_pad.bags import BagReader
from ros_pad.bags.fields import field_of
from ros_pad.bags.topics import FORCE, IMU, JOINT_STATES, ODOM, SAMPLE, STAMP
from ros_pad.errors import BagError, ConfigError, InvalidInput, reason
from ros_pad.records import SAMPLE as SAMPLES
from ros_pad.records import Block, Field, Kind
from ros_pad.robots import Robot
from ros_pad.sensing import BodyEstimate, BodyEstimator, SensingStage
from ros_pad.sensing.stage import SETTINGS, JointOrder, estimator_of, robot_of, sample_of
from ros_pad.trials.comparison import Comparison, Stream, compare
from ros_pad.trials.label import PARAMETERS
from ros_pad.trials.recorded import Wanted

OF_BODY = -1
"""In place of the number of a leg, for the pose of the body."""

_NAMES = {each.name for each in SETTINGS}
_POSE = Kind(
    'odom',
    'Estimated pose of the body.',
    (Field('position', 'm', 'in odom', 'xyz'), Field('orientation', '', 'quaternion', 'xyzw')),
)


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
        made_poses, made_feet = _play(bag, found[0], *needed[:3])
    except (ConfigError, InvalidInput) as error:
        return [], f'the body estimator is not replayed: {error}'
    gap_ns = math.inf if bag.counts.get('/clock') else -math.inf
    feet = Stream(SAMPLES, *bag.records({sample: SAMPLES})[sample])
    # At moments without an estimate, the node sends records without values.
    feet = feet.where(np.isfinite(feet.block.rows['force']).any(axis=(1, 2)))
    times, table = bag.tables({needed[-1]: (*STAMP, *ODOM.values)})[needed[-1]]
    stamps = table[:, :2].astype(np.int64) @ np.array([1_000_000_000, 1])
    poses = made_poses._replace(
        times=times, block=Block(stamps, table[:, 2:].copy().view(_POSE.dtype))
    )
    return [
        *compare(needed[-1], poses, made_poses, bag.start, gap_ns),
        *compare(sample, feet, made_feet, bag.start, gap_ns),
    ], ''


def _parts(bag: BagReader, values: Mapping[str, Any]) -> tuple[Robot, BodyEstimator]:
    """Return the robot and the estimator that recorded parameters describe."""
    try:
        robot = robot_of(values)
        return robot, estimator_of(robot, values)
    except (KeyError, InvalidInput) as error:
        raise BagError(
            f'{bag.path}: in the custom data {PARAMETERS!r} a parameter of the body estimator is'
            f' missing or not valid: {reason(error)}'
        ) from error


def _play(
    bag: BagReader, values: Mapping[str, Any], force: str, imu: str, joints: str
) -> tuple[Stream, Stream]:
    """Pass what is on these topics to a sensing stage; return its poses and samples."""
    robot, estimator = _parts(bag, values)
    order, wrong = JointOrder(robot), InvalidInput('no reading can be used')
    poses: list[tuple[int, Block]] = []
    feet: list[tuple[int, Block]] = []

    def take(stamp_ns: int, estimate: BodyEstimate) -> None:
        pose = _POSE.rows(1)
        pose['position'], pose['orientation'] = estimate.position, estimate.orientation
        poses.append((stamp_ns, Block.of(stamp_ns, pose)))
        feet.append((stamp_ns, Block.of(stamp_ns, sample_of(estimate))))

    stage = SensingStage(
        robot, estimator, take, lambda doubt: None, lambda error: None, values['forces']
    )
    for _, topic, (seconds, fraction, *numbers) in _messages(bag, force, imu, joints):
        stamp_ns = seconds * 1_000_000_000 + fraction
        if topic == joints:
            try:
                ordered = order(*numbers)
            except InvalidInput as error:
                wrong = error
                continue
            if math.isfinite(ordered[0].sum()):
                stage.joints(stamp_ns, *ordered)
        elif topic == force:
            for index, each in enumerate(numbers):
                if math.isfinite(each.sum()):
                    stage.force(index, stamp_ns, each)
        elif math.isfinite(sum(numbers)):
            stage.imu(stamp_ns, numbers[:3], numbers[3:])
    if not stage.samples:
        raise wrong
    legs = tuple(values['legs'])
    return Stream.of(_POSE, (OF_BODY,), poses), Stream.of(SAMPLES, legs, feet)


def _messages(
    bag: BagReader, force: str, imu: str, joints: str
) -> Iterator[tuple[int, str, Iterable[Any]]]:
    """Yield log time, ns, topic and values of all messages, which begin with the stamp."""

    def values(topic: str, message: Any) -> Iterator[Any]:
        """Yield the values of a message, beginning with its stamp."""
        yield from (message.header.stamp.sec, message.header.stamp.nanosec)
        if topic == joints:
            yield from (message.name, message.position, message.velocity, message.effort)
        else:
            yield from (field_of(message, path) for path in IMU.values)

    messages = (
        (log_ns, topic, values(topic, message))
        for topic, message, log_ns in bag.messages({imu, joints})
    )
    _, times, (stamps, rows) = bag.records({force: SAMPLES})[force]
    forces = (
        (log_ns, force, (0, stamp_ns, *each))
        for log_ns, stamp_ns, each in zip(
            times.tolist(), stamps.tolist(), rows['force'], strict=True
        )
    )
    # Forces come first: readings of the joints wait for those of the same moment.
    return heapq.merge(forces, messages, key=operator.itemgetter(0))


__all__ = ['compare_body']
