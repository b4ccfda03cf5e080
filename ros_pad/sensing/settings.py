# SPDX-License-Identifier: Apache-2.0
"""Settings of sensing: noise of the sensors, and how forces are used."""

from ros_pad.configuration import Setting

_VELOCITY = (
    'the velocity of a joint; where velocities are missing, 1.4 times the encoder noise over the'
    ' period'
)


def _noise(name: str, default: float, of: str, unit: str, low: float, high: float) -> Setting:
    return Setting(name, default, f'Standard deviation of {of}.', unit, low, high)


# Sources of the forces: sensors of the feet, efforts of the joints, or the first that comes.
FORCES = ('auto', 'feet', 'efforts')

# Of a body estimator and its stage, by the names of their arguments.
SETTINGS = (
    _noise('gyro_noise', 0.005, 'a sample of the gyro', 'rad/s', 1e-6, 1.0),
    _noise('accelerometer_noise', 0.05, 'a sample of the accelerometer', 'm/s2', 1e-6, 10.0),
    _noise('accelerometer_bias', 0.05, 'the bias of the accelerometer', 'm/s2', 0.0, 5.0),
    _noise('encoder_noise', 5e-4, 'the position of a joint', 'rad', 1e-6, 0.1),
    _noise('velocity_noise', 0.03, _VELOCITY, 'rad/s', 1e-6, 10.0),
    _noise('force_noise', 0.03, 'a component of the force on a foot', 'N', 0.0, 100.0),
    Setting(
        'forces', 'auto',
        'Source of the forces: sensors of the feet, efforts of the joints, or feet where their'
        ' forces come, else efforts.',
        choices=FORCES,
    ),
    Setting(
        'force_axes', 'foot',
        'Axes of the forces: of the link that carries the foot, or of the base.',
        choices=('foot', 'base'),
    ),
    Setting(
        'contact_share', 0.0,
        'Share of the expected load above which a foot stands; 0: 0.1, and 0.25 for efforts.',
        '', 0.0, 0.9,
    ),
)  # fmt: skip
