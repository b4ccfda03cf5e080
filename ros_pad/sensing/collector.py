# SPDX-License-Identifier: Apache-2.0
"""From messages of a robot to a recording for the checks."""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import Any

import numpy as np

from ros_pad.errors import InvalidInput
from ros_pad.robots import Robot
from ros_pad.robots.rotation import Array
from ros_pad.sensing.checks import Finding, Progress, Recording
from ros_pad.sensing.examine import examine, unjudged
from ros_pad.sensing.mapping import Mapping, Readings

SHORTEST = 1.0
"""Shortest time of readings that are checked, s."""

FEWEST = 10
"""Fewest readings that are checked."""

_ADVICE = 'docs/mappings.md explains what a mapping can change'


class Collector:
    """Collect the messages of a robot, and check them.

    Parameters
    ----------
    mapping : Mapping
    robot : Robot

    Attributes
    ----------
    counts : Counter of str
        Messages that were read, by topic.
    refused : dict of str to str
        Why the first message of a topic that could not be read was refused.
    """

    def __init__(self, mapping: Mapping, robot: Robot) -> None:
        self.counts: Counter[str] = Counter()
        self.refused: dict[str, str] = {}
        self._mapping, self._robot = mapping, robot
        self._imu: list[tuple[Readings, int]] = []
        self._joints: list[tuple[Readings, int]] = []
        self._forces: dict[int, list[tuple[int, Array]]] = defaultdict(list)

    def add(self, topic: str, message: Any, arrival: int) -> None:
        """Add a message: topic, message, and time of arrival, ns."""
        try:
            found = self._mapping.read(topic, message, arrival)
        except InvalidInput as error:
            self.refused.setdefault(topic, str(error))
            return
        self.counts[topic] += 1
        if found.gyro is not None and found.accelerometer is not None:
            self._imu.append((found, arrival))
        if found.positions is not None:
            self._joints.append((found, arrival))
        for leg, force in found.forces.items():
            self._forces[leg].append((found.stamp, force))

    def findings(self, topics: dict[str, str], progress: Progress) -> list[Finding]:
        """Check everything.

        Parameters
        ----------
        topics : dict of str to str
            Type of each topic that there is, for advice.
        progress : callable
            Called now and then with the share that is done, 0 to 1.
        """
        found = [self._refusal(topic, text) for topic, text in self.refused.items()]
        found += self._silent(topics)
        if not self._forces and any(each.efforts is not None for each, _ in self._joints):
            text = 'no foot force arrives: they are taken from the efforts of the joints'
            found.append(Finding('forces', 'ok', text, ''))
        for each in self._mapping.missing:
            what, _, text = each.partition(': ')
            found.append(Finding(what, 'warning', text, ''))
        lengths = [
            (what, self._length(readings))
            for what, readings in (('imu', self._imu), ('joints', self._joints))
        ]
        if min(length for _, length in lengths) < SHORTEST:
            if self.counts and not self.refused:
                found += [
                    Finding(
                        what,
                        'problem',
                        f'readings of {length:.3g} s; at least {SHORTEST:g} s are needed',
                        'look for low rates, and for readings that the driver marks as absent',
                    )
                    for what, length in lengths
                    if length < SHORTEST
                ]
            return found
        recording = self.recording()
        faults = examine(recording, lambda share: progress(0.5 * share))
        if not faults:
            text = 'no fault in rates, stamps, units, axes and signs'
            faults = [Finding('sensors', 'ok', text, '')]
        found += faults
        if not any(each.status == 'problem' for each in found):
            left = unjudged(recording, lambda share: progress(0.5 + 0.5 * share))
            if left:
                advice = 'walk some steps, and rock the robot about all axes on standing feet'
                found.append(Finding('not judged', 'warning', ', '.join(left), advice))
        return found

    @staticmethod
    def _length(readings: list[tuple[Readings, int]]) -> float:
        """Return the time over which readings arrived, s; 0 for few."""
        return (readings[-1][1] - readings[0][1]) * 1e-9 if len(readings) > FEWEST else 0.0

    def _refusal(self, topic: str, text: str) -> Finding:
        return Finding(topic, 'problem', f'messages do not fit the mapping: {text}', _ADVICE)

    def _silent(self, topics: dict[str, str]) -> list[Finding]:
        """Return findings about topics without messages."""
        silent = [
            source
            for source in self._mapping.sources
            if not self.counts[source.topic] and source.topic not in self.refused
        ]
        forces = [each for each in silent if not (each.gyro or each.accelerometer or each.joints)]
        groups = [[each] for each in silent if each not in forces]
        # Efforts give the forces where no foot has a sensor.
        if forces and not any(each.efforts is not None for each, _ in self._joints):
            groups.append(forces)
        found = []
        for group in groups:
            type_name = group[0].type_name
            same = [name for name, each in topics.items() if each == type_name]
            own = {'/' + each.topic.lstrip('/') for each in group}
            if own & set(same):
                advice = 'it has a publisher, from which nothing was received: look at the driver'
            elif same:
                advice = (
                    f'{type_name} is on {", ".join(same)}: write that into a mapping, or give the'
                    ' namespace'
                )
            else:
                advice = f'no topic has {type_name}: does the driver run, in this namespace?'
            names = ', '.join(source.topic for source in group)
            text = 'no message'
            if group is forces:
                text += ', and no efforts'
            found.append(Finding(names, 'problem', text, advice))
        return found

    def recording(self) -> Recording:
        """Return the readings as arrays; the first stamp of the joints is time 0."""
        start = self._joints[0][0].stamp
        times = _seconds([each.stamp for each, _ in self._joints], start)
        return Recording(
            self._robot,
            _seconds([each.stamp for each, _ in self._imu], start),
            np.array([each.gyro for each, _ in self._imu]),
            np.array([each.accelerometer for each, _ in self._imu]),
            times,
            np.array([each.positions for each, _ in self._joints]),
            self._column('velocities'),
            self._column('efforts'),
            self._force_table(times, start),
            self._mapping.force_axes,
            self._mapping.force_kind or 'vector',
            _seconds([at for _, at in self._imu], start),
            _seconds([at for _, at in self._joints], start),
        )

    def _column(self, name: str) -> Array | None:
        values = [getattr(each, name) for each, _ in self._joints]
        return None if any(each is None for each in values) else np.array(values)

    def _force_table(self, times: Array, start: int) -> Array | None:
        """Return the forces at the times of the joints; a foot without readings has none."""
        if not self._forces:
            return None
        table = np.zeros((len(times), len(self._robot.legs), 3))
        for leg, samples in self._forces.items():
            own = _seconds([stamp for stamp, _ in samples], start)
            values = np.array([force for _, force in samples])
            order = np.argsort(own, kind='stable')
            for axis in range(3):
                table[:, leg, axis] = np.interp(times, own[order], values[order, axis])
        return table


def _seconds(stamps: list[int], start: int) -> Array:
    return np.array([stamp - start for stamp in stamps]) * 1e-9
