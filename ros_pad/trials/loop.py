# SPDX-License-Identifier: Apache-2.0
"""The closed loop of a trial without ROS: a robot, and the three stages of each of its legs.

The stages are estimation, decision and regulator. The loop only passes samples, pressures and
set-points between them, in the same order as the composed nodes.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any

import numpy as np

from ros_pad.configuration import choice
from ros_pad.configuration import instance
from ros_pad.control import MorphologyController
from ros_pad.control import first_morphologies
from ros_pad.control import policy_named
from ros_pad.control.stage import DecisionStage
from ros_pad.errors import InvalidInput
from ros_pad.errors import TransportError
from ros_pad.estimation import DOUBTS
from ros_pad.estimation import FootEstimator
from ros_pad.estimation import Tuning
from ros_pad.estimation import estimators_of
from ros_pad.estimation.stage import Emission
from ros_pad.estimation.stage import EstimationStage
from ros_pad.estimation.tuning import SOURCES
from ros_pad.pace import CONTROL_PERIOD_NS
from ros_pad.pace import TICK_PERIOD_NS
from ros_pad.pace import Pace
from ros_pad.pace import Progress
from ros_pad.records import ESTIMATE
from ros_pad.records import Block
from ros_pad.regulators import SimulatedRegulator
from ros_pad.regulators import create
from ros_pad.regulators.supervision import Supervision
from ros_pad.regulators.supervisor import DEFAULTS as SUPERVISION
from ros_pad.regulators.supervisor import SupervisedChannel
from ros_pad.sensing import BodyEstimate
from ros_pad.sensing import SensingStage
from ros_pad.sensing.stage import FootReadings
from ros_pad.sensing.stage import estimator_of
from ros_pad.sensing.stage import foot_readings
from ros_pad.simulation import fidelity as levels
from ros_pad.simulation.faults import faults_of
from ros_pad.simulation.full_robot import FullRobot
from ros_pad.simulation.robot import Vector
from ros_pad.simulation.scene import LeggedBody
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.sensors import BodySensors
from ros_pad.simulation.sensors import Reading
from ros_pad.simulation.sensors import Sensors
from ros_pad.simulation.terms import with_terms
from ros_pad.trials.learnt import settings_of
from ros_pad.trials.log import TrialLog
from ros_pad.trials.node_settings import body_settings_for
from ros_pad.trials.node_settings import tuning_for
from ros_pad.trials.trial import Trial
from ros_pad.trials.trial import heading


def simulated_regulator(scene: Scene, leg: int, clock: Callable[[], float]) -> SimulatedRegulator:
    """Return the simulated regulator of one foot of a scene, with the faults of its leg."""
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


class LegStages:
    """The stages of one leg, connected.

    Attributes
    ----------
    estimation : EstimationStage
    pressure : float
        Gauge pressure that the regulator reported last, Pa.
    """

    def __init__(
        self,
        leg: int,
        estimator: FootEstimator,
        period_ns: int,
    ) -> None:
        self.leg = leg
        self.estimation = EstimationStage(
            estimator, period_ns, self._take, lambda _: None, _ignore
        )
        self.pressure = 0.0
        self._emission: Emission | None = None  # waits for a decision

    def _take(self, emission: Emission) -> None:
        self._emission = emission

    def tick(self, now_ns: int) -> None:
        """Detect missing inputs; the loop calls this every ``pace.TICK_PERIOD_NS``."""
        self.estimation.tick(now_ns)

    def sample(self, stamp_ns: int, reading: Reading, moment: float | None) -> None:
        """Pass a sample of the sensors to the stages."""
        force, position = reading
        self.estimation.sample(stamp_ns, force, moment, position)

    def motion(self, stamp_ns: int, reading: FootReadings) -> None:
        """Pass what a body estimator shows of the foot to the stages, in the order of its node."""
        self.estimation.wrench(stamp_ns, reading.force, None)
        self.estimation.position(stamp_ns, reading.position)
        variance = reading.variance
        self.estimation.contact_velocity(stamp_ns, *reading.velocity, variance, variance)

    def report(self, pressure: float) -> None:
        """Pass a pressure to the estimation."""
        if pressure == pressure:
            self.pressure = pressure
            self.estimation.pressure(pressure)

    def doubt(self, row: np.void) -> None:
        """Write the present doubt into the row of a record."""
        doubt = self.estimation.doubt
        if doubt is not None:
            row['doubt'] = DOUBTS.index(doubt.partition(':')[0])

    @property
    def fresh(self) -> bool:
        """Whether there is a new estimate."""
        return self._emission is not None

    def estimate(self, row: np.void) -> None:
        """Write an estimate, if there is a new one, into the row of a record."""
        emission, self._emission = self._emission, None
        self.doubt(row)
        if emission is None:
            return
        row['load'], row['wetness'] = emission.load, emission.estimate.wet_probability
        row['friction'] = emission.estimate.friction_mean
        if emission.position is not None:
            row['position'] = emission.position


def _ignore(error: InvalidInput) -> None:
    """Ignore a rejected sample: the stage reports repeated rejections as a doubt."""


class BodySensing:
    """Simulated IMU, joints and forces of the feet, and the sensing stage that they feed.

    Parameters
    ----------
    scene : Scene
    seed : int
        Seed of the noise.
    robot : FullRobot
        The simulated robot.
    emit_doubt : callable
        Called with the doubt of the body when its kind has changed.

    Attributes
    ----------
    stage : SensingStage
    estimate : BodyEstimate or None
        Estimate of the present sample; None if it has none.
    """

    def __init__(
        self, scene: Scene, seed: int, robot: FullRobot, emit_doubt: Callable[[str], None]
    ) -> None:
        self._robot = robot
        self._sensors = BodySensors(scene, seed, len(robot.joint_names))
        assert isinstance(scene.body, LeggedBody)
        model, values = scene.body.robot, body_settings_for(scene)
        self.stage = SensingStage(
            model, estimator_of(model, values), self._take, emit_doubt, _ignore, values['forces']
        )
        self.estimate: BodyEstimate | None = None

    def _take(self, stamp_ns: int, estimate: BodyEstimate) -> None:
        self.estimate = estimate

    def sample(self, stamp_ns: int) -> list[FootReadings]:
        """Measure and estimate; return what the estimate shows of each foot, or nothing."""
        self.estimate = None
        reading = self._sensors.read(self._robot.proprioception(), self._robot.time)
        for index, force in enumerate(reading.forces):
            self.stage.force(index, stamp_ns, force)
        if reading.imu:
            self.stage.imu(stamp_ns, *reading.imu)
        if reading.joints:
            self.stage.joints(stamp_ns, *reading.joints)
        return foot_readings(self.estimate) if self.estimate else []

    @property
    def odom(self) -> Vector:
        """Estimated position x and y, m, and heading, rad, of the body."""
        assert self.estimate
        x, y, _ = self.estimate.position.tolist()
        return x, y, heading(*self.estimate.orientation.tolist())


class ClosedLoop:
    """Run everything of a trial in one process, sample by sample.

    Parameters
    ----------
    scene : Scene
        Robot, floor, gait, sensors and faults.
    policy : str
        ``flat``, ``dome``, ``adaptive`` or ``oracle``.
    seed : int
        Seed of floor and noise, 0 or more.
    fidelity : str
        ``auto`` or a fidelity level.
    tuning : Tuning or None
        Tuning of the estimators; None takes that of
        :func:`ros_pad.trials.node_settings.tuning_for`.
    policy_parameters : mapping or None
        See :func:`ros_pad.control.policy_named`.
    sensing : str
        ``markers``, or ``joints``: IMU, joints and forces in the axes of the feet (L2 only).

    Attributes
    ----------
    body : BodySensing or None
        None with markers.
    estimators : list of FootEstimator
        One for each leg; see :meth:`connect`.
    controller : MorphologyController
    legs : list of LegStages
    pads : list of float
        True gauge pressures of the pads at the last control step, Pa.

    Raises
    ------
    InvalidInput
        For an unknown policy or parameter, or a seed that is not a whole number of at least 0.
    TransportError
        When a fault of the scene keeps a regulator from opening.
    """

    def __init__(
        self,
        scene: Scene,
        policy: str,
        seed: int,
        fidelity: str = 'auto',
        tuning: Tuning | None = None,
        policy_parameters: Mapping[str, Any] | None = None,
        sensing: str = 'markers',
    ) -> None:
        if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
            raise InvalidInput(f'seed = {seed!r} is not allowed: a whole number from 0 is needed')
        self.period_ns = round(1e9 / scene.sensors.rate)
        self.floor = scene.floor.build(seed)
        fidelity = levels.level(scene, fidelity, joints=sensing == 'joints')
        period = self.period_ns * 1e-9
        self.robot = levels.build(with_terms(scene), self.floor, period, fidelity)
        self.sensors = Sensors.of(scene, seed)
        self._stamp_ns = 0
        tuning = tuning or tuning_for(scene, sensing)
        self.body: BodySensing | None = None
        if sensing == 'joints':
            assert isinstance(self.robot, FullRobot)
            self.body = BodySensing(scene, seed, self.robot, self._doubt_body)
        estimators, _ = estimators_of(len(scene.legs), scene.foot, scene.expected_load, tuning)
        controller = MorphologyController(
            scene.foot,
            scene.legs,
            policy_named(policy, self.floor.wet, policy_parameters),
            scene.expected_load,
            start=first_morphologies(policy, scene.legs),
            fixed_pressure=scene.dome_pressure,
            command_timeout=SUPERVISION.command_timeout,
        )
        self._regulators = [simulated_regulator(scene, leg, self._clock) for leg in scene.legs]
        self._channels = [
            SupervisedChannel(leg, regulator, SUPERVISION)
            for leg, regulator in zip(scene.legs, self._regulators, strict=True)
        ]
        for channel in self._channels:
            try:
                channel.open()
            except TransportError as error:
                raise TransportError(
                    f'scene {scene.name!r}, leg {channel.leg}: {error}'
                ) from error
        self.supervision = Supervision(self._channels)
        self.supervision.activate(0)
        self.pads = [0.0] * len(scene.legs)
        self._tick_pace = Pace(TICK_PERIOD_NS)
        self.connect(estimators, controller)

    def connect(
        self,
        estimators: Sequence[FootEstimator] | None = None,
        controller: MorphologyController | None = None,
        period_ns: int = CONTROL_PERIOD_NS,
    ) -> None:
        """Build the stages of all legs, before the first :meth:`tick`.

        Parameters
        ----------
        estimators : sequence of FootEstimator or None
            One for each leg; None keeps the present ones.
        controller : MorphologyController or None
            None keeps the present one.
        period_ns : int
            Period of estimates, decisions and readings of the regulators, ns.
        """
        if estimators is not None:
            self.estimators = list(estimators)
        if controller is not None:
            self.controller = controller
        self._pace = Pace(period_ns)
        self._doubts: list[str | None] = []
        self.legs = [
            LegStages(channel.leg, estimator, period_ns)
            for channel, estimator in zip(self._channels, self.estimators, strict=True)
        ]
        self.decision = DecisionStage(self.controller, [leg.leg for leg in self.legs])

    def _clock(self) -> float:
        return self._stamp_ns * 1e-9

    def _doubt_body(self, doubt: str) -> None:
        for leg in self.legs:
            leg.estimation.body_doubt(doubt)

    @property
    def pressures(self) -> list[float]:
        """Gauge pressures that the regulators reported last, Pa."""
        return [leg.pressure for leg in self.legs]

    def tick(self, log: TrialLog) -> None:
        """Advance by one sample, and log it.

        First the robot moves, and each foot is estimated with the last reported pressure. At
        control steps the regulators then report. Where there are new estimates, the controller
        decides, and the regulators receive its set-points.
        """
        self._stamp_ns += self.period_ns
        now_ns, legs = self._stamp_ns, self.legs
        self.supervision.tick(now_ns)
        if self._tick_pace.due(now_ns):
            if self.body:
                self.body.stage.tick(now_ns)
            for leg in legs:
                leg.tick(now_ns)
            doubts = [leg.estimation.doubt for leg in legs]
            if doubts != self._doubts:
                rows = ESTIMATE.rows(len(legs))
                for leg, row in zip(legs, rows, strict=True):
                    leg.doubt(row)
                self.decision.decide(Block.of(now_ns, rows))
            self.decision.tick(now_ns)
            self._doubts = doubts
        self.robot.step(self.pads)
        self._measure(now_ns, log)
        if self._pace.due(now_ns):
            pressures = self.supervision.read(now_ns, now_ns)
            self.pads = pressures.rows[0]['pad'].tolist()
            self.decision.pressure(pressures)
            for leg, pressure in zip(legs, pressures.rows[0]['pressure'].tolist(), strict=True):
                leg.report(pressure)
        # Without markers the first estimate after a silence may come between control steps.
        if any(leg.fresh for leg in legs):
            rows = ESTIMATE.rows(len(legs))
            for leg, row in zip(legs, rows, strict=True):
                leg.estimate(row)
            commands = self.decision.decide(Block.of(now_ns, rows))
            self.supervision.command(commands, now_ns, now_ns)
            estimates = [each.estimate for each in self.estimators]
            log.control(now_ns * 1e-9, self.pressures, estimates, self.controller)

    def _measure(self, now_ns: int, log: TrialLog) -> None:
        """Read the sensors, pass what they measure to the legs, and log it."""
        if self.body:
            feet = self.body.sample(now_ns)
            if feet:
                for leg, foot in zip(self.legs, feet, strict=True):
                    leg.motion(now_ns, foot)
                felt = [(foot.force, foot.position) for foot in feet]
                log.sample(now_ns * 1e-9, self.robot.body, felt, self.body.odom)
            return
        readings = self.sensors.read(self.robot)
        moments = self.sensors.read_moments(self.robot)
        for leg, reading, moment in zip(self.legs, readings, moments, strict=True):
            leg.sample(now_ns, reading, moment)
        log.sample(now_ns * 1e-9, self.robot.body, readings)

    def close(self) -> None:
        """Vent and close the regulators."""
        self.supervision.close('the trial ends')


def run(
    scene: Scene | str | os.PathLike[str],
    policy: str | None = None,
    seed: int = 0,
    fidelity: str = 'auto',
    progress: Progress | None = None,
    tuning: Tuning | None = None,
    policy_parameters: Mapping[str, Any] | None = None,
    sensing: str = 'markers',
) -> Trial:
    """Run a trial without ROS.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, the name of a shipped scene, or the path of a YAML file.
    policy : str or None
        ``flat``, ``dome``, ``adaptive`` or ``oracle``; None takes the policy of the scene.
    seed : int
        Seed of floor and noise, 0 or more; the same seed gives the same trial.
    fidelity : str
        ``auto`` or a fidelity level.
    progress : callable or None
        Called now and then with the simulated time, s.
    tuning : Tuning or None
        Tuning of the estimators; None takes that for the scene's sensors.
    policy_parameters : mapping or None
        Parameters of :func:`ros_pad.control.adaptive`, by name.
    sensing : str
        ``markers``, or ``joints``: without markers, from IMU, joints and forces of the feet (L2).

    Returns
    -------
    Trial
        Time series and metrics.

    Raises
    ------
    ConfigError, InvalidInput
        When scene, policy, its parameters, seed or fidelity is not allowed.
    TransportError
        When a fault of the scene keeps a regulator from opening.

    Examples
    --------
    Domes push the leg of the thesis over wet ground; flat, it slips most of the way (see
    ``docs/model/rail_leg.md``):

    >>> from ros_pad.trials import run
    >>> for scene in ('leg_wet_flat', 'leg_wet_dome_75'):
    ...     f'{1e3 * run(scene).metrics.distance_per_cycle_m:.0f} mm in a cycle'
    '9 mm in a cycle'
    '45 mm in a cycle'
    """
    if not isinstance(scene, Scene):
        scene = Scene.load(scene)
    policy = scene.policy if policy is None else policy
    if tuning is not None:
        instance('tuning', tuning, Tuning)
    choice('sensing', sensing, SOURCES)
    level = levels.level(scene, fidelity, policy, sensing == 'joints')
    loop = ClosedLoop(scene, policy, seed, level, tuning, policy_parameters, sensing)
    log = TrialLog(scene, policy, seed, level, sensing)
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
    trial = log.finish(loop.robot, loop.controller, loop.floor, loop.robot.time / wall)
    trial.settings['learnt'] = settings_of(loop.estimators[0].ground.shared)
    return trial
