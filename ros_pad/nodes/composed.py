# SPDX-License-Identifier: Apache-2.0
"""Run a whole trial on the real nodes, in one process, in lock-step.

Messages alone keep the step: samples become estimates, commands and pressures, and the simulator
goes on when the pressure record that answers its last samples has come. rclpy's EventsExecutor is
used, which is several times faster than others; it is safe only because all nodes publish from one
thread.
"""

from __future__ import annotations

import copy
import gc
import os
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from ros_pad.contact.pad import DOME_PRESSURE
from ros_pad.errors import PadError
from ros_pad.estimation import Tuning
from ros_pad.nodes.body_estimator import BodyEstimatorNode
from ros_pad.nodes.controller import ControllerNode
from ros_pad.nodes.estimator import EstimatorNode
from ros_pad.nodes.parameters import BACKEND_OPTIONS
from ros_pad.nodes.recorder import RecorderNode
from ros_pad.nodes.regulator import RegulatorNode
from ros_pad.nodes.simulator import SimulatorNode
from ros_pad.pace import CONTROL_PERIOD_NS, Progress
from ros_pad.signals import STOP
from ros_pad.simulation import fidelity as levels
from ros_pad.simulation.scene import LeggedBody, Scene
from ros_pad.trials import recorded
from ros_pad.trials.bag_notes import label, note
from ros_pad.trials.learnt import settings_of
from ros_pad.trials.metrics import summarise
from ros_pad.trials.node_settings import body_settings_for, tuning_for
from ros_pad.trials.trial import Trial

PATIENCE = 30.0
"""Longest wall time for one step, s."""

_VENTING = 5.0  # longest simulated time for the pads to vent, s


class ComposedTrial:
    """Run the nodes of one trial in lock-step: five, and a body estimator without markers.

    Parameters
    ----------
    scene : Scene
        Loaded from ``scene.source``, which the simulator and the policy oracle load again.
    policy : str
        ``flat``, ``dome``, ``adaptive`` or ``oracle``.
    seed : int
        Seed of the floor and of the sensor noise.
    bag : path
        Folder of the bag to write; must not exist.
    context : rclpy.Context
        Initialised context of the nodes.
    fidelity : str
        ``auto`` or a fidelity level.
    sensing : str
        ``markers`` or ``joints``.
    tuning : Tuning or None
        Tuning of the estimators; None takes that for the scene's sensors.

    Attributes
    ----------
    scene : Scene
        As given.
    stopped : bool
        Set it to True to end the walk early.
    executor : EventsExecutor
        Runs the nodes.
    recorder, regulator, body_estimator, estimator, controller, simulator : rclpy.node.Node
        The nodes; the body estimator is None with markers.
    walked : MorphologyController
        Copy of the controller at the end of the walk; not set before.

    Raises
    ------
    PadError
        When a node cannot be made, or the nodes do not discover one another within ``PATIENCE``.
    """

    def __init__(
        self,
        scene: Scene,
        policy: str,
        seed: int,
        bag: str | os.PathLike[str],
        context: rclpy.Context,
        fidelity: str = 'auto',
        sensing: str = 'markers',
        tuning: Tuning | None = None,
    ) -> None:
        self.scene = scene
        self.stopped = False
        self._context = context
        self.executor = EventsExecutor(context=context)
        self._nodes: list[Node] = []
        foot, tuning = scene.foot.source, tuning or tuning_for(scene, sensing)
        ground = {'scene': scene.source, 'seed': seed}
        timed = {'use_sim_time': True, 'legs': list(scene.legs)}
        loaded = timed | {'foot': foot, 'expected_load': scene.expected_load}
        try:
            # The recorder is the first node; the last one, the simulator, starts the trial.
            about = label(scene, policy, seed, fidelity, sensing)
            self.recorder = self._add(partial(RecorderNode, about), folder=os.fspath(bag), **timed)
            # The node gets the options of the scene, not its name, because the scene in memory may
            # differ from its file.
            options = scene.regulator_options.items()
            own = {f'{BACKEND_OPTIONS}.{key}': value for key, value in options}
            own['ceiling'] = scene.foot.ceiling
            self.regulator = self._add(RegulatorNode, foot=foot, **timed, **own)
            self.body_estimator = None
            if sensing == 'joints':
                assert isinstance(scene.body, LeggedBody)
                model = scene.body.robot
                # The soles of simulated robots are on ankles.
                own = {'robot': model.source, 'foot_radius': 0.0} | body_settings_for(scene)
                if model.source.endswith('.urdf'):
                    own['feet'] = ','.join(map(str, model.legs))
                self.body_estimator = self._add(BodyEstimatorNode, **timed, **own)
            self.estimator = self._add(EstimatorNode, **tuning.values, **loaded)
            own = {'policy': policy, 'dome_pressure': scene.dome_pressure or 0.0}
            own |= ground if policy == 'oracle' else {}
            self.controller = self._add(ControllerNode, **own, **loaded)
            own = {'fidelity': fidelity, 'sensing': sensing, 'publish_clock': True, 'foot': foot}
            self.simulator = self._add(partial(SimulatorNode, False), **own, **ground)
            # The executor adds nodes only while it spins; messages that were published before
            # that would arrive in another order.
            self.executor.spin_once(timeout_sec=0.01)
            self._discover()
        except BaseException:
            self.close()
            raise

    def _add(self, kind: Callable[..., Any], **parameters: Any) -> Any:
        """Make a node with these parameters and hand it to the executor."""
        # Services that nothing calls here would only slow the run.
        node = kind(
            context=self._context,
            parameter_overrides=[Parameter(key, value=each) for key, each in parameters.items()],
            start_parameter_services=False,
            enable_rosout=False,
        )
        self._nodes.append(node)
        self.executor.add_node(node)
        return node

    def _discover(self) -> None:
        deadline = time.monotonic() + PATIENCE
        while not self._connected():
            self.executor.spin_once(timeout_sec=0.01)
            if time.monotonic() > deadline:
                raise PadError(
                    f'the nodes have not discovered one another within {PATIENCE:g} s: pad'
                    ' doctor finds the cause'
                )

    def _connected(self) -> bool:
        """Return whether every publisher and subscription here has found its counterparts."""
        publishers = [each for node in self._nodes for each in node.publishers]
        subscriptions = [each for node in self._nodes for each in node.subscriptions]
        sources = Counter(each.topic_name for each in publishers)
        sinks = Counter(each.topic_name for each in subscriptions)
        return all(
            each.get_subscription_count() >= sinks[each.topic_name] for each in publishers
        ) and all(each.get_publisher_count() >= sources[each.topic_name] for each in subscriptions)

    def _lock_step(self, step: Callable[[], bool], what: str) -> None:
        """Call a function, and again whenever its step was answered, until there is no answer.

        It returns whether its step will be answered.

        Raises
        ------
        PadError
            When an answer takes more than ``PATIENCE``.
        """
        simulator, done = self.simulator, Future()

        def go_on() -> None:
            try:
                if not step():
                    done.set_result(None)
            except BaseException as error:  # the executor would end with a traceback
                done.set_exception(error)

        simulator.answered = go_on
        go_on()
        while not done.done():
            before_ns = simulator.time_ns
            self.executor.spin_until_future_complete(done, timeout_sec=PATIENCE)
            if not done.done() and simulator.time_ns == before_ns:
                raise PadError(
                    f'waited more than {PATIENCE:g} s of wall time for {what} at'
                    f' {simulator.time_ns * 1e-9:.3f} s: pad doctor checks ROS 2'
                )
        simulator.answered = lambda: None
        done.result()

    def walk(self, progress: Progress | None = None) -> None:
        """Walk the scene to its end, to a verdict or until ``stopped`` is set; then vent the pads.

        Parameters
        ----------
        progress : callable, optional
            Called with the simulated time, s.

        Raises
        ------
        PadError
            When the nodes do not answer within ``PATIENCE``, or the pads do not vent.
        """
        simulator = self.simulator
        end_ns = round(self.scene.duration * 1e9) // simulator.period_ns * simulator.period_ns

        def step() -> bool:
            # The first records are awaited: a bag without them would tell of no legs.
            stopped = self.stopped and simulator.time_ns > 0
            if simulator.time_ns >= end_ns or simulator.robot.verdict or stopped:
                return False
            if progress:
                progress(simulator.robot.time)
            return simulator.step(end_ns)

        try:
            self._lock_step(step, 'the pressures that answer the samples')
            # While the pads vent, the controller receives no samples and would report faults.
            self.walked = copy.deepcopy(self.controller.controller)
        except BaseException:
            with suppress(PadError):  # the first error is the cause of the later ones
                self._vent()
            raise
        self._vent()

    def _vent(self) -> None:
        """Deactivate the regulator node, and advance time until the pads are flat."""
        self.regulator.trigger_deactivate()
        simulator, channels = self.simulator, self.regulator.supervision.channels
        samples = max(1, CONTROL_PERIOD_NS // simulator.period_ns)
        end_ns = simulator.time_ns + round(_VENTING * 1e9)

        def step() -> bool:
            flat = all(channel.pressure < DOME_PRESSURE for channel in channels)
            if flat or simulator.time_ns >= end_ns:
                return False
            simulator.tick(samples)
            return True

        self._lock_step(step, 'pressures of venting pads')
        if simulator.time_ns >= end_ns and not self.scene.faults:  # a fault may keep one filled
            raise PadError(
                f'at least one pad is not vented (below {DOME_PRESSURE:g} Pa gauge) {_VENTING:g} s'
                ' of simulated time after the command'
            )

    def close(self) -> None:
        """Close bag and nodes."""
        try:
            if hasattr(self, 'recorder'):
                self.recorder.close()
        finally:  # open nodes would continue to publish
            for node in self._nodes:
                self.executor.remove_node(node)
                node.destroy_node()
            self.executor.shutdown()


def run(
    scene: Scene | str | os.PathLike[str],
    policy: str | None = None,
    seed: int = 0,
    fidelity: str = 'auto',
    *,
    bag: str | os.PathLike[str],
    progress: Progress | None = None,
    sensing: str = 'markers',
    tuning: Tuning | None = None,
) -> Trial:
    """Run a trial on ROS 2 nodes and record it.

    Parameters
    ----------
    scene, policy, seed, fidelity, progress, sensing, tuning
        As for :func:`ros_pad.trials.run`.
    bag : path
        Folder of the bag; must not exist.

    Returns
    -------
    Trial
        As read from the bag; ``interrupted`` in its settings is whether it was stopped early.

    Raises
    ------
    BagError
        When the folder exists or cannot be written.
    ConfigError, InvalidInput
        When scene, policy or fidelity is not allowed.
    PadError
        When ROS 2 does not start, the nodes do not answer in time, or the pads do not vent.
    """
    if not isinstance(scene, Scene):
        scene = Scene.load(scene)
    policy = policy or scene.policy
    level = levels.level(scene, fidelity, policy, sensing == 'joints')
    context = rclpy.Context()
    try:
        # rclpy's own signal handlers would stop the nodes before the pads are vented.
        rclpy.init(context=context, args=[], signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise PadError(f'ROS 2 does not start: {error}: pad doctor finds the cause') from error
    try:
        with STOP.during():  # no signal leaves half a trial
            trial = ComposedTrial(scene, policy, seed, bag, context, level, sensing, tuning)
            started = time.perf_counter()
            try:
                # The first Ctrl-C or SIGTERM stops the walk; further ones disturb nothing.
                with STOP.during(partial(setattr, trial, 'stopped', True)):
                    trial.walk(progress)
                wall = time.perf_counter() - started
            except BaseException:
                with suppress(PadError):  # a bag on a full disk cannot be closed either
                    trial.close()
                raise
            trial.close()
    finally:
        context.try_shutdown()
    robot, floor = trial.simulator.robot, trial.simulator.floor
    controller, shared = trial.walked, trial.estimator.stage.model.shared
    stopped = trial.stopped
    # Reference cycles keep lifecycle nodes on the graph until garbage collection.
    del trial
    gc.collect()
    result = recorded.load(bag)
    result.floor = floor
    result.metrics = summarise(scene, result, robot, controller)
    result.real_time_factor = robot.time / wall
    result.settings |= {'learnt': settings_of(shared), 'interrupted': stopped}
    note(bag, result)
    return result
