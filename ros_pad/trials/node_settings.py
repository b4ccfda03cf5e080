# SPDX-License-Identifier: Apache-2.0
"""Settings of the nodes: take them from a scene or a bag, and change them."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias

from ros_pad.configuration import Setting, choice
from ros_pad.contact.resistance import Foot
from ros_pad.control import COMMAND_TIMEOUT, MorphologyController, first_morphologies, policy_named
from ros_pad.control.morphology import LIFT_OFF, MARGIN
from ros_pad.control.policies import PREFIX
from ros_pad.control.policies import SETTINGS as POLICY_SETTINGS
from ros_pad.errors import BagError, ConfigError, InvalidInput, reason
from ros_pad.estimation import SETTINGS, Tuning
from ros_pad.estimation.stage import PUBLISH_RATE
from ros_pad.estimation.tuning import EXPECTED_LOAD, SOURCES
from ros_pad.sensing.settings import SETTINGS as BODY_SETTINGS
from ros_pad.simulation.scene import LeggedBody, Scene
from ros_pad.simulation.terrain import Floor
from ros_pad.trials import bag_notes
from ros_pad.trials.bag_notes import AMBIENT_PRESSURE, PARAMETERS

if TYPE_CHECKING:
    from ros_pad.bags import BagReader

FIXED_PRESSURE = Setting(
    'dome_pressure', 0.0,
    'Gauge pressure of every dome, at least 1000 Pa; 0: it is chosen from the load.',
    'Pa', 0.0, 1e6,
)  # fmt: skip

KNOWN = {
    each.name: each
    for each in (
        EXPECTED_LOAD, FIXED_PRESSURE, MARGIN, LIFT_OFF, COMMAND_TIMEOUT, AMBIENT_PRESSURE,
        PUBLISH_RATE, *SETTINGS, *POLICY_SETTINGS,
    )
}  # fmt: skip
"""Parameters of estimator and controller that a replay can change, by name."""

Value: TypeAlias = 'float | int | bool | str'


@contextmanager
def errors_naming(values: Mapping[str, Value]) -> Iterator[None]:
    """Put changed parameters before the message of an error that comes from them."""
    try:
        yield
    except (ConfigError, InvalidInput) as error:
        if not values:
            raise
        given = ', '.join(f'{name}={value}' for name, value in values.items())
        raise type(error)(f'{given}: {error}') from error


def body_settings_for(scene: Scene) -> dict[str, Any]:
    """Return the settings of the body estimator for the sensors of a scene, by name."""
    sensors, share = scene.sensors, 0.0
    if isinstance(scene.body, LeggedBody) and scene.body.mass != scene.body.robot.mass:
        # The estimator has the mass of the robot's file; the scene's robot has another one.
        share = min(max(0.1 * scene.body.mass / scene.body.robot.mass, 0.01), 0.9)
    return {each.name: each.default for each in BODY_SETTINGS} | {
        'contact_share': share,
        'gyro_noise': sensors.gyro,
        'accelerometer_noise': sensors.accelerometer,
        'accelerometer_bias': sensors.accelerometer_bias,
        'encoder_noise': sensors.encoder,
        'velocity_noise': sensors.joint_velocity,
        'force_noise': sensors.force,
    }


def tuning_for(scene: Scene, sensing: str = 'markers') -> Tuning:
    """Return the tuning of the estimators for the sensors of a scene, whatever its ground is.

    ``sensing`` is where slip comes from, ``markers`` or ``joints``.
    """
    sensors = scene.sensors
    if choice('sensing', sensing, SOURCES) == 'joints':
        # A body estimator has no moments; the joints of simulated robots are those of rigid feet.
        return Tuning(force_noise=sensors.force, source='joints', pads_shear=False)
    return Tuning(
        position_noise=sensors.position, force_noise=sensors.force, moment_noise=sensors.moment
    )


@dataclass(frozen=True)
class NodeSettings:
    """Settings of estimators and controller.

    Attributes
    ----------
    foot : Foot
    policy : str
        ``flat``, ``dome``, ``adaptive`` or ``oracle``.
    values : dict
        Parameters of both nodes by name, those of :data:`KNOWN`; defaults where they are left out.
        Policies other than adaptive have no parameters, but their values are kept for a later
        change to adaptive.
    floor : Floor or None
        True ground, which an oracle needs.
    legs : tuple of int
        Numbers of the legs of the robot; empty where they are unknown.
    assumed : tuple of str
        Assumptions in place of settings that the bag lacks, one sentence each.
    """

    foot: Foot
    policy: str
    values: dict[str, Any] = field(default_factory=dict)
    floor: Floor | None = None
    legs: tuple[int, ...] = ()
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        given = self.values
        values = {n: each.accept(given.get(n, each.default)) for n, each in KNOWN.items()}
        object.__setattr__(self, 'values', values)

    @classmethod
    def of(cls, bag: BagReader) -> NodeSettings:
        """Return the settings of the nodes of a bag, and defaults for those that it lacks.

        They come from the recorded parameters of estimator and controller, as in bags of ros_pad's
        recorder.

        Parameters
        ----------
        bag : BagReader
            The bag.

        Raises
        ------
        BagError
            When the custom data of the bag are not those of ros_pad.
        ConfigError
            When the foot of the bag is not found.
        """
        about = bag_notes.read(bag)
        told = about['settings']
        foot, policy = told.get('foot', 'large37'), about['policy'] or 'adaptive'
        try:
            nodes = list(json.loads(bag.custom_data.get(PARAMETERS, '{}')).values())
            # Find the nodes by their parameters, because users may rename nodes.
            estimators = [each for each in nodes if {'wet_prior', 'force_range'} <= each.keys()]
            controllers = [each for each in nodes if {'policy', 'margin'} <= each.keys()]
            if len(estimators) != 1 or len(controllers) != 1:
                values = {name: told[name] for name in KNOWN if name in told}
                assumed = (
                    f'the bag lacks the parameters of its nodes: foot {foot}, policy {policy},'
                    f' expected_load {values.get("expected_load", EXPECTED_LOAD.default):g} N and'
                    ' the default noise are assumed'
                )
                return cls(Foot.load(foot), policy, values, about['floor'], assumed=(assumed,))
            values, floor = told | estimators[0] | controllers[0], about['floor']
            if floor is None and values.get('scene'):
                floor = Scene.load(values['scene']).floor.build(int(values.get('seed', 0)))
            legs = tuple(values['legs'])
            return cls(Foot.load(values['foot']), str(values['policy']), values, floor, legs)
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise BagError(
                f'{bag.path}: in the custom data {PARAMETERS!r} a parameter of the estimator or'
                f' controller is missing or not valid: {reason(error)}'
            ) from error

    def changed(
        self,
        values: Mapping[str, Value] | None = None,
        policy: str | None = None,
        foot: str | os.PathLike[str] | None = None,
    ) -> NodeSettings:
        """Return changed settings.

        Parameters
        ----------
        values : mapping or None
            New values, by name of a parameter of the estimator or controller node.
        policy : str or None
            Name of the policy; None keeps it.
        foot : str, path or None
            A name in config/feet, or a YAML file; None keeps the foot.

        Raises
        ------
        ConfigError, InvalidInput
            When a name or value is not allowed; the message names it, and what is allowed.
        """
        values = dict(values or {})
        for name in values:
            choice('parameter', name, tuple(KNOWN))
        with errors_naming(values):
            settings = replace(
                self,
                foot=self.foot if foot is None else Foot.load(foot),
                policy=policy or self.policy,
                values=self.values | values,
            )
            if of_policy := _of_policy(values):
                policy_named(settings.policy, parameters=of_policy)  # raises unless it is adaptive
            settings.controller(settings.legs or (1,))
        return settings

    def as_dict(self) -> dict[str, Any]:
        """Return the values that :meth:`changed` can change, by the same names."""
        kept = self.policy == 'adaptive'
        return {n: each for n, each in self.values.items() if kept or not n.startswith(PREFIX)}

    @property
    def tuning(self) -> Tuning:
        """Tuning of the estimators; a yaw moment is used if its noise is above 0."""
        return Tuning.of(self.values)

    def controller(self, legs: Sequence[int]) -> MorphologyController:
        """Return a new controller.

        Parameters
        ----------
        legs : sequence of int
            Its legs, from 1.
        """
        is_wet, values = self.floor.wet if self.floor else None, self.values
        parameters = _of_policy(values) if self.policy == 'adaptive' else None
        return MorphologyController(
            self.foot,
            legs,
            policy_named(self.policy, is_wet, parameters),
            values['expected_load'],
            start=first_morphologies(self.policy, legs),
            margin=values['margin'],
            fixed_pressure=values['dome_pressure'] or None,
            lift_off_share=values['lift_off_share'],
            command_timeout=values['command_timeout'],
        )


def _of_policy(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of the adaptive policy among those of nodes."""
    return {n.removeprefix(PREFIX): each for n, each in values.items() if n.startswith(PREFIX)}
