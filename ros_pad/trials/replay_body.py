# SPDX-License-Identifier: Apache-2.0
"""Replay the body estimator of a bag: IMU, joints and forces through the sensing stage again."""

from __future__ import annotations

import json
import math
import operator
from collections.abc import Iterator, Mapping
from itertools import repeat
from typing import Any

import numpy as np

from ros_pad.bags import BagReader
from ros_pad.bags.topics import FORCE, IMU, JOINT_STATES, ODOM, SAMPLE, STAMP
from ros_pad.errors import ConfigError, InvalidInput, reason
from ros_pad.records import SAMPLE as SAMPLES
from ros_pad.records import Block, Field, Kind
from ros_pad.sensing import BodyEstimate, SensingStage
from ros_pad.sensing import Mapping as Meaning
from ros_pad.sensing.settings import SETTINGS
from ros_pad.sensing.stage import estimator_of, robot_of, sample_of
from ros_pad.trials.bag_notes import PARAMETERS
from ros_pad.trials.comparison import Comparison, Stream, compare
from ros_pad.trials.recorded import Recording, stamped, stamps_of

OF_BODY = -1
"""In place of the number of a leg, for the pose of the body."""

_POSE = Kind(
    'odom',
    'Estimated pose of the body.',
    (Field('position', 'm', 'in odom', 'xyz'), Field('orientation', '', 'quaternion', 'xyzw')),
)


def compare_body(bag: BagReader, recording: Recording) -> tuple[list[Comparison], str]:
    """Replay the body estimator with its recorded parameters, and compare what it published.

    Parameters
    ----------
    bag : BagReader
        What was recorded.
    recording : Recording
        What it has of the robot.

    Returns
    -------
    comparisons : list of Comparison
        Those of ``odom`` and of the samples of the feet. Empty unless the bag has the parameters
        of one body estimator and all of its inputs. Without ``/clock`` the order in which its
        inputs arrived is not in the bag, so that differences are excused.
    note : str
        Why the body estimator cannot be replayed although the bag has all of this: the file of
        the robot is not in the bag, and may be gone or changed. Else empty.
    """
    names, nodes = {each.name for each in SETTINGS}, bag.custom_data.get(PARAMETERS, '{}')
    found = [each for each in json.loads(nodes).values() if each.keys() >= names]
    sample = recording.topics.get(SAMPLES.name, '')
    prefix = sample.removesuffix(SAMPLE.name())
    inputs = [prefix + each.name() for each in (FORCE, IMU, JOINT_STATES)]
    complete = sample and ODOM in recording.poses and all(map(bag.counts.get, inputs))
    if len(found) != 1 or not complete:
        return [], ''
    try:
        made_poses, made_feet = _play(bag, found[0], *inputs)
    except (ConfigError, InvalidInput, KeyError) as error:
        return [], f'the body estimator is not replayed: {reason(error)}'
    gap_ns = math.inf if bag.counts.get('/clock') else -math.inf
    feet = recording.streams[SAMPLES.name]
    # At moments without an estimate, the node sends records without values.
    feet = feet.where(np.isfinite(feet.block.rows['force']).any(axis=(1, 2)))
    stamps, times, values = stamped(*recording.poses[ODOM])
    poses = Stream(_POSE, (OF_BODY,), times, Block(stamps, values.copy().view(_POSE.dtype)))
    return [
        *compare(prefix + ODOM.name(), poses, made_poses, bag.start, gap_ns),
        *compare(sample, feet, made_feet, bag.start, gap_ns),
    ], ''


def _play(
    bag: BagReader, values: Mapping[str, Any], force: str, imu: str, joints: str
) -> tuple[Stream, Stream]:
    """Pass what is on these topics to a sensing stage; return its poses and samples."""
    robot = robot_of(values)
    standard, wrong = Meaning.load('default', robot), InvalidInput('no reading can be used')
    poses: list[tuple[int, Block]] = []
    feet: list[tuple[int, Block]] = []

    def take(stamp_ns: int, estimate: BodyEstimate) -> None:
        pose = _POSE.rows(1)
        pose['position'], pose['orientation'] = estimate.position, estimate.orientation
        poses.append((stamp_ns, Block.of(stamp_ns, pose)))
        feet.append((stamp_ns, Block.of(stamp_ns, sample_of(estimate))))

    stage = SensingStage(
        robot, estimator_of(robot, values), take, lambda doubt: None, lambda error: None,
        values['forces'],
    )  # fmt: skip
    for topic, stamp_ns, content in _messages(bag, force, imu, joints):
        if topic == joints:
            try:
                standard.read('joint_states', content, 0).pass_to(stage)
            except InvalidInput as error:
                wrong = error
        elif topic == force:
            for index, each in enumerate(content):
                if math.isfinite(each.sum()):
                    stage.force(index, stamp_ns, each)
        elif math.isfinite(sum(content)):
            stage.imu(stamp_ns, content[:3], content[3:])
    if not stage.samples:
        raise wrong
    legs = tuple(values['legs'])
    return Stream.of(_POSE, (OF_BODY,), poses), Stream.of(SAMPLES, legs, feet)


def _messages(bag: BagReader, force: str, imu: str, joints: str) -> Iterator[tuple[str, int, Any]]:
    """Yield topic, stamp, ns, and forces, numbers or message, in the order of recording."""
    records, tables = bag.read({force: SAMPLES}, {imu: (*STAMP, *IMU.values)})
    _, times, block = records[force]
    imu_times, table = tables[imu]
    found: list[tuple[int, int, str, Any]] = [
        *zip(times, block.stamps, repeat(force), block.rows['force'], strict=False),
        *zip(imu_times, stamps_of(table), repeat(imu), table[:, 2:].tolist(), strict=False),
    ]
    for _, message, log_ns in bag.messages({joints}):
        stamp = message.header.stamp
        found.append((log_ns, stamp.sec * 10**9 + stamp.nanosec, joints, message))
    # Forces come first: readings of the joints wait for those of the same moment.
    for _, stamp_ns, topic, content in sorted(found, key=operator.itemgetter(0)):
        yield topic, int(stamp_ns), content


__all__ = ['compare_body']
