# SPDX-License-Identifier: Apache-2.0
"""All checks of the readings of a robot, one after the other, and what they could not judge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ros_pad.robots.rotation import Array
from ros_pad.sensing import checks
from ros_pad.sensing.checks import Finding, Progress, Recording, problem
from ros_pad.sensing.estimator import WEIGHT, BodyEstimator

_ADVICE = {  # by kind of a doubt of the body estimator
    'imu': 'look for a driver or a bus that hangs',
    'joints': 'reversed, in degrees, of another joint, or a driver that hangs? Mend the driver, or'
    ' leave velocities out of the mapping: differences replace them',
    'force': 'set the zero of the sensor in the air',
    'kinematics': 'reversed in the mapping, or the axis or foot link in the robot file',
}
_FLIPS = [np.diag(1.0 - 2.0 * row) for row in np.eye(3)]


def contradictions(recording: Recording) -> list[Finding]:
    """Run the checks that the body estimator makes of its readings, by running it."""
    robot = recording.robot
    if not robot.mass > 0.0:
        return []
    estimator = BodyEstimator(robot, force_axes=recording.force_axes)
    gyro, pull = (values @ robot.imu[:3, :3] for values in (recording.rate, recording.pull))
    found = {}
    for row, time in enumerate(recording.joint_time.tolist()):
        doubt = estimator.update(
            time,
            *(gyro[row], pull[row], recording.positions[row], recording.speeds[row]),
            None if recording.forces is None else recording.forces[row],
            None if recording.efforts is None else recording.efforts[row],
        ).doubt
        kind, _, text = doubt.partition(': ')
        if kind in _ADVICE:
            found[kind] = text
    # The first kind: what it makes of readings may be the reason of the others.
    kinds = [kind for kind in _ADVICE if kind in found]
    return [problem(kind, found[kind], _ADVICE[kind]) for kind in kinds[:1]]


def forces(recording: Recording) -> list[Finding]:
    """Check sign, axis and unit of the forces on the feet at rest."""
    found = recording.ground_forces
    if found is None:
        advice = 'velocity, effort or foot forces: without one of the last two no foot stands'
        return [problem('force', 'neither foot forces nor efforts arrive', advice)]
    measured = recording.forces is not None
    what = 'foot forces' if measured else 'efforts'
    if not np.any(recording.forces if measured else recording.efforts):
        advice = 'does the driver measure them? Leave them out of the mapping if not'
        return [problem(what, 'are all zero', advice)]
    most = np.linalg.norm(found, axis=2).max(0)
    idle = [
        leg
        for leg, size in zip(recording.robot.legs, most, strict=True)
        if size < 0.02 * most.max()
    ]
    if idle:
        text = f'foot {", ".join(map(str, idle))} never carries load'
        return [problem(what, text, 'is its sensor connected, and the leg the right one?')]
    if recording.force_kind == 'contact':
        return []
    mean, up = recording.calm(found).mean(0), recording.up
    total = mean.sum(0)
    size = float(np.linalg.norm(total))
    if total @ up < -0.7 * size:
        text = 'are reversed: the robot would hang from its feet'
        advice = f'{"scale" if measured else "effort_scale"}: -1.0 in the mapping'
        return [problem(what, text, advice)]
    if total @ up < 0.7 * size:
        text = f'are along {checks.axis_of(total)} of the base at rest, and should be along z'
        return [problem(what, text, _axes_advice(recording))]
    weight = recording.robot.mass * WEIGHT
    lines = []
    for leg, force in zip(recording.robot.legs, mean, strict=True):
        if force @ up < -0.05 * size:
            lines.append((f'that of foot {leg} is reversed', 'scale: -1.0 for this foot'))
        elif np.linalg.norm(force) > 0.05 * size and force @ up < 0.5 * np.linalg.norm(force):
            text = f'that of foot {leg} is along {checks.axis_of(force)} of the base at rest'
            lines.append((text, 'its axes are turned: it should be along z'))
    if not lines and weight and not 0.75 < size / weight < 1.33:
        text = f'add up to {size:.3g} at rest, and the robot weighs {weight:.3g} N'
        whole = measured and np.array_equal(found, np.round(found))
        advice = (
            f'{"counts, not newtons: " if whole else ""}scale: {weight / size:.3g} in the mapping'
        )
        lines.append((text, advice if measured else advice.replace('scale', 'effort_scale')))
    return [problem(what, text, advice) for text, advice in lines]


def _axes_advice(recording: Recording) -> str:
    """Return how forces at rest that are not along z may come to be."""
    other = 'foot' if recording.force_axes == 'base' else 'base'
    found = replace(recording, force_axes=other).ground_forces
    if recording.forces is not None and found is not None:
        mean = recording.calm(found).mean(0).sum(0)
        if mean @ recording.up > 0.9 * np.linalg.norm(mean):
            return f'force_axes: {other} in the mapping'
    return 'axes, or force_axes (base or foot), in the mapping'


def swings(recording: Recording) -> list[Finding]:
    """Check that feet swing above the floor on which the others stand."""
    heights = recording.kinematics[0] @ recording.up
    stands = recording.stands
    some = stands.sum(1) >= 2
    if not some.any():
        return []
    floor = np.where(stands, heights, 0.0).sum(1) / np.maximum(stands.sum(1), 1)
    found = []
    for leg, name in enumerate(recording.robot.legs):
        below = (floor - heights[:, leg])[some & ~recording.rests]
        depth = float(np.quantile(below, 0.95)) if len(below) else 0.0
        if depth > checks.SUNK:
            advice = 'look for a reversed joint, a wrong zero, a wrong foot link or length'
            text = f'foot {name} goes {depth:.2g} m below the floor on which others stand'
            found.append(problem('feet', text, advice))
    return found


def unjudged(recording: Recording, progress: Progress = checks.unseen) -> list[str]:
    """Return what moved too little to be judged: axes of the gyro, joints, the delay."""
    if checks.ranges(recording):
        return ['all but the positions of joints']
    before = checks.rolling_errors(recording)
    if len(before) < checks.FEWEST:
        return ['gyro, joints and their delay: the robot did not move on its feet']

    def unclear(after: Array) -> bool:
        sure = checks.better(after, before)
        return sure < 0.5 * checks.SURE or (
            sure < checks.SURE and before.mean() > 0.7 * after.mean()
        )

    others = {
        f'gyro about {axis}': checks.rolling_errors(recording, flip)
        for axis, flip in zip('xyz', _FLIPS, strict=True)
    }
    names = recording.robot.joint_names
    for joint, name in enumerate(names):
        others[f'joint {name}'] = checks.rolling_errors(recording.reversed(joint))
        progress((joint + 1) / len(names))
    others['delay between IMU and joints'] = checks.rolling_errors(recording, late=0.01)
    found = [name for name, after in others.items() if unclear(after)]
    push = recording.ground_forces
    if push is not None and recording.force_kind == 'vector':
        total, wanted = checks.pushes(recording, push)
        before = checks.sizes(total - wanted)
        if unclear(checks.sizes(total + wanted)):
            found.append('horizontal axes of accelerometer and forces')
    return found


def examine(recording: Recording, progress: Progress = checks.unseen) -> list[Finding]:
    """Run all checks, those of the forces with the joints as they should be.

    Parameters
    ----------
    recording : Recording
        Some seconds; better with the robot at rest first, and then walking.
    progress : callable
        Called now and then with the share that is done, 0 to 1.

    Returns
    -------
    list of Finding
        Empty if nothing is wrong.
    """
    found = [*checks.stamps(recording), *checks.ranges(recording)]
    if any(each.status == 'problem' for each in found):
        return found  # without times and angles, nothing else can be judged
    found += [*checks.rates(recording), *checks.gravity(recording)]
    found += checks.velocities(recording)
    moved, fine = checks.turned(recording, progress)
    uneven = checks.levels(fine)
    found += [*moved, *uneven]
    if not (uneven or moved):
        found += [*swings(fine), *checks.delay(fine)]
    loads = forces(fine)
    found += [*loads, *([] if loads or checks.gravity(recording) else checks.horizontal(fine))]
    if any(each.status == 'problem' for each in found):
        return found
    return [*found, *contradictions(recording)]
