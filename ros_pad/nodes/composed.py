# SPDX-License-Identifier: Apache-2.0
"""A whole trial on the real nodes, composed in one process, in lock-step on ``/clock``.

The simulator takes a step, and only when every node has answered to it does it take the next. All
nodes publish from one thread, which is the condition under which rclpy's EventsExecutor is safe;
it hands messages over in the order they were published, several times faster than the others.
"""

from __future__ import annotations

import copy
import gc
import json
import os
import signal
import threading
import time
from collections.abc import Callable
from collections.abc import Iterator
from contextlib import contextmanager
from contextlib import suppress
from functools import partial
from typing import Any

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from ros_pad.errors import PadError
from ros_pad.nodes.controller import ControllerNode
from ros_pad.nodes.estimator import EstimatorNode
from ros_pad.nodes.parameters import BACKEND_OPTIONS
from ros_pad.nodes.parameters import values_of
from ros_pad.nodes.recorder import RecorderNode
from ros_pad.nodes.regulator import RegulatorNode
from ros_pad.nodes.simulator import SimulatorNode
from ros_pad.pace import Pace
from ros_pad.simulation import fidelity as ladder
from ros_pad.simulation.scene import Scene
from ros_pad.trials import recorded
from ros_pad.trials.bag import annotate
from ros_pad.trials.label import PARAMETERS
from ros_pad.trials.label import label
from ros_pad.trials.loop import CONTROL_PERIOD_NS
from ros_pad.trials.loop import Progress
from ros_pad.trials.loop import tuning_for
from ros_pad.trials.metrics import summarise
from ros_pad.trials.trial import DOME_PRESSURE
from ros_pad.trials.trial import Trial

_PATIENCE = 10.0  # s of wall time for one step
_VENTING = 5.0  # s of simulated time for the pads to empty


class ComposedTrial:
    """Five nodes of one trial, and the lock-step between them.

    Parameters
    ----------
    scene : Scene
        As loaded from ``scene.source``, which the nodes load again.
    policy : str
        ``flat``, ``dome``, ``adaptive`` or ``oracle``.
    seed : int
        Of floor and noise.
    bag : path
        Folder of the bag to write; must not exist.
    context : rclpy.Context
        Initialised context that the nodes live in.
    fidelity : str
        ``auto`` or a rung of the ladder.

    Attributes
    ----------
    walked : MorphologyController
        The controller as it was at the end of the walk; there only then.
    """

    def __init__(
        self,
        scene: Scene,
        policy: str,
        seed: int,
        bag: str | os.PathLike[str],
        context: rclpy.Context,
        fidelity: str = 'auto',
    ) -> None:
        self.scene = scene
        self.stopped = False
        self._executor = EventsExecutor(context=context)
        self._nodes: list[Node] = []
        self._pace = Pace(CONTROL_PERIOD_NS)
        legs = list(scene.legs)
        tuning = tuning_for(scene)
        rate = 1e9 / CONTROL_PERIOD_NS
        feet = {'legs': legs, 'foot': scene.foot.source}
        felt = feet | {'expected_load': scene.expected_load}
        ground = {'scene': scene.source, 'seed': seed}

        def add(kind: Callable[..., Any], **parameters: Any) -> Any:
            overrides = [Parameter(key, value=value) for key, value in parameters.items()]
            # Services that nobody calls here would only slow the run.
            node = kind(
                context=context,
                parameter_overrides=overrides,
                start_parameter_services=False,
                enable_rosout=False,
            )
            self._nodes.append(node)
            self._executor.add_node(node)
            return node

        try:
            self.recorder = add(
                partial(RecorderNode, label(scene, policy, seed, fidelity)),
                use_sim_time=True,
                legs=legs,
                folder=os.fspath(bag),
            )
            self.regulator = add(
                RegulatorNode,
                use_sim_time=True,
                ceiling=scene.foot.ceiling,
                publish_rate=rate,
                **feet,
                # And not by its name: this scene may be another than that of its file.
                **{
                    f'{BACKEND_OPTIONS}.{key}': value
                    for key, value in scene.regulator_options.items()
                },
            )
            self.estimator = add(
                EstimatorNode,
                use_sim_time=True,
                position_noise=tuning.position_noise,
                force_noise=tuning.force_noise,
                moment_noise=tuning.moment_noise,
                publish_rate=rate,
                **felt,
            )
            self.controller = add(
                ControllerNode,
                use_sim_time=True,
                policy=policy,
                dome_pressure=scene.dome_pressure or 0.0,
                **felt,
                **(ground if policy == 'oracle' else {}),
            )
            self.simulator = add(
                SimulatorNode,
                foot=scene.foot.source,
                fidelity=fidelity,
                publish_clock=True,
                free_running=False,
                **ground,
            )
            said = {each.get_fully_qualified_name(): values_of(each) for each in self._nodes}
            self.recorder.describe({PARAMETERS: json.dumps(said)})
            # The executor takes in new nodes as it spins: messages that come before would be
            # handed over in another order.
            self._executor.spin_once(timeout_sec=0.01)
            self._spin(self._connected, 'the nodes to find one another')
        except BaseException:
            self.close()
            raise

    def _connected(self) -> bool:
        """Whether every publisher and subscription here has found its counterparts here."""
        publishers = [publisher for node in self._nodes for publisher in node.publishers]
        subscriptions = [each for node in self._nodes for each in node.subscriptions]
        for publisher in publishers:
            name = publisher.topic_name
            heard_by = [each for each in subscriptions if each.topic_name == name]
            if publisher.get_subscription_count() < len(heard_by):
                return False
            spoken_by = [each for each in publishers if each.topic_name == name]
            if any(each.get_publisher_count() < len(spoken_by) for each in heard_by):
                return False
        return True

    def step(self) -> None:
        """Advance by one sample, and wait until every node has dealt with it."""
        answered = self.regulator.answered
        self.simulator.step()
        now_ns = self.simulator.time_ns
        legs = len(self.scene.legs)
        samples = now_ns // self.simulator.period_ns * legs
        control = self._pace.due(now_ns)
        controller, estimator = self.controller, self.estimator

        def settled() -> bool:
            # The cheapest question first: this is asked after every message.
            if controller.wrenches < samples or estimator.samples < samples:
                return False
            return not control or (
                self.regulator.answered == answered + legs and self._reported(now_ns)
            )

        self._spin(settled, f'the nodes to answer to {now_ns * 1e-9:.3f} s')
        if control and self.scene.faults:
            # Messages carry what devices say; a robot stands on what is in its pads.
            self.simulator.pressures[:] = [
                channel.regulator.pad_pressure for channel in self.regulator.channels.values()
            ]

    def _reported(self, now_ns: int) -> bool:
        """Whether each pressure of this moment has come back, or its device did not answer."""
        return all(
            now_ns in (stamp, channel.unread_ns)
            for stamp, channel in zip(
                self.simulator.pressure_stamps, self.regulator.channels.values(), strict=True
            )
        )

    def _spin(self, done: Callable[[], bool], what: str) -> None:
        deadline = time.monotonic() + _PATIENCE
        while not done():
            self._executor.spin_once(timeout_sec=0.1)
            if time.monotonic() > deadline:
                raise PadError(f'waited {_PATIENCE:g} s in vain for {what}')

    def walk(self, progress: Progress | None = None) -> None:
        """Walk the scene to its end, or until ``stopped`` is set; then vent the pads."""
        samples = round(self.scene.duration * 1e9) // self.simulator.period_ns
        try:
            for sample in range(samples):
                self.step()
                if progress and sample % 25 == 0:
                    progress(self.simulator.robot.time)
                if self.simulator.robot.verdict or self.stopped:
                    break
            # While the pads are vented it hears of no feet, and takes note of that.
            self.walked = copy.deepcopy(self.controller.controller)
        except BaseException:
            with suppress(PadError):  # what went wrong first is what is told
                self._vent()
            raise
        self._vent()

    def _vent(self) -> None:
        """Deactivate the regulators, and let time pass until the pads are flat."""
        self.regulator.trigger_deactivate()
        simulator, channels = self.simulator, self.regulator.channels.values()
        for _ in range(round(_VENTING * 1e9) // simulator.period_ns):
            simulator.tick()
            if self._pace.due(simulator.time_ns):
                self._spin(lambda: self._reported(simulator.time_ns), 'pads to vent')
                if all(channel.pressure < DOME_PRESSURE for channel in channels):
                    return
        if not self.scene.faults:  # which may well keep a pad from being vented
            raise PadError(f'pads still hold pressure {_VENTING:g} s after they were told to vent')

    def close(self) -> None:
        """Let the recorder catch up, and close bag and nodes."""
        recorder = getattr(self, 'recorder', None)
        try:
            if recorder is not None:
                count = -1
                while recorder.message_count > count:
                    count = recorder.message_count
                    for _ in range(200):
                        self._executor.spin_once(timeout_sec=0.001)
                recorder.close()
        finally:  # nodes that stay behind would go on talking to others
            for node in self._nodes:
                self._executor.remove_node(node)
                node.destroy_node()
            self._executor.shutdown()


@contextmanager
def _interruptible(trial: ComposedTrial) -> Iterator[None]:
    """Turn the first Ctrl-C or SIGTERM into an orderly end; the second one is not waited for."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)}

    def stop(number: int, frame: Any) -> None:
        trial.stopped = True
        signal.signal(number, before[signal.Signals(number)])

    for number in before:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def run(
    scene: Scene | str | os.PathLike[str],
    policy: str | None = None,
    seed: int = 0,
    fidelity: str = 'auto',
    *,
    bag: str | os.PathLike[str],
    progress: Progress | None = None,
) -> Trial:
    """Run a trial on ROS 2 nodes and record it.

    Parameters
    ----------
    scene, policy, seed, fidelity, progress
        As for :func:`ros_pad.trials.run`.
    bag : path
        Folder of the bag; must not exist.

    Returns
    -------
    Trial
        As read back from the bag; ``interrupted`` in its settings says whether it was cut short.

    Raises
    ------
    BagError
        When the folder exists or cannot be written.
    ConfigError, InvalidInput
        Naming what is wrong with scene, policy or fidelity.
    """
    if not isinstance(scene, Scene):
        scene = Scene.load(scene)
    policy = policy or scene.policy
    rung = ladder.rung(scene, fidelity, policy)
    context = rclpy.Context()
    # Signals are ours: rclpy's handlers would cut the nodes off before the pads are vented.
    try:
        rclpy.init(context=context, args=[], signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise PadError(f'ROS 2 does not start: {error}') from error
    try:
        trial = ComposedTrial(scene, policy, seed, bag, context, rung)
        started = time.perf_counter()
        try:
            with _interruptible(trial):
                trial.walk(progress)
        except BaseException:
            with suppress(PadError):  # a bag on a full disk cannot be closed either
                trial.close()
            raise
        wall = time.perf_counter() - started
        trial.close()
    finally:
        rclpy.shutdown(context=context)
    robot, floor = trial.simulator.robot, trial.simulator.floor
    walked, stopped = trial.walked, trial.stopped
    # Lifecycle nodes hold themselves, and stay on the graph until they are collected.
    del trial
    gc.collect()
    annotate(bag, label(scene, policy, seed, rung, interrupted=stopped))
    result = recorded.load(bag)
    result.floor = floor
    result.metrics = summarise(scene, result, robot, walked)
    result.real_time_factor = robot.time / wall
    annotate(
        bag,
        label(
            scene,
            policy,
            seed,
            rung,
            interrupted=stopped,
            metrics=result.metrics,
            real_time_factor=result.real_time_factor,
        ),
    )
    return result
