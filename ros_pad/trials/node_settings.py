# SPDX-License-Identifier: Apache-2.0
"""What the nodes of a bag were told, and what else they might have been told."""

from __future__ import annotations

import difflib
import json
import math
import os
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from dataclasses import fields
from dataclasses import replace
from typing import Any
from typing import TypeAlias

from ros_pad.contact.pad import number
from ros_pad.contact.resistance import Foot
from ros_pad.control import MorphologyController
from ros_pad.control import first_shapes
from ros_pad.control import policy_named
from ros_pad.control.morphology import Policy
from ros_pad.errors import BagError
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.errors import LimitError
from ros_pad.estimation import Tuning
from ros_pad.simulation.scene import FloorPlan
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor
from ros_pad.trials import loop
from ros_pad.trials.bag import BagReader
from ros_pad.trials.label import AMBIENT_PRESSURE
from ros_pad.trials.label import KEY
from ros_pad.trials.label import PARAMETERS

SETTABLE = ('expected_load', 'dome_pressure', 'margin', 'ambient_pressure', 'publish_rate')
"""What may be set by its own name: parameters of the estimator and controller nodes."""

ESTIMATOR, POLICY = 'estimator.', 'policy.'  # as in sweeps

Value: TypeAlias = 'float | int | bool | str'


@dataclass(frozen=True)
class Settings:
    """What estimators and controller are told.

    Attributes
    ----------
    foot : Foot
    expected_load : float
        Normal force in stance, N.
    tuning : Tuning
        Of the estimators; a moment is used if its noise is above 0.
    policy : str
        ``flat``, ``dome``, ``adaptive`` or ``oracle``.
    policy_parameters : dict
        Of the adaptive policy.
    dome_pressure : float
        Gauge pressure of every dome, Pa; 0 chooses it from the load.
    margin : float
        Factor on the load, for the pressure of a dome.
    ambient_pressure : float
        Pa.
    publish_rate : float
        Estimates a second, Hz.
    floor : Floor or None
        That an oracle sees.
    scene : str
        That was walked; empty where the bag does not say.
    seed : int
        Of floor and noise.
    legs : tuple of int
        That the robot had; empty where the bag does not say.
    assumed : tuple of str
        What the bag does not say, in words.
    """

    foot: Foot
    expected_load: float
    tuning: Tuning
    policy: str
    policy_parameters: dict[str, Any] = field(default_factory=dict)
    dome_pressure: float = 0.0
    margin: float = 1.2
    ambient_pressure: float = AMBIENT_PRESSURE
    publish_rate: float = 50.0
    floor: Floor | None = None
    scene: str = ''
    seed: int = 0
    legs: tuple[int, ...] = ()
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        number('expected_load', self.expected_load, 'N', above=True)
        number('dome_pressure', self.dome_pressure, 'Pa')
        number('ambient_pressure', self.ambient_pressure, 'Pa', 30000.0, 120000.0)
        number('publish_rate', self.publish_rate, 'Hz', 5.0, 1000.0)

    @classmethod
    def of(cls, bag: BagReader) -> Settings:
        """Return what the nodes of a bag were told, and the nodes' defaults where it is silent.

        The parameters of estimator and controller count where the bag has them, as those of
        ros_pad's recorder do; else what it says of its scene.

        Raises
        ------
        BagError
            When the bag describes its trial in a way that nobody understands.
        ConfigError
            When its foot is not here.
        """
        try:
            said = json.loads(bag.custom_data.get(KEY, '{}'))
            told = said.get('settings') or {}
            load = float(told.get('expected_load', 6.83))
            ambient = float(said.get('ambient_pressure', AMBIENT_PRESSURE))
            policy = str(said.get('policy') or 'adaptive')
            source, seed = str(said.get('scene') or ''), int(said.get('seed') or 0)
            floor = FloorPlan(**said['floor']).build(seed) if said.get('floor') else None
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise BagError(
                f'{bag.path}: custom data {KEY!r} does not describe a trial of ros_pad: {error}'
            ) from error
        settings = cls(
            Foot.load(told.get('foot', 'large37')),
            load,
            Tuning(moment_noise=0.0),
            policy,
            ambient_pressure=ambient,
            floor=floor,
            scene=source,
            seed=seed,
        )
        told_nodes = _told(bag)
        if told_nodes:
            try:
                return _of_nodes(settings, *told_nodes)
            except (KeyError, TypeError, ValueError) as error:
                raise BagError(
                    f'{bag.path}: custom data {PARAMETERS!r} lack parameters of ros_pad, or have'
                    f' others: {error!r}'
                ) from error
        if not said:
            return replace(
                settings,
                assumed=(
                    'the bag does not say what its nodes were told: foot large37, policy adaptive,'
                    f' expected_load {load:g} N and the default noise are assumed',
                ),
            )
        try:
            scene = Scene.load(source)
        except ConfigError:
            return replace(
                settings,
                assumed=(f'scene {source!r} of the bag is not here: default noise is assumed',),
            )
        return replace(
            settings,
            tuning=loop.tuning_for(scene),
            dome_pressure=scene.dome_pressure or 0.0,
            legs=tuple(scene.legs),
        )

    def changed(
        self,
        values: Mapping[str, Value] | None = None,
        policy: str | None = None,
        foot: str | os.PathLike[str] | None = None,
    ) -> Settings:
        """Return others.

        Parameters
        ----------
        values : mapping or None
            By name: one of :data:`SETTABLE`, ``estimator.`` and an attribute of
            :class:`ros_pad.estimation.Tuning`, or ``policy.`` and a parameter of
            :func:`ros_pad.control.adaptive`.
        policy : str or None
            How shapes are chosen.
        foot : str, path or None
            A name in config/feet, or a YAML file.

        Raises
        ------
        ConfigError, InvalidInput
            Naming the parameter, its value and what is allowed.
        """
        tuning, of_policy, own = {}, {}, {}
        known = (
            *SETTABLE,
            *(ESTIMATOR + each.name for each in fields(Tuning)),
            *(POLICY + name for name in loop.POLICY_PARAMETERS),
        )
        for name, value in (values or {}).items():
            if name not in known:
                near = difflib.get_close_matches(name, known, n=1)
                hint = f' Did you mean {near[0]!r}?' if near else ''
                raise InvalidInput(
                    f'parameter {name!r} is unknown.{hint} Allowed: {", ".join(known)}'
                )
            if name.startswith(ESTIMATOR):
                tuning[name.removeprefix(ESTIMATOR)] = value
            elif name.startswith(POLICY):
                of_policy[name.removeprefix(POLICY)] = value
            else:
                own[name] = value
        try:
            changes: dict[str, Any] = {
                **own,
                'tuning': replace(self.tuning, **tuning),  # type: ignore[arg-type]
                'policy': policy or self.policy,
                'policy_parameters': of_policy,
            }
            if foot is not None:
                changes['foot'] = Foot.load(foot)
            settings = replace(self, **changes)
            settings.rules()
            settings.controller(settings.legs or (1,))
        except (InvalidInput, LimitError) as error:
            given = ', '.join(f'{name}={value}' for name, value in (values or {}).items())
            raise InvalidInput(f'{given}: {error}' if given else str(error)) from error
        return settings

    def rules(self) -> Policy:
        """Return the policy."""
        if not self.policy_parameters:
            return policy_named(self.policy, self.floor.wet if self.floor else None)
        if self.policy != 'adaptive':
            raise InvalidInput(f'policy = {self.policy!r} has no parameters: only adaptive has')
        return loop.adaptive_with(self.policy_parameters)

    def controller(self, legs: Sequence[int]) -> MorphologyController:
        """Return a controller that has not heard of anything yet."""
        return MorphologyController(
            self.foot,
            legs,
            self.rules(),
            self.expected_load,
            start=first_shapes(self.policy, legs),
            margin=self.margin,
            fixed_pressure=self.dome_pressure or None,
        )


def _told(bag: BagReader) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """Return the parameters of estimator and controller; None unless the bag has one of each."""
    try:
        nodes = list(json.loads(bag.custom_data.get(PARAMETERS, '{}')).values())
        # By what they have: their names may be others.
        estimators = [each for each in nodes if {'wet_prior', 'force_range'} <= each.keys()]
        controllers = [each for each in nodes if {'policy', 'margin'} <= each.keys()]
    except (AttributeError, TypeError, ValueError) as error:
        raise BagError(
            f'{bag.path}: custom data {PARAMETERS!r} are no parameters of nodes: {error}'
        ) from error
    if len(estimators) == len(controllers) == 1:
        return estimators[0], controllers[0]
    return None


def _of_nodes(
    settings: Settings, estimator: dict[str, Any], controller: dict[str, Any]
) -> Settings:
    """Return settings with what the nodes themselves were told."""
    tuning = {each.name: estimator[each.name] for each in fields(Tuning) if each.name in estimator}
    tuning['force_range'] = tuning['force_range'] or math.inf
    floor, seed = settings.floor, settings.seed
    if floor is None and controller.get('scene'):
        seed = int(controller.get('seed', 0))
        floor = Scene.load(controller['scene']).floor.build(seed)
    return replace(
        settings,
        foot=Foot.load(controller['foot']),
        expected_load=float(controller['expected_load']),
        tuning=Tuning(**tuning),
        policy=str(controller['policy']),
        dome_pressure=float(controller['dome_pressure']),
        margin=float(controller['margin']),
        ambient_pressure=float(controller['ambient_pressure']),
        publish_rate=float(estimator['publish_rate']),
        floor=floor,
        seed=seed,
        legs=tuple(controller['legs']),
    )
