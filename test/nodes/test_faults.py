# SPDX-License-Identifier: Apache-2.0
"""Faults of regulators on real nodes: reports of the controller and their delay."""

import dataclasses

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticStatus

from ros_pad import configuration
from ros_pad.bags import BagReader
from ros_pad.nodes import composed
from ros_pad.simulation.faults import Fault
from ros_pad.simulation.scene import Scene
from ros_pad.trials import run
from ros_pad.trials.trial import fault_lines

# A byte is a bytes object in rclpy and a number in a bag.
OK, ERROR = DiagnosticStatus.OK[0], DiagnosticStatus.ERROR[0]


def scene_with(tmp_path, cycles, faults=()):
    """Return hexapod_patches on ground that is wet for 0.5 m, then dry for 0.5 m, and so on."""
    table = yaml.safe_load(configuration.locate('scenes', 'hexapod_patches').read_text())
    table['cycles'] = cycles
    table['floor'] = {'kind': 'drawn', 'drawing': '##########..........', 'cell': 0.05}
    table['tow']['weight'] = 3.0  # so light that no foot slips much
    path = tmp_path / 'stripes.yaml'
    path.write_text(yaml.safe_dump(table))
    return dataclasses.replace(Scene.load(path), faults=tuple(map(Fault.parse, faults)))


def health(bag):
    """Return the controller's reports for each leg: rows of (time, s, status)."""
    found = {}
    for topic, message, _ in BagReader(bag).messages():
        if topic != '/diagnostics':
            continue
        at = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        for status in message.status:
            if status.name.startswith('controller: leg'):
                found.setdefault(int(status.name.split()[2]), []).append((at, status))
    return found


def first_error(rows):
    """Return time, s, and message of the first error; None if there is none."""
    for at, status in rows:
        if status.level == ERROR:
            return at, status.message
    return None


@pytest.mark.slow
def test_each_fault_is_reported_within_a_second_and_the_others_go_on(tmp_path):
    faults = (
        '{kind: stuck_valve, legs: [1]}',
        '{kind: leak, legs: [2], start: 2.0, conductance: 1.0e-8}',
        '{kind: silence, legs: [3], start: 2.0}',
        '{kind: stuck_valve, legs: [4], start: 3.5}',
        '{kind: sensor_drift, legs: [6], start: 2.0, offset: 8.0e3}',
    )
    scene = scene_with(tmp_path, 8, faults)
    trial = composed.run(scene, 'oracle', bag=tmp_path / 'bag')
    rows = health(tmp_path / 'bag')
    time, commanded = trial.slow_time, trial.slow['setpoint'] > 0.0

    def turned(column, to, start=0.0):
        """Return the first time, s, after ``start`` at which a leg is commanded to switch."""
        turns = (commanded[1:, column] == to) & (commanded[:-1, column] != to) & (time[1:] > start)
        return time[np.flatnonzero(turns)[0] + 1]

    visible = {
        1: turned(0, True),
        2: turned(1, True),
        3: 2.0,
        4: turned(3, False, 3.5),
        6: turned(5, False, 2.0),
    }
    words = {
        1: 'does not fill: 0.0 kPa', 2: 'leaks or lacks air: 4', 3: 'no reading for 0.5 s',
        4: 'does not vent: 7', 6: 'does not vent: 8.0 kPa',
    }  # fmt: skip
    for leg, since in visible.items():
        at, message = first_error(rows[leg])
        assert since < at < since + 1.0, f'leg {leg}'
        assert message.startswith(words[leg])
    # After the walk, while pads are vented, missing samples are errors too.
    assert first_error([row for row in rows[5] if row[0] <= scene.duration]) is None
    # The trial lists the reported faults.
    assert [fault['leg'] for fault in trial.metrics.faults] == sorted(
        visible, key=lambda leg: (first_error(rows[leg])[0], leg)
    )
    assert fault_lines(trial.metrics.faults)[0].startswith('Leg 1, from ')
    # A foot with a fault goes flat, or keeps the pressure that the pad has.
    known = {leg: first_error(rows[leg])[0] for leg in visible}
    assert not trial.slow['dome'][time > known[1], 0].any()
    assert not trial.slow['dome'][time > known[2] + 1.5, 1].any()
    assert trial.slow['dome'][time > known[4], 3].all()
    assert not trial.slow['setpoint'][(time > known[1] + 1.0) & (time < known[1] + 4.0), 0].any()
    # The foot without a fault switches as in a trial without faults.
    sound = run(dataclasses.replace(scene, faults=()), 'oracle')
    assert np.argwhere(np.diff(trial.slow['dome'][:, 4])).size > 1
    switches = [time[np.flatnonzero(np.diff(each.dome[:, 4]))] for each in (trial, sound)]
    assert switches[0] == pytest.approx(switches[1], abs=0.1)
    assert sound.metrics.faults == []
