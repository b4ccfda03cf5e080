# SPDX-License-Identifier: Apache-2.0
"""The closed loop of a trial without ROS: robot, estimators, controller, regulators.

The composed nodes make the same calls on the same objects in the same order; the order is written
here once, in :meth:`ClosedLoop.tick`.
"""

from __future__ import annotations

import difflib
import inspect
import math
import os
import time
from collections.abc import Callable
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from ros_pad.control import MorphologyController
from ros_pad.control import adaptive
from ros_pad.control import first_shapes
from ros_pad.control import policy_named
from ros_pad.control.morphology import Policy
from ros_pad.errors import InvalidInput
from ros_pad.errors import TransportError
from ros_pad.estimation import FootEstimator
from ros_pad.estimation import Tuning
from ros_pad.estimation import trouble_in
from ros_pad.pace import Pace
from ros_pad.regulators import SimulatedRegulator
from ros_pad.regulators import create
from ros_pad.simulation import fidelity as ladder
from ros_pad.simulation.faults import faults_of
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.sensors import Sensors
from ros_pad.simulation.terrain import Floor
from ros_pad.trials.log import TrialLog
from ros_pad.trials.trial import Trial

CONTROL_PERIOD_NS = 20_000_000  # 50 Hz: what a regulator on a serial line manages

COMMAND_TIMEOUT_NS = 500_000_000  # without a command for so long, the regulator node vents a pad

POLICY_PARAMETERS = tuple(inspect.signature(adaptive).parameters)
"""Names of the parameters of the adaptive policy."""

Progress = Callable[[float], None]


def sample_period_ns(scene: Scene) -> int:
    """Return the period of the sensors, ns."""
    return round(1e9 / scene.sensors.rate)


def tuning_for(scene: Scene) -> Tuning:
    """Return what an estimator is told of a scene: its sensors, not its ground."""
    sensors = scene.sensors
    return Tuning(
        position_noise=sensors.position, force_noise=sensors.force, moment_noise=sensors.moment
    )


def adaptive_with(parameters: Mapping[str, Any]) -> Policy:
    """Return the adaptive policy with parameters by name, see :func:`ros_pad.control.adaptive`.

    Raises
    ------
    InvalidInput
        For a parameter that it has not, or that is outside its range.
    """
    for name in parameters:
        if name not in POLICY_PARAMETERS:
            near = difflib.get_close_matches(name, POLICY_PARAMETERS, n=1)
            hint = f' Did you mean {near[0]!r}?' if near else ''
            raise InvalidInput(
                f'the adaptive policy has no parameter {name!r}.{hint}'
                f' Allowed: {", ".join(POLICY_PARAMETERS)}'
            )
    return adaptive(**parameters)


def policy_for(policy: str, floor: Floor, parameters: Mapping[str, Any] | None = None) -> Policy:
    """Return a policy on a floor, which an oracle sees; parameters are for ``adaptive`` alone.

    Raises
    ------
    InvalidInput
        For an unknown policy, or a parameter that is unknown or outside its range.
    """
    if not parameters:
        return policy_named(policy, floor.wet)
    if policy != 'adaptive':
        raise InvalidInput(
            f'policy = {policy!r} has no parameters, and {", ".join(parameters)} was given:'
            ' only adaptive has'
        )
    return adaptive_with(parameters)


def simulated_regulator(scene: Scene, leg: int, clock: Callable[[], float]) -> SimulatedRegulator:
    """Return the simulated regulator of one foot of a scene, with its faults."""
    foot = scene.foot
    regulator = create(
        'simulated',
        clock=clock,
        ceiling=foot.ceiling,
        pad_volume=foot.air_volume,
        faults=faults_of(leg, scene.faults),
        **scene.regulator,
    )
    assert isinstance(regulator, SimulatedRegulator)
    return regulator


class ClosedLoop:
    """Everything of a trial in one process, advanced sample by sample.

    Parameters
    ----------
    scene : Scene
        What to walk on, with what.
    policy : str
        ``flat``, ``dome``, ``adaptive`` or ``oracle``.
    seed : int
        Of floor and noise, 0 or more.
    fidelity : str
        ``auto`` or a rung of the ladder.
    tuning : Tuning or None
        Of the estimators; None is :func:`tuning_for` the scene.
    policy_parameters : mapping or None
        See :func:`policy_for`.

    Raises
    ------
    InvalidInput
        For an unknown policy or parameter, or a seed that is no whole number from 0.
    """

    def __init__(
        self,
        scene: Scene,
        policy: str,
        seed: int,
        fidelity: str = 'auto',
        tuning: Tuning | None = None,
        policy_parameters: Mapping[str, Any] | None = None,
    ) -> None:
        if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
            raise InvalidInput(f'seed = {seed!r}: a whole number from 0 is needed')
        self.period_ns = sample_period_ns(scene)
        self.floor = scene.floor.build(seed)
        self.robot = ladder.build(scene, self.floor, self.period_ns * 1e-9, fidelity)
        self.sensors = Sensors.of(scene, seed)
        tuning = tuning or tuning_for(scene)
        self.estimators = [
            FootEstimator(scene.foot, scene.expected_load, tuning) for _ in scene.legs
        ]
        self.controller = MorphologyController(
            scene.foot,
            scene.legs,
            policy_for(policy, self.floor, policy_parameters),
            scene.expected_load,
            start=first_shapes(policy, scene.legs),
            fixed_pressure=scene.dome_pressure,
        )
        self._now = 0.0
        self.regulators = [simulated_regulator(scene, leg, self._clock) for leg in scene.legs]
        for leg, regulator in zip(scene.legs, self.regulators, strict=True):
            try:
                regulator.open()
            except TransportError as error:
                raise TransportError(f'scene {scene.name!r}, leg {leg}: {error}') from error
        self.pressures = [0.0] * len(scene.legs)  # as reported last
        self.pads = [0.0] * len(scene.legs)  # as they are
        self._commanded = [0] * len(scene.legs)  # when each last took a command, ns
        self._unheard: set[int] = set()  # that took no command of late
        self._legs = scene.legs
        # Since the last control step: feet that bounce as the other tripod lands have not stepped.
        self._heaviest = [-math.inf] * len(scene.legs)
        self._pace = Pace(CONTROL_PERIOD_NS)
        self._stamp_ns = 0

    def _clock(self) -> float:
        return self._now

    def tick(self, log: TrialLog) -> None:
        """Advance by one sample.

        The robot moves; each foot is estimated with the pressure it last reported; at control
        steps the regulators report, the controller decides, and the regulators get its set-points.
        A regulator that does not answer leaves its last report in force.
        """
        self._stamp_ns += self.period_ns
        now = self._now = self._stamp_ns * 1e-9
        self._vent_unheard()
        self.robot.step(self.pads)
        readings = self.sensors.read(self.robot)
        moments = self.sensors.read_moments(self.robot)
        controller = self.controller
        due = self._pace.due(self._stamp_ns)
        estimates, heaviest = [], self._heaviest
        for index in range(len(self._legs)):
            force, position = readings[index]
            heaviest[index] = max(heaviest[index], force[2])
            estimates.append(
                self.estimators[index].update(
                    now, force, position, self.pressures[index], moments[index]
                )
            )
        log.sample(now, self.robot.body, readings)
        if due:
            heard: list[float | None] = [None] * len(self.regulators)
            for index, regulator in enumerate(self.regulators):
                with suppress(TransportError):
                    heard[index] = self.pressures[index] = regulator.read().pressure
            self.pads = [regulator.pad_pressure for regulator in self.regulators]
            for index, leg in enumerate(self._legs):
                controller.doubt(leg, trouble_in(estimates[index].doubt))
                controller.observe(leg, now, heard[index])
                (_, _, load), position = readings[index]
                wet = estimates[index].wet_probability
                if not math.isfinite(load + wet + position[0] + position[1]):
                    # No set-point follows from what is no number; the pad is vented in time.
                    self._unheard.add(index)
                    continue
                self._command(index, controller.update(leg, heaviest[index], wet, position))
            log.control(now, self.pressures, estimates, controller)
            self._heaviest = [-math.inf] * len(heaviest)

    def _command(self, index: int, setpoint: float) -> None:
        try:
            self.regulators[index].set_pressure(setpoint)
        except TransportError:
            self._unheard.add(index)
        else:
            self._unheard.discard(index)
            self._commanded[index] = self._stamp_ns

    def _vent_unheard(self) -> None:
        """Vent, as soon as they answer again, pads that took no command for too long."""
        for index in sorted(self._unheard):
            if self._stamp_ns - self._commanded[index] > COMMAND_TIMEOUT_NS:
                with suppress(TransportError):
                    self.regulators[index].vent()
                    self._unheard.discard(index)

    def close(self) -> None:
        """Vent and close the regulators."""
        for regulator in self.regulators:
            with suppress(TransportError):
                regulator.vent()
            regulator.close()


def run(
    scene: Scene | str | os.PathLike[str],
    policy: str | None = None,
    seed: int = 0,
    fidelity: str = 'auto',
    progress: Progress | None = None,
    tuning: Tuning | None = None,
    policy_parameters: Mapping[str, Any] | None = None,
) -> Trial:
    """Run a trial without ROS.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, the name of one, or a YAML file.
    policy : str or None
        ``flat``, ``dome``, ``adaptive`` or ``oracle``; None takes the scene's own.
    seed : int
        Of floor and noise, 0 or more; the same seed gives the same trial.
    fidelity : str
        ``auto`` or a rung of the ladder.
    progress : callable or None
        Called now and then with the simulated time, s.
    tuning : Tuning or None
        Of the estimators; None is :func:`tuning_for` the scene, what they are told of its sensors.
    policy_parameters : mapping or None
        Parameters of :func:`ros_pad.control.adaptive`, by name.

    Returns
    -------
    Trial
        Time series and metrics.

    Raises
    ------
    ConfigError, InvalidInput
        Naming what is wrong with scene, policy, seed or fidelity.
    """
    if not isinstance(scene, Scene):
        scene = Scene.load(scene)
    policy = scene.policy if policy is None else policy
    rung = ladder.rung(scene, fidelity, policy)
    loop = ClosedLoop(scene, policy, seed, rung, tuning, policy_parameters)
    log = TrialLog(scene, policy, seed, rung)
    started = time.perf_counter()
    samples = round(scene.duration * 1e9) // loop.period_ns
    try:
        for sample in range(samples):
            loop.tick(log)
            if progress and sample % 250 == 0:
                progress(loop.robot.time)
            if loop.robot.verdict:
                break
    finally:
        loop.close()
    wall = time.perf_counter() - started
    return log.finish(loop.robot, loop.controller, loop.floor, loop.robot.time / wall)
