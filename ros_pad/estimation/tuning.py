# SPDX-License-Identifier: Apache-2.0
"""Settings of an estimator: one table for Python, ROS parameters, sweeps and replays."""

from __future__ import annotations

import inspect
from dataclasses import dataclass

from ros_pad.configuration import Setting
from ros_pad.contact.resistance import Foot
from ros_pad.estimation.alarm import THRESHOLD
from ros_pad.estimation.load_gate import CONTACT_SHARE
from ros_pad.estimation.scales import CLASSES
from ros_pad.estimation.scales import SCALE_RANGE
from ros_pad.estimation.scales import SCALE_SD
from ros_pad.estimation.scales import SCALE_SD_RANGE
from ros_pad.estimation.scales import Scale

EXPECTED_LOAD = Setting(
    'expected_load', 6.83, 'Normal force on a foot in stance: a third of the weight in a tripod.',
    'N', 0.01, 1000.0,
)  # fmt: skip

SOURCES = ('markers', 'joints')
"""Where slip comes from."""

SETTINGS = (
    Setting(
        'position_noise', 1.5e-4,
        'Standard deviation of a marker coordinate, until it is measured; 0: readings may repeat.',
        'm', 0.0, 0.1,
    ),
    Setting(
        'force_noise', 0.03,
        'Standard deviation of a force component, until it is measured; 0: readings may repeat.',
        'N', 0.0, 100.0,
    ),
    Setting(
        'moment_noise', 0.0,
        'Standard deviation of the torque z of a wrench; 0: the sensors do not measure it.',
        'N m', 0.0, 10.0,
    ),
    Setting(
        'force_range', 0.0,
        'Largest component of force that a sensor can show; 0: not known.', 'N', 0.0, 1e5,
    ),
    Setting(
        'load_gate', CONTACT_SHARE, 'Share of the expected load above which a foot stands.',
        '', 0.001, 1.0,
    ),
    Setting('smoothing', 0.02, 'Time constant of the slip speed.', 's', 0.001, 10.0),
    Setting(
        'filter_period', 0.04, 'Time between updates of the wetness and friction filter.',
        's', 0.001, 10.0,
    ),
    Setting(
        'patch_length', 1.5, 'Distance over which wet and dry ground change.', 'm', 0.01, 100.0,
    ),
    Setting(
        'wet_prior', 0.5, 'Prior probability of wet ground.', '', 0.01, 0.99,
    ),
    Setting(
        'ratio_noise', 0.03, 'Model error of T/N, added to that of the sensors.', '', 1e-4, 10.0,
    ),
    Setting(
        'speed_noise', 2e-3,
        'Model error of the slip speed, added to that of the sensors: feet also roll and bend.',
        'm/s', 1e-6, 1.0,
    ),
    Setting(
        'turning_rate', 4.0,
        'Root mean square of the rate at which a standing foot turns about the vertical; for legs'
        ' without an ankle, the speed of the body over the length of the leg.',
        'rad/s', 0.0, 100.0,
    ),
    Setting(
        'alarm.threshold', THRESHOLD,
        'Threshold of the slip alarm: on average at least exp(threshold) samples lie between false'
        ' alarms.',
        'nats', 0.1, 100.0,
    ),
    Setting(
        'source', 'markers',
        'Where slip comes from: positions of markers, or velocities of contact points with their'
        ' variances, which a body estimator has from joints and IMU.',
        choices=SOURCES,
    ),
    Setting(
        'pads_shear', True,
        'With source joints: whether pads that shear move the link above them, as on a robot; the'
        ' joints of simulated robots are those of rigid feet.',
    ),
    Setting(
        'learn_friction', True,
        'Whether the feet learn how much the friction of their floor differs from the contact'
        ' model.',
    ),
    *(
        Setting(
            f'scale.{name}', 1.0,
            f'Expected friction over that of the contact model, {name.replace("_", " and ")}.',
            '', *SCALE_RANGE,
        )
        for name in CLASSES
    ),
    *(
        Setting(
            f'scale_sd.{name}', SCALE_SD,
            f'Standard deviation of the logarithm of scale.{name}.', '', *SCALE_SD_RANGE,
        )
        for name in CLASSES
    ),
)  # fmt: skip
"""Settings of an estimator; an attribute of :class:`Tuning` has ``_`` in place of a dot."""

_DEFAULTS = {each.name: each.default for each in SETTINGS}


def attribute(setting: Setting) -> str:
    """Return the attribute of :class:`Tuning` that holds a setting."""
    return setting.name.replace('.', '_')


def _described(setting: Setting) -> str:
    kind = setting.value_type.__name__
    unit = ', no unit' if kind == 'float' and not setting.unit else ''
    values = f'Allowed: {setting.allowed}{unit}; default: {setting.default}.'
    return f'{attribute(setting)} : {kind}\n    {setting.description} {values}\n'


@dataclass(frozen=True)
class Tuning:
    """Settings of an estimator for robot, sensors and ground; :data:`SETTINGS` describes them.

    Raises
    ------
    InvalidInput
        When a value is outside its range; the message names it.

    Examples
    --------
    >>> from ros_pad.estimation import Tuning
    >>> Tuning(wet_prior=0.2).wet_prior
    0.2
    """

    position_noise: float = _DEFAULTS['position_noise']
    force_noise: float = _DEFAULTS['force_noise']
    moment_noise: float = _DEFAULTS['moment_noise']
    force_range: float = _DEFAULTS['force_range']
    load_gate: float = _DEFAULTS['load_gate']
    smoothing: float = _DEFAULTS['smoothing']
    filter_period: float = _DEFAULTS['filter_period']
    wet_prior: float = _DEFAULTS['wet_prior']
    patch_length: float = _DEFAULTS['patch_length']
    ratio_noise: float = _DEFAULTS['ratio_noise']
    speed_noise: float = _DEFAULTS['speed_noise']
    turning_rate: float = _DEFAULTS['turning_rate']
    alarm_threshold: float = _DEFAULTS['alarm.threshold']
    source: str = _DEFAULTS['source']
    pads_shear: bool = _DEFAULTS['pads_shear']
    learn_friction: bool = _DEFAULTS['learn_friction']
    scale_flat_dry: float = _DEFAULTS['scale.flat_dry']
    scale_flat_wet: float = _DEFAULTS['scale.flat_wet']
    scale_dome: float = _DEFAULTS['scale.dome']
    scale_sd_flat_dry: float = _DEFAULTS['scale_sd.flat_dry']
    scale_sd_flat_wet: float = _DEFAULTS['scale_sd.flat_wet']
    scale_sd_dome: float = _DEFAULTS['scale_sd.dome']

    def __post_init__(self) -> None:
        for setting in SETTINGS:
            setting.accept(getattr(self, attribute(setting)))

    @property
    def scales(self) -> dict[str, Scale]:
        """What is known of the scales of friction before a walk, by class."""
        return {
            name: Scale(getattr(self, f'scale_{name}'), getattr(self, f'scale_sd_{name}'))
            for name in CLASSES
        }

    def rim_speed(self, foot: Foot) -> float:
        """Return the scrubbing speed of a turning foot at 2/3 of the sole's radius.

        Parameters
        ----------
        foot : Foot
            The foot.

        Returns
        -------
        float
            Speed, m/s.
        """
        return foot.turning_radius * self.turning_rate


Tuning.__doc__ = f'{inspect.cleandoc(Tuning.__doc__ or "")}\n\nAttributes\n----------\n'
Tuning.__doc__ += ''.join(map(_described, SETTINGS))
