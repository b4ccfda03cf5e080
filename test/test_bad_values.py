# SPDX-License-Identifier: Apache-2.0
"""Public functions refuse bad arguments with an error that names the argument and its value."""

import numpy as np
import pytest

from ros_pad import capillary, contact, control, estimation, robots, sensing, simulation, trials
from ros_pad.bags import BagWriter
from ros_pad.errors import InvalidInput
from ros_pad.simulation import Hose, RegulatorModel
from ros_pad.trials.sweep import Sweep

FOOT = contact.Foot.load('large19')
ROBOT = robots.Robot.load('go2')
FLOOR = simulation.Floor.uniform(True, 1e-4)
HEXAPOD = simulation.Scene.load('hexapod_patches')
RAIL_LEG = simulation.Scene.load('leg_wet_flat')
CONTROLLER = control.MorphologyController(FOOT, [1], control.flat, 5.0)


def sample(**bad):
    """Give an estimator one sample."""
    joints = ROBOT.home.ravel()
    good = {
        'gyro': np.zeros(3),
        'accelerometer': np.array([0.0, 0.0, 9.81]),
        'joint_positions': joints,
        'joint_velocities': 0.0 * joints,
    }
    return sensing.BodyEstimator(ROBOT).update(0.0, **(good | bad))


CASES = (
    (capillary.Wall.through, ([1e-3, 2e-3], [0.0, 'top']), 'heights'),
    (robots.Gait.named, ('tripod', [0.1, 0.2], 1.0, 0.6, 0.03), 'hips'),
    (ROBOT.joint_positions, ([0.1, 0.0, -0.3],), 'feet'),
    (sensing.BodyEstimator, ('go2',), 'robot'),
    (sensing.BodyEstimator, (ROBOT,), {'gyro_noise': 0.0}),
    (sensing.BodyEstimator, (ROBOT,), {'encoder_noise': np.nan}),
    (sensing.BodyEstimator, (ROBOT,), {'force_axes': 'world'}),
    (sensing.Mapping.load, ('go2', 'go2'), 'robot'),
    (sample, (), {'gyro': None}),
    (sample, (), {'joint_velocities': None}),
    (estimation.FootEstimator, ('large19', 5.0), 'foot'),
    (estimation.FootEstimator, (FOOT, np.nan), 'expected_load'),
    (estimation.FootEstimator, (FOOT, 5.0, {'wet_prior': 0.2}), 'tuning'),
    (control.first_morphologies, ('adaptiv', [1, 2]), 'policy'),
    (control.dome_pressure, ('large19', 5.0, 1.2), 'foot'),
    (control.dome_pressure, (FOOT, -5.0, 1.2), 'load'),
    (control.MorphologyController, ('large19', [1], control.flat, 5.0), 'foot'),
    (CONTROLLER.morphology, (7,), 'leg'),
    (CONTROLLER.setpoint, (7,), 'leg'),
    (RegulatorModel, (), {'natural_frequency': 0.0}),
    (Hose, (4.0, 1.0), 'hose_diameter'),
    (Hose, (4e-3, np.nan), 'hose_length'),
    (simulation.PneumaticChannel, ('alicat', Hose(4e-3, 1.0), 5e-6), 'regulator'),
    (simulation.PneumaticChannel, (RegulatorModel(), 4e-3, 5e-6), 'hose'),
    (simulation.Floor.patches, (1.0, 0.5, 1e-4, 0), 'wet_fraction'),
    (simulation.Floor.drawn, (['#.'], '0.1', 1e-4), 'cell'),
    (trials.run, ('leg_wet_flat',), {'tuning': {'wet_prior': 0.2}}),
    (Sweep, ('leg_wet_flat',), 'scene'),
    (Sweep, (['leg_wet_flat'], (), [0], [('wet_prior', [0.2])]), 'parameters'),
)
"""Function, its arguments, and the name of the bad one, or bad arguments by name."""


@pytest.mark.parametrize(('function', 'arguments', 'bad'), CASES)
def test_the_error_names_the_argument(function, arguments, bad):
    named = bad if isinstance(bad, dict) else {}
    name = list(named)[-1] if named else bad
    with pytest.raises(InvalidInput, match=rf'^{name}\b.* needed'):
        function(*arguments, **named)


def test_custom_data_must_be_a_mapping(tmp_path):
    with pytest.raises(InvalidInput, match=r"^custom_data = 'ch3r' .* needed"):
        BagWriter(tmp_path / 'bag', 'ch3r')
