# SPDX-License-Identifier: Apache-2.0
"""Settings of an estimator: one table for Python, ROS parameters, sweeps and replays."""

from __future__ import annotations

import inspect
from dataclasses import dataclass, field, fields
from typing import Any

from ros_pad.configuration import Setting
from ros_pad.contact.resistance import Foot
from ros_pad.estimation.alarm import THRESHOLD
from ros_pad.estimation.scales import CLASSES, SCALE_RANGE, SCALE_SD, SCALE_SD_RANGE, Scale

EXPECTED_LOAD = Setting(
    'expected_load', 6.83, 'Normal force on a foot in stance: a third of the weight in a tripod.',
    'N', 0.01, 1000.0,
)  # fmt: skip

SOURCES = ('markers', 'joints')
"""Where slip comes from."""


def attribute(setting: Setting) -> str:
    """Return the attribute of :class:`Tuning` that holds a setting."""
    return setting.name.replace('.', '_')


def _field(*given: Any, **more: Any) -> Any:
    """Return a field of a dataclass with a setting."""
    setting = Setting(*given, **more)
    return field(default=setting.default, metadata={'setting': setting})


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

    # fmt: off
    position_noise: float = _field(
        'position_noise', 1.5e-4,
        'Standard deviation of a marker coordinate, until it is measured; 0: readings may repeat.',
        'm', 0.0, 0.1,
    )
    force_noise: float = _field(
        'force_noise', 0.03,
        'Standard deviation of a force component, until it is measured; 0: readings may repeat.',
        'N', 0.0, 100.0,
    )
    moment_noise: float = _field(
        'moment_noise', 0.0,
        'Standard deviation of the torque z of a wrench; 0: the sensors do not measure it.',
        'N m', 0.0, 10.0,
    )
    force_range: float = _field(
        'force_range', 0.0,
        'Largest component of force that a sensor can show; 0: not known.', 'N', 0.0, 1e5,
    )
    load_gate: float = _field(
        'load_gate', 0.1, 'Share of the expected load above which a foot stands.',
        '', 0.001, 1.0,
    )
    smoothing: float = _field(
        'smoothing', 0.02, 'Time constant of the slip speed.', 's', 0.001, 10.0
    )
    filter_period: float = _field(
        'filter_period', 0.04, 'Time between updates of the wetness and friction filter.',
        's', 0.001, 10.0,
    )
    patch_length: float = _field(
        'patch_length', 1.5, 'Distance over which wet and dry ground change.', 'm', 0.01, 100.0,
    )
    wet_prior: float = _field(
        'wet_prior', 0.5, 'Prior probability of wet ground.', '', 0.01, 0.99,
    )
    ratio_noise: float = _field(
        'ratio_noise', 0.03, 'Model error of T/N, added to that of the sensors.', '', 1e-4, 10.0,
    )
    speed_noise: float = _field(
        'speed_noise', 2e-3,
        'Model error of the slip speed, added to that of the sensors: feet also roll and bend.',
        'm/s', 1e-6, 1.0,
    )
    turning_rate: float = _field(
        'turning_rate', 4.0,
        'Root mean square of the rate at which a standing foot turns about the vertical; for legs'
        ' without an ankle, the speed of the body over the length of the leg.',
        'rad/s', 0.0, 100.0,
    )
    alarm_threshold: float = _field(
        'alarm.threshold', THRESHOLD,
        'Threshold of the slip alarm: on average at least exp(threshold) samples lie between false'
        ' alarms.',
        'nats', 0.1, 100.0,
    )
    source: str = _field(
        'source', 'markers',
        'Where slip comes from: positions of markers, or velocities of contact points with their'
        ' variances, which a body estimator has from joints and IMU.',
        choices=SOURCES,
    )
    pads_shear: bool = _field(
        'pads_shear', True,
        'With source joints: whether pads that shear move the link above them, as on a robot; the'
        ' joints of simulated robots are those of rigid feet.',
    )
    learn_friction: bool = _field(
        'learn_friction', True,
        'Whether the feet learn how much the friction of their floor differs from the contact'
        ' model.',
    )
    scale_flat_dry: float = _field(
        'scale.flat_dry', 1.0,
        'Expected friction over that of the contact model, flat and dry.',
        '', *SCALE_RANGE,
    )
    scale_flat_wet: float = _field(
        'scale.flat_wet', 1.0,
        'Expected friction over that of the contact model, flat and wet.',
        '', *SCALE_RANGE,
    )
    scale_dome: float = _field(
        'scale.dome', 1.0,
        'Expected friction over that of the contact model, dome.',
        '', *SCALE_RANGE,
    )
    scale_sd_flat_dry: float = _field(
        'scale_sd.flat_dry', SCALE_SD, 'Standard deviation of the logarithm of scale.flat_dry.',
        '', *SCALE_SD_RANGE,
    )
    scale_sd_flat_wet: float = _field(
        'scale_sd.flat_wet', SCALE_SD, 'Standard deviation of the logarithm of scale.flat_wet.',
        '', *SCALE_SD_RANGE,
    )
    scale_sd_dome: float = _field(
        'scale_sd.dome', SCALE_SD, 'Standard deviation of the logarithm of scale.dome.',
        '', *SCALE_SD_RANGE,
    )
    # fmt: on

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


SETTINGS: tuple[Setting, ...] = tuple(each.metadata['setting'] for each in fields(Tuning))
"""Settings of an estimator; an attribute of :class:`Tuning` has ``_`` in place of a dot."""

Tuning.__doc__ = f'{inspect.cleandoc(Tuning.__doc__ or "")}\n\nAttributes\n----------\n'
Tuning.__doc__ += ''.join(map(_described, SETTINGS))
