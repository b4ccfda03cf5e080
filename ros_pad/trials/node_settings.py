# SPDX-License-Identifier: Apache-2.0
"""Settings of the nodes: take them from a scene or a bag, and change them."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias

from ros_pad.configuration import Setting, choice
from ros_pad.contact.resistance import Foot
from ros_pad.control import COMMAND_TIMEOUT, MorphologyController, first_morphologies, policy_named
from ros_pad.control.morphology import LIFT_OFF, MARGIN
from ros_pad.control.policies import PREFIX
from ros_pad.control.policies import SETTINGS as POLICY_SETTINGS
from ros_pad.errors import BagError, InvalidInput, LimitError, reason
from ros_pad.estimation import SETTINGS, Tuning
from ros_pad.estimation.stage import PUBLISH_RATE
from ros_pad.estimation.tuning import EXPECTED_LOAD, SOURCES, attribute
from ros_pad.sensing.stage import SETTINGS as BODY_SETTINGS
from ros_pad.simulation.scene import LeggedBody, Scene
from ros_pad.simulation.terrain import Floor
from ros_pad.trials import label
from ros_pad.trials.label import AMBIENT_PRESSURE, PARAMETERS

if TYPE_CHECKING:
    from ros_pad.bags import BagReader

OWN = (
    EXPECTED_LOAD,
    Setting(
        'dome_pressure', 0.0, 'Gauge pressure of every dome; 0 chooses it from the load.',
        'Pa', 0.0, 1e6,
    ),
    MARGIN,
    LIFT_OFF,
    COMMAND_TIMEOUT,
    AMBIENT_PRESSURE,
    PUBLISH_RATE,
)  # fmt: skip
"""Settings that are single numbers in :class:`NodeSettings`."""

_ESTIMATOR = {each.name: attribute(each) for each in SETTINGS}

SHAKING = 0.3
"""Error of an acceleration as the mean of a sample while the robot walks, m/s²: its steps are
shorter. Where all feet slip, the body estimator must not rely on the IMU more than that."""

Value: TypeAlias = 'float | int | bool | str'


def body_settings_for(scene: Scene) -> dict[str, Any]:
    """Return the settings of the body estimator for the sensors of a scene, by name."""
    sensors, share = scene.sensors, 0.0
    if isinstance(scene.body, LeggedBody) and scene.body.mass != scene.body.robot.mass:
        # The estimator has the mass of the robot's file; the scene's robot has another one.
        share = min(max(0.1 * scene.body.mass / scene.body.robot.mass, 0.01), 0.9)
    return {each.name: each.default for each in BODY_SETTINGS} | {
        'contact_share': share,
        'gyro_noise': sensors.gyro,
        'accelerometer_noise': math.hypot(sensors.accelerometer, SHAKING),
        'accelerometer_bias': sensors.accelerometer_bias,
        'encoder_noise': sensors.encoder,
        'velocity_noise': sensors.joint_velocity,
        'force_noise': sensors.force,
        'rate': sensors.rate,
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
    expected_load : float
        Load of a foot in stance, N.
    tuning : Tuning
        Tuning of the estimators; a yaw moment is used if its noise is above 0.
    policy : str
        ``flat``, ``dome``, ``adaptive`` or ``oracle``.
    policy_parameters : dict
        Parameters of the adaptive policy. Other policies have none, but the values are kept for a
        later change to adaptive.
    dome_pressure : float
        Gauge pressure of every dome, Pa; 0 chooses it from the load.
    margin : float
        Pressure margin: factor on the load when the pressure of a dome is chosen.
    lift_off_share : float
        Share of the expected load below which a foot has lifted off.
    command_timeout : float
        Time without a set-point after which a regulator vents its pad, s.
    ambient_pressure : float
        Absolute pressure around the robot, Pa.
    publish_rate : float
        Rate of the estimates, Hz.
    floor : Floor or None
        True ground, which an oracle needs.
    legs : tuple of int
        Numbers of the legs of the robot; empty where they are unknown.
    assumed : tuple of str
        Assumptions in place of settings that the bag lacks, one sentence each.
    """

    foot: Foot
    expected_load: float
    tuning: Tuning
    policy: str
    policy_parameters: dict[str, Any] = field(default_factory=dict)
    dome_pressure: float = 0.0
    margin: float = MARGIN.default
    lift_off_share: float = LIFT_OFF.default
    command_timeout: float = COMMAND_TIMEOUT.default
    ambient_pressure: float = AMBIENT_PRESSURE.default
    publish_rate: float = PUBLISH_RATE.default
    floor: Floor | None = None
    legs: tuple[int, ...] = ()
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for setting in OWN:
            setting.accept(getattr(self, setting.name))

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
        about = label.read(bag)
        known = about['settings']
        settings = cls(
            Foot.load(known.get('foot', 'large37')),
            float(known.get('expected_load', EXPECTED_LOAD.default)),
            Tuning(),
            about['policy'] or 'adaptive',
            ambient_pressure=known['ambient_pressure'],
            floor=about['floor'],
        )
        try:
            nodes = list(json.loads(bag.custom_data.get(PARAMETERS, '{}')).values())
            # Find the nodes by their parameters, because users may rename nodes.
            found = [each for each in nodes if {'wet_prior', 'force_range'} <= each.keys()]
            controllers = [each for each in nodes if {'policy', 'margin'} <= each.keys()]
            if len(found) == len(controllers) == 1:
                return settings._of_nodes(found[0] | controllers[0])
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise BagError(
                f'{bag.path}: in the custom data {PARAMETERS!r} a parameter of the estimator or'
                f' controller is missing or not valid: {reason(error)}'
            ) from error
        assumed = (
            f'the bag lacks the parameters of its nodes: foot {settings.foot.source}, policy'
            f' {settings.policy}, expected_load {settings.expected_load:g} N and the default noise'
            ' are assumed'
        )
        return replace(settings, assumed=(assumed,))

    def _of_nodes(self, values: dict[str, Any]) -> NodeSettings:
        """Return settings with the recorded parameters of estimator and controller."""
        floor = self.floor
        if floor is None and values.get('scene'):
            floor = Scene.load(values['scene']).floor.build(int(values.get('seed', 0)))
        tuning = {place: values[name] for name, place in _ESTIMATOR.items() if name in values}
        of_policy = {each.name: values[each.name] for each in POLICY_SETTINGS}
        return replace(
            self,
            **{each.name: values.get(each.name, getattr(self, each.name)) for each in OWN},
            foot=Foot.load(values['foot']),
            tuning=Tuning(**tuning),
            policy=str(values['policy']),
            policy_parameters={n.removeprefix(PREFIX): value for n, value in of_policy.items()},
            floor=floor,
            legs=tuple(values['legs']),
        )

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
        known = (*(each.name for each in (*OWN, *POLICY_SETTINGS)), *_ESTIMATOR)
        tuning: dict[str, Any] = {}
        of_policy: dict[str, Any] = {}
        changes: dict[str, Any] = {}
        for name, value in (values or {}).items():
            choice('parameter', name, known)
            if name in _ESTIMATOR:
                tuning[_ESTIMATOR[name]] = value
            elif name.startswith(PREFIX):
                of_policy[name.removeprefix(PREFIX)] = value
            else:
                changes[name] = value
        policy = policy or self.policy
        try:
            if of_policy:
                policy_named(policy, parameters=of_policy)  # raises unless policy is adaptive
            settings = replace(
                self,
                **changes,
                foot=self.foot if foot is None else Foot.load(foot),
                tuning=replace(self.tuning, **tuning),
                policy=policy,
                policy_parameters=self.policy_parameters | of_policy,
            )
            settings.controller(settings.legs or (1,))
        except (InvalidInput, LimitError) as error:
            given = ', '.join(f'{name}={value}' for name, value in (values or {}).items())
            raise InvalidInput(f'{given}: {error}' if given else str(error)) from error
        return settings

    def as_dict(self) -> dict[str, Any]:
        """Return the values that :meth:`changed` can change, by the same names."""
        return (
            {each.name: getattr(self, each.name) for each in OWN}
            | {name: getattr(self.tuning, place) for name, place in _ESTIMATOR.items()}
            | {PREFIX + name: value for name, value in (self._of_policy() or {}).items()}
        )

    def _of_policy(self) -> dict[str, Any] | None:
        return self.policy_parameters if self.policy == 'adaptive' else None

    def controller(self, legs: Sequence[int]) -> MorphologyController:
        """Return a new controller.

        Parameters
        ----------
        legs : sequence of int
            Its legs, from 1.
        """
        is_wet = self.floor.wet if self.floor else None
        return MorphologyController(
            self.foot,
            legs,
            policy_named(self.policy, is_wet, self._of_policy()),
            self.expected_load,
            start=first_morphologies(self.policy, legs),
            margin=self.margin,
            fixed_pressure=self.dome_pressure or None,
            lift_off_share=self.lift_off_share,
            command_timeout=self.command_timeout,
        )
