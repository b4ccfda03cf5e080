# SPDX-License-Identifier: Apache-2.0
"""Settings of an estimator: one table for Python, ROS parameters, sweeps and replays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from ros_pad.configuration import Setting, choice, instance
from ros_pad.estimation.scales import CLASSES, SCALE_RANGE, SCALE_SD, SCALE_SD_RANGE, Scale

EXPECTED_LOAD = Setting(
    'expected_load', 6.83, 'Normal force on a foot in stance: a third of the weight in a tripod.',
    'N', 0.01, 1000.0,
)  # fmt: skip

SOURCES = ('markers', 'joints')
"""Where slip comes from."""


def _field(*given: Any, **more: Any) -> Any:
    """Return a field of a dataclass with a setting, which is named after it."""
    setting = Setting('', *given, **more)
    return field(default=setting.default, metadata={'setting': setting})


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
        1.5e-4, 'Standard deviation of a marker coordinate, until it is measured; 0: readings may'
        ' repeat.', 'm', 0.0, 0.1)
    force_noise: float = _field(
        0.03, 'Standard deviation of a force component, until it is measured; 0: readings may'
        ' repeat.', 'N', 0.0, 100.0)
    moment_noise: float = _field(
        0.0, 'Standard deviation of the torque z of a wrench; 0: the sensors do not measure it.',
        'N m', 0.0, 10.0)
    force_range: float = _field(
        0.0, 'Largest component of force that a sensor can show; 0: not known.', 'N', 0.0, 1e5)
    filter_period: float = _field(
        0.04, 'Time between updates of the wetness and friction filter.', 's', 0.001, 10.0)
    patch_length: float = _field(
        1.5, 'Distance over which wet and dry ground change.', 'm', 0.01, 100.0)
    wet_prior: float = _field(0.5, 'Prior probability of wet ground.', '', 0.01, 0.99)
    turning_rate: float = _field(
        4.0, 'Median rate at which a standing foot turns about the vertical; for legs without an'
        ' ankle, the speed of the body over the length of the leg.',
        'rad/s', 0.0, 100.0)
    alarm_distance: float = _field(
        5e-4, 'Distance by which a contact has slipped when the alarm is raised.',
        'm', 1e-5, 0.1)
    source: str = _field(
        'markers', 'Where slip comes from: positions of markers, or velocities of contact points'
        ' with their variances, which a body estimator has from joints and IMU.', choices=SOURCES)
    pads_shear: bool = _field(
        True, 'With source joints: whether pads that shear move the link above them, as on a'
        ' robot; the joints of simulated robots are those of rigid feet.')
    learn_friction: bool = _field(
        True, 'Whether the feet learn how much the friction of their floor differs from the'
        ' contact model.')
    # fmt: on
    scales: Mapping[str, Scale] = field(default_factory=dict)

    def __post_init__(self) -> None:
        instance('scales', self.scales, Mapping)
        for name in self.scales:
            choice('scales', name, CLASSES)
        object.__setattr__(self, 'scales', dict.fromkeys(CLASSES, Scale()) | dict(self.scales))
        values = self.values
        for setting in SETTINGS:
            setting.accept(values[setting.name])

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Tuning:
        """Return the tuning with these values of all settings, by name; others are ignored.

        Parameters
        ----------
        values : mapping
            Values by the names of :data:`SETTINGS`.

        Returns
        -------
        Tuning
            The tuning.
        """
        scales = {n: Scale(values[f'scale.{n}'], values[f'scale_sd.{n}']) for n in CLASSES}
        own = {attribute: values[each.name] for attribute, each in _OWN.items()}
        return cls(**own, scales=scales)

    @property
    def values(self) -> dict[str, Any]:
        """Values of all settings by name; :meth:`of` takes them."""
        return {
            **{each.name: getattr(self, attribute) for attribute, each in _OWN.items()},
            **{f'scale.{name}': scale.scale for name, scale in self.scales.items()},
            **{f'scale_sd.{name}': scale.sd for name, scale in self.scales.items()},
        }


_OWN: dict[str, Setting] = {
    each.name: replace(each.metadata['setting'], name=each.name.replace('alarm_', 'alarm.'))
    for each in fields(Tuning)
    if each.metadata
}
SETTINGS: tuple[Setting, ...] = (
    *_OWN.values(),
    *(Setting(f'scale.{name}', 1.0, 'Expected friction over that of the contact model,'
              f' {name.replace("_", " and ")}.', '', *SCALE_RANGE) for name in CLASSES),
    *(Setting(f'scale_sd.{name}', SCALE_SD, 'Standard deviation of the logarithm of'
              f' scale.{name}.', '', *SCALE_SD_RANGE) for name in CLASSES),
)  # fmt: skip
"""Settings of an estimator, as in parameters, sweeps and replays. An attribute of :class:`Tuning`
has ``_`` in place of a dot; the last six are in its ``scales``."""
