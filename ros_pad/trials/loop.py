# SPDX-License-Identifier: Apache-2.0
"""The closed loop of a trial without ROS: a robot, the pipeline, and supervised regulators.

The loop only passes records between them, in the same order as the composed nodes.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Generator, Mapping
from contextlib import closing
from typing import Any

import numpy as np

from ros_pad.configuration import choice, instance, integer
from ros_pad.contact.resistance import Foot
from ros_pad.control import MorphologyController, first_morphologies, policy_named
from ros_pad.control.stage import DecisionStage
from ros_pad.errors import TransportError
from ros_pad.estimation import Tuning
from ros_pad.estimation.stage import EstimationStage
from ros_pad.estimation.tuning import SOURCES
from ros_pad.pace import CONTROL_PERIOD_NS, TICK_PERIOD_NS, Pace, Progress
from ros_pad.pipeline import Pipeline
from ros_pad.regulators import Regulator, create
from ros_pad.regulators.channel import DEFAULTS as SUPERVISION
from ros_pad.regulators.channel import SupervisedChannel
from ros_pad.regulators.supervision import Supervision
from ros_pad.sensing import BodyEstimate, SensingStage
from ros_pad.sensing.stage import estimator_of, sample_of
from ros_pad.simulation import fidelity as levels
from ros_pad.simulation.faults import faults_of
from ros_pad.simulation.full_robot import FullRobot
from ros_pad.simulation.scene import LeggedBody, Scene
from ros_pad.simulation.sensors import BodySensors, Sensors
from ros_pad.simulation.terms import with_terms
from ros_pad.trials.bag_notes import settings
from ros_pad.trials.learnt import settings_of
from ros_pad.trials.log import TrialLog
from ros_pad.trials.metrics import summarise
from ros_pad.trials.node_settings import body_settings_for, tuning_for
from ros_pad.trials.series import trial_of
from ros_pad.trials.trial import Trial, heading


class BodySensing:
    """Simulated IMU, joints and forces of the feet, and the sensing stage that they feed.

    Parameters
    ----------
    scene : Scene
    seed : int
        Seed of the noise.
    robot : FullRobot
        The simulated robot.

    Attributes
    ----------
    stage : SensingStage
    odom : tuple of float
        Estimated position x and y, m, and heading, rad, of the body; NaN before the first.
    estimate : BodyEstimate or None
        Estimate of the last sample, if there was one.
    """

    def __init__(self, scene: Scene, seed: int, robot: FullRobot) -> None:
        assert isinstance(scene.body, LeggedBody)
        self._robot, self._sensors = robot, BodySensors(scene, seed, len(robot.joint_names))
        model, values = scene.body.robot, body_settings_for(scene)
        self.stage = SensingStage(
            model, estimator_of(model, values), self._take, lambda doubt: None,
            lambda error: None,  # the stage reports repeated rejections as a doubt
            values['forces'],
        )  # fmt: skip
        self.estimate: BodyEstimate | None = None
        self.odom = (math.nan, math.nan, math.nan)

    def _take(self, stamp_ns: int, estimate: BodyEstimate) -> None:
        self.estimate = estimate
        x, y, _ = estimate.position.tolist()
        self.odom = x, y, heading(*estimate.orientation.tolist())

    def sample(self, stamp_ns: int) -> np.ndarray | None:
        """Measure and estimate; return rows of a sample, or None if there is no estimate."""
        self.estimate = None
        reading = self._sensors.read(self._robot.proprioception(), self._robot.time)
        for index, force in enumerate(reading.rows['force']):
            self.stage.force(index, stamp_ns, force)
        # A silent sensor reads nothing.
        if math.isfinite(reading.imu[0, 0]):
            self.stage.imu(stamp_ns, *reading.imu)
        if math.isfinite(reading.joints[0, 0]):
            self.stage.joints(stamp_ns, *reading.joints)
        return sample_of(self.estimate) if self.estimate else None


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
    pipeline : Pipeline
        Estimation and decision; see :meth:`connect`.
    supervision : Supervision
    log : TrialLog
        Records until now.
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
        choice('sensing', sensing, SOURCES)
        level = levels.level(scene, fidelity, policy, sensing == 'joints')
        self._scene, self._tuning = scene, tuning or tuning_for(scene, sensing)
        self._about: dict[str, Any] = {
            'policy': policy,
            'seed': integer('seed', seed),
            'fidelity': level,
        }
        self.log = TrialLog(len(scene.legs))
        self.period_ns = round(1e9 / scene.sensors.rate)
        self.floor = scene.floor.build(seed)
        self.robot = levels.build(with_terms(scene), self.floor, self.period_ns * 1e-9, level)
        self.sensors = Sensors(scene, seed)
        self._stamp_ns = 0
        self.body: BodySensing | None = None
        if sensing == 'joints':
            assert isinstance(self.robot, FullRobot)
            self.body = BodySensing(scene, seed, self.robot)
        channels = [
            SupervisedChannel(leg, self._regulator(scene, leg), SUPERVISION) for leg in scene.legs
        ]
        for channel in channels:
            try:
                channel.open()
            except TransportError as error:
                raise TransportError(
                    f'scene {scene.name!r}, leg {channel.leg}: {error}'
                ) from error
        self.supervision = Supervision(channels)
        self.supervision.activate(0)
        self.pads = [0.0] * len(scene.legs)
        self._tick_pace = Pace(TICK_PERIOD_NS)
        self.connect(
            MorphologyController(
                scene.foot,
                scene.legs,
                policy_named(policy, self.floor.wet, policy_parameters),
                scene.expected_load,
                start=first_morphologies(policy, scene.legs),
                fixed_pressure=scene.dome_pressure,
                command_timeout=SUPERVISION.command_timeout,
            )
        )

    def _regulator(self, scene: Scene, leg: int) -> Regulator:
        """Return the simulated regulator of a foot, with the faults of its leg."""
        return create(
            'simulated',
            clock=lambda: self._stamp_ns * 1e-9,
            ceiling=scene.foot.ceiling,
            pad_volume=scene.foot.air_volume,
            faults=faults_of(leg, scene.faults),
            **scene.regulator,
        )

    def connect(
        self,
        controller: MorphologyController,
        foot: Foot | None = None,
        period_ns: int = CONTROL_PERIOD_NS,
    ) -> None:
        """Build the stages of estimation and decision, before the first :meth:`tick`.

        Parameters
        ----------
        controller : MorphologyController
            Decides for all legs.
        foot : Foot or None
            What the estimator takes the feet to be; None: what they are.
        period_ns : int
            Period of estimates, decisions and readings of the regulators, ns.
        """
        scene, self._pace = self._scene, Pace(period_ns)
        estimation = EstimationStage(
            foot or scene.foot, scene.expected_load, self._tuning, scene.legs, period_ns
        )
        self.pipeline = Pipeline(estimation, DecisionStage(controller, scene.legs))

    @property
    def controller(self) -> MorphologyController:
        """What decides for all legs."""
        return self.pipeline.decision.controller

    def tick(self) -> None:
        """Advance by one sample; at control moments, process the samples since the last one."""
        self._stamp_ns += self.period_ns
        self.robot.step(self.pads)
        if self.body:
            rows, odom = self.body.sample(self._stamp_ns), self.body.odom
        else:
            rows, odom = self.sensors.sample(self.robot), (math.nan,) * 3
        self.log.sample(self._stamp_ns, rows, self.robot.body, odom)
        if self._pace.due(self._stamp_ns):
            self._process()

    def _process(self) -> None:
        """Process the samples since the last control moment."""
        now_ns = self._stamp_ns
        self.supervision.tick(now_ns)
        if self._tick_pace.due(now_ns):
            if self.body:
                self.body.stage.tick(now_ns)
            self.pipeline.tick(now_ns)
        for estimate, command in self.pipeline.process(self.log.take(now_ns)):
            pressure = self.supervision.read(now_ns, now_ns)
            self.supervision.command(command, now_ns, now_ns)
            self.pipeline.pressure(pressure)
            self.pads = pressure.rows[0]['pad'].tolist()
            self.log.control(estimate, command, pressure)

    def walk(self) -> Generator[None, None, None]:
        """Yield after each sample, until the scene ends or a verdict ends it; close the loop."""
        try:
            for _ in range(round(self._scene.duration * 1e9) // self.period_ns):
                self.tick()
                yield
                if self.robot.verdict:
                    break
        finally:
            self.close()

    def trial(self, real_time_factor: float | None = None) -> Trial:
        """Return the trial until now, with its series, settings and metrics."""
        scene, (body, odom) = self._scene, self.log.poses
        sensing = 'joints' if self.body else 'markers'
        trial = trial_of(
            self.log.records,
            scene.legs,
            body,
            odom if self.body else None,
            **self._about,
            scene=scene.name,
            floor=self.floor,
            settings=settings(scene, self._about['policy'], self._about['fidelity'], sensing),
            real_time_factor=real_time_factor,
        )
        trial.metrics = summarise(scene, trial, self.robot, self.controller)
        trial.settings['learnt'] = settings_of(self.pipeline.estimation.model.shared)
        return trial

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
    '48 mm in a cycle'
    """
    if not isinstance(scene, Scene):
        scene = Scene.load(scene)
    policy = scene.policy if policy is None else policy
    if tuning is not None:
        instance('tuning', tuning, Tuning)
    loop = ClosedLoop(scene, policy, seed, fidelity, tuning, policy_parameters, sensing)
    started = time.perf_counter()
    with closing(loop.walk()) as samples:
        for sample, _ in enumerate(samples):
            if progress and sample % 250 == 0:
                progress(loop.robot.time)
    return loop.trial(loop.robot.time / (time.perf_counter() - started))
