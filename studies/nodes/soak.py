# SPDX-License-Identifier: Apache-2.0
"""Run the regulator node for an hour with faults; count missed vents, measure growth of memory.

The regulator node runs in this process with simulated regulators, and receives commands for six
feet at 100 Hz of simulated time. Devices become silent, stick, leak, drift and lose their supply;
commands stop, of one foot or of all, have wrong stamps, are above the ceiling, negative or not
finite; ``~/vent`` is called; and every five minutes the node is cleaned up and configured again.
All events follow from a seed.

Devices record the commands that they receive. A pad whose commands have stopped, or whose pressure
is above the ceiling, must receive a vent within ``command_timeout`` and one tick. The node ticks
with each record and, 0.1 s after the last one, with each time on /clock. A device that did not
answer must receive another vent at each tick. After its pressure was above the ceiling, a pad must
receive no pressure until the node is activated again. The exit status is 1 if any of these rules
was broken.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
import pathlib
import random
import time
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np
import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from ros_pad import regulators
from ros_pad.bags.wire import Wire
from ros_pad.commands.progress import bar
from ros_pad.commands.run import alone
from ros_pad.nodes import topics
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.regulator import RegulatorNode
from ros_pad.nodes.stamps import set_stamp
from ros_pad.pace import TICK_PERIOD_NS
from ros_pad.records import COMMAND, Block
from ros_pad.regulators import Reading, SimulatedRegulator
from ros_pad.simulation.faults import Fault
from studies import command
from studies.machine import memory

HOUR = 3600.0
PERIOD = 0.01  # time between ticks, and between commands, s
ROUND = 300.0  # time between two configurations of the node, s
TIMEOUT = 0.3  # command_timeout, s
CEILING = 90e3  # Pa gauge
TOLERANCE = 0.02
START = 100.0  # simulated time at the start, s: the stamps of old commands stay positive
PATIENCE = 10.0  # s of wall time for one tick
LEGS = topics.LEGS
# Mean times, s: between faults of one leg's device, between losses of supply, between troubles of
# one leg's commands, and between calls of ~/vent.
FAULT_EVERY, SUPPLY_EVERY, TROUBLE_EVERY, VENT_EVERY = 60.0, 150.0, 15.0, 60.0
TROUBLES = ('stop', 'above', 'wrong')
"""Troubles of the commands of one leg."""

OF_ALL = ('stop', 'stale', 'future')
"""Troubles of whole records."""


class Device(SimulatedRegulator):
    """A simulated regulator that records its commands and their times, answered or not."""

    made: ClassVar[list[Device]] = []  # devices of the present round, in the order of legs
    # regulators.create finds the allowed options in the signature.
    __signature__ = inspect.signature(SimulatedRegulator)

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._time: Callable[[], float] = options['clock']
        self.vents = 0
        self.filled = False  # whether the last command that may have arrived was above 0
        self.over: float | None = None  # time when it exceeded the ceiling; None after the vent
        self.passed = False  # whether it exceeded the ceiling since the last activation
        self.disobeyed = 0  # number of pressures commanded after it exceeded the ceiling
        self.reactions: list[float] = []  # times from exceeding the ceiling to the vent, s
        Device.made.append(self)

    def set_pressure(self, gauge_pa: float) -> None:
        """Command a pressure."""
        if gauge_pa > 0.0:
            self.filled = True
            self.disobeyed += self.passed
        super().set_pressure(gauge_pa)
        self.filled = gauge_pa > 0.0

    def vent(self) -> None:
        """Command zero gauge pressure."""
        self.vents += 1
        if self.over is not None:
            self.reactions.append(self._time() - self.over)
            self.over = None
        super().vent()

    def read(self) -> Reading:
        """Return pad pressure and set-point."""
        reading = super().read()
        if reading.pressure > CEILING * (1.0 + TOLERANCE) and not self.passed:
            self.over = self._time()
            self.passed = True
        return reading


@dataclasses.dataclass
class Result:
    """Result of a soak.

    Attributes
    ----------
    simulated, wall : float
        Simulated time, and time that the run took, s.
    set_points, refused, faults, stops, passes, calls : int
        Numbers of set-points sent and refused, of faults of devices, of times that commands
        stopped or were all refused for longer than the timeout, of times that a pad exceeded the
        ceiling, and of calls of ``~/vent``.
    missed : int
        Vents that a device did not receive in time, and pressures that it received although it
        had exceeded the ceiling.
    reaction, ceiling_reaction : float
        Longest time from the last valid command, and from exceeding the ceiling, to the vent, s.
    growth : float
        Growth of resident memory over the last three quarters, MB an hour of simulated time.
    memory : float
        Resident memory at the end, MB.
    threads : tuple of int
        Number of threads after the first sixtieth of the run, and at the end.
    """

    simulated: float = 0.0
    wall: float = 0.0
    set_points: int = 0
    refused: int = 0
    faults: int = 0
    stops: int = 0
    passes: int = 0
    calls: int = 0
    missed: int = 0
    reaction: float = 0.0
    ceiling_reaction: float = 0.0
    growth: float = 0.0
    memory: float = 0.0
    threads: tuple[int, int] = (0, 0)


class Trouble:
    """Disturbances of commands at random times."""

    def __init__(self, chance: random.Random, kinds: Sequence[str]) -> None:
        self._chance, self._kinds = chance, kinds
        self._until = START + chance.expovariate(1.0 / TROUBLE_EVERY)
        self.kind = ''

    def at(self, now: float) -> str:
        """Return the present one at a time, s, which never goes back; empty if there is none."""
        if now >= self._until:
            self.kind = '' if self.kind else self._chance.choice(self._kinds)
            mean = 1.0 if self.kind else TROUBLE_EVERY
            self._until = now + self._chance.expovariate(1.0 / mean)
        return self.kind


class Commander:
    """Commands of one leg: dome and flat in turn, with disturbances."""

    def __init__(self, chance: random.Random) -> None:
        self._chance = chance
        self._gauge, self._until = 0.0, START
        self._trouble = Trouble(chance, TROUBLES)
        self.good: float | None = None  # time of the last valid command since the activation, s
        self.stopped = False  # whether the pad has received a vent since that command

    def next(self, now: float) -> float:
        """Return the set-point at a time, s, Pa gauge; NaN if there is none."""
        chance = self._chance
        if now >= self._until:
            self._gauge = 0.0 if self._gauge else chance.uniform(0.4, 1.0) * CEILING
            self._until = now + chance.uniform(0.3, 1.5)
        match self._trouble.at(now):
            case 'stop':
                return math.nan
            case 'above':
                return CEILING + 1.0 + chance.random() * 1e6
            case 'wrong':
                return chance.choice((math.inf, -math.inf, -1.0))
        return self._gauge

    @property
    def obeyed(self) -> bool:
        """Whether the present commands are valid, so that the node accepts them."""
        return not self._trouble.kind


def drawn_faults(chance: random.Random, start: float, end: float) -> list[Fault]:
    """Return random faults of the devices between two times, s."""
    faults = []

    def draw(every: float, make: Callable[[float, float], Fault]) -> None:
        at = start + chance.expovariate(1.0 / every)
        while at < end:
            last = at + 0.05 + chance.expovariate(1.0 / 2.0)
            faults.append(make(round(at, 3), round(last, 3)))
            at = last + chance.expovariate(1.0 / every)

    for leg in LEGS:

        def one(start: float, end: float, leg: int = leg) -> Fault:
            kind = chance.choice(('silence', 'stuck_valve', 'leak', 'sensor_drift'))
            extra = {
                'leak': {'conductance': 10.0 ** chance.uniform(-10.0, -7.5)},
                'sensor_drift': {'offset': chance.uniform(-10e3, 60e3)},
            }
            return Fault(kind, start, end, (leg,), **extra.get(kind, {}))

        draw(FAULT_EVERY, one)
    draw(SUPPLY_EVERY, lambda start, end: Fault('supply_loss', start, end, time_constant=0.5))
    return faults


class Soak:
    """The node, the commanders of its legs, and the counts of the run."""

    def __init__(self, context: rclpy.Context, seed: int) -> None:
        self.result = Result()
        self._chance = random.Random(seed)
        self._executor = EventsExecutor(context=context)
        self._robot = Node('robot', context=context, start_parameter_services=False)
        # backend_options.faults is set here only to declare it; each round sets its own faults.
        overrides = {
            'use_sim_time': True, 'autostart': False, 'ceiling': CEILING,
            'command_timeout': TIMEOUT, 'ceiling_tolerance': TOLERANCE,
            'backend_options.faults': ["{kind: silence, start: 0.0, end: 1.0e-9}"],
        }  # fmt: skip
        self.node = RegulatorNode(
            context=context,
            parameter_overrides=[Parameter(key, value=value) for key, value in overrides.items()],
        )
        set_logger_level(self.node.get_logger().name, LoggingSeverity.FATAL)
        for node in (self._robot, self.node):
            self._executor.add_node(node)
        self._clock = topics.CLOCK.publisher(self._robot)
        self._clock_message = topics.CLOCK.message()
        self._output, self._wire = topics.COMMAND.publisher(self._robot), Wire(COMMAND, LEGS)
        Messages(self._robot).receive_record(topics.PRESSURE, LEGS, self._receive)
        self._answered_ns = 0  # stamp of the last pressures
        self._record_ns = 0  # stamp of the last record that the node processed
        self._trouble = Trouble(random.Random(seed + 1), OF_ALL)
        self._vent_client = self._robot.create_client(Trigger, 'regulator/vent')
        self._commanders = [Commander(random.Random(seed + 100 * leg)) for leg in LEGS]
        self._ticks = round(START / PERIOD)
        self._round_until = START
        self._vent_at = START + self._chance.expovariate(1.0 / VENT_EVERY)
        self._active = False
        self._spin(self._connected, 'the node')
        self._ticked = True  # whether the node did in this period
        self._show(self._ticks * round(PERIOD * 1e9))

    def _connected(self) -> bool:
        outputs = self.node.count_subscribers(topics.PRESSURE.name())
        clocks = self._clock.get_subscription_count() == 2  # for the node's time and its ticks
        matched = outputs and self._output.get_subscription_count()
        return bool(matched and clocks and self._vent_client.service_is_ready())

    def _receive(self, block: Block) -> None:
        self._answered_ns = block.last_ns

    def _spin(self, done: Callable[[], bool], what: str) -> None:
        deadline = time.monotonic() + PATIENCE
        while not done():
            self._executor.spin_once(timeout_sec=0.1)
            if time.monotonic() > deadline:
                raise TimeoutError(f'timed out after {PATIENCE:g} s waiting for {what}')

    def _begin_round(self, now: float) -> None:
        """Configure the node with new devices and with the faults of the next round."""
        faults = drawn_faults(self._chance, now + 0.1, now + ROUND)
        self.result.faults += len(faults)
        texts = [str(each) for each in faults] or ['{kind: silence, start: 0.0, end: 1.0e-9}']
        (done,) = self.node.set_parameters([Parameter('backend_options.faults', value=texts)])
        assert done.successful, done.reason
        Device.made.clear()
        self.node.trigger_configure()
        assert len(Device.made) == len(LEGS), 'the node did not configure a device for each leg'
        self._round_until = now + ROUND
        self._activate()

    def _activate(self) -> None:
        for device in Device.made:
            device.passed = False
        self.node.trigger_activate()
        self._active = True

    def _end_round(self) -> None:
        if self._active:
            self.node.trigger_deactivate()
        self._deactivated()
        self.node.trigger_cleanup()

    def _deactivated(self) -> None:
        self._active = False
        for commander in self._commanders:
            commander.good = None

    def _call_vent(self) -> None:
        """Call ``~/vent``: each device must receive a vent before the response."""
        self.result.calls += 1
        before = [each.vents for each in Device.made]
        future = self._vent_client.call_async(Trigger.Request())
        self._spin(future.done, 'the response of ~/vent')
        after = [each.vents for each in Device.made]
        self.result.missed += sum(b <= a for a, b in zip(before, after, strict=True))
        self._deactivated()

    def _show(self, now_ns: int) -> None:
        """Publish a time on /clock, and wait until it is the node's time.

        Where no records come, wait also until the node has done the tick of this time.
        """
        set_stamp(self._clock_message.clock, now_ns)
        self._clock.publish(self._clock_message)
        ticks = not self._active or abs(now_ns - self._record_ns) > TICK_PERIOD_NS
        self._ticked = ticks
        self._spin(
            lambda: (
                self.node.messages.now_ns() == now_ns
                and (not ticks or self.node.tick_ns == now_ns)
            ),
            f'the time of the node, {now_ns} ns',
        )

    def _send(self, now_ns: int) -> int:
        """Send the commands of a time, ns, and wait for the answer; return their number."""
        now, kind, age = now_ns * 1e-9, self._trouble.at(now_ns * 1e-9), 0.0
        setpoints = [each.next(now) for each in self._commanders]
        if kind == 'stop':
            return 0
        if kind:
            age = TIMEOUT + 0.01 + self._chance.random()
            age = -age - 0.01 if kind == 'future' else age
        rows = COMMAND.rows(len(LEGS))
        rows['setpoint'] = setpoints
        stamp_ns = now_ns - round(age * 1e9)
        self._output.publish(self._wire.encode(Block.of(stamp_ns, rows)))
        if self._active:
            self._spin(lambda: self._answered_ns == stamp_ns, 'the answer to a command')
            self._ticked = True
            if not kind:
                self._record_ns = now_ns
                for commander in self._commanders:
                    if commander.obeyed:
                        commander.good, commander.stopped = now, False
        return int(np.count_nonzero(~np.isnan(rows['setpoint'])))

    def tick(self) -> None:
        """Advance the clock, send the commands that are due, and count vents."""
        self._ticks += 1
        now_ns = self._ticks * round(PERIOD * 1e9)
        now = now_ns * 1e-9
        if now >= self._round_until:
            if self._active or Device.made:
                self._end_round()
            self._begin_round(now)
        if now >= self._vent_at:
            if self._active:
                self._call_vent()
                self._vent_at = now + 0.5
            else:
                self._activate()
                self._vent_at = now + self._chance.expovariate(1.0 / VENT_EVERY)
        vents = [each.vents for each in Device.made]
        before = self._refused
        if self._active:
            self._show(now_ns)
        self.result.set_points += self._send(now_ns)
        if not self._active:  # no answer tells when the record has come, but the tick after it
            self._show(now_ns)
        self.result.refused += self._refused - before
        for commander, device, count in zip(self._commanders, Device.made, vents, strict=True):
            self._judge(commander, device, now, device.vents > count)

    @property
    def _refused(self) -> int:
        return sum(each.answers.refused for each in self.node.channels.values())

    def _judge(self, commander: Commander, device: Device, now: float, vented: bool) -> None:
        """Count what a device did against the rules at this tick, and its reaction times."""
        result = self.result
        late = TIMEOUT + PERIOD + 1e-6
        overdue = self._ticked and (commander.good is None or now - commander.good > late)
        if overdue and device.filled and not vented:
            result.missed += 1
        if device.over is not None and now - device.over > late:
            result.missed += 1
        result.missed += device.disobeyed
        device.disobeyed = 0
        result.passes += len(device.reactions)
        result.ceiling_reaction = max(result.ceiling_reaction, *device.reactions, 0.0)
        device.reactions.clear()
        if (
            vented
            and commander.good is not None
            and now > commander.good
            and not commander.stopped
        ):
            commander.stopped = True
            result.stops += 1
            result.reaction = max(result.reaction, now - commander.good)

    def close(self) -> None:
        """Destroy the node; each device must then have received a vent."""
        before = [each.vents for each in Device.made]
        devices = list(Device.made)
        self._executor.remove_node(self.node)
        self.node.destroy_node()
        self.result.missed += sum(
            device.vents <= count for device, count in zip(devices, before, strict=True)
        )
        self._executor.remove_node(self._robot)
        self._robot.destroy_node()
        self._executor.shutdown()


def threads() -> int:
    """Return the number of threads of this process, including those of the middleware."""
    return len(list(pathlib.Path('/proc/self/task').iterdir()))


def run(duration: float = HOUR, seed: int = 0) -> Result:
    """Run the node for a simulated time, s, of at least one tick; return the result."""
    context = rclpy.Context()
    rclpy.init(context=context, args=[])
    before = regulators.BACKENDS['simulated']
    regulators.BACKENDS['simulated'] = Device
    sizes: list[tuple[float, float]] = []
    started = time.perf_counter()
    try:
        soak = Soak(context, seed)
        result = soak.result
        count = round(duration / PERIOD)
        sample = max(1, count // 60)
        try:
            with bar('soak', duration) as reach:
                for tick in range(1, count + 1):
                    soak.tick()
                    if tick % sample == 0:
                        sizes.append((tick * PERIOD, memory()))
                        if len(sizes) == 1:
                            result.threads = (threads(), 0)
                        reach(tick * PERIOD)
            result.threads = (result.threads[0], threads())
        finally:
            soak.close()
    finally:
        regulators.BACKENDS['simulated'] = before
        Device.made.clear()
        rclpy.shutdown(context=context)
    result.simulated, result.wall = duration, time.perf_counter() - started
    times, late = np.array(sizes[len(sizes) // 4 :]).T
    result.growth = float(np.polyfit(times, late, 1)[0]) * HOUR
    result.memory = float(late[-1])
    return result


def table(result: Result, seed: int) -> str:
    """Return the result as text."""
    first, last = result.threads
    return (
        f'{result.simulated:.0f} s simulated in {result.wall:.0f} s, seed {seed}\n'
        f'{result.set_points} set-points, {result.refused} refused; {result.faults} faults of'
        f' devices, {result.calls} calls of ~/vent\n'
        f'missed vents: {result.missed}\n'
        f'commands stopped {result.stops} times: vented after {result.reaction:.3f} s at the'
        f' latest, command_timeout is {TIMEOUT:g} s\n'
        f'ceiling passed {result.passes} times: vented after {result.ceiling_reaction:.3f} s at'
        ' the latest\n'
        f'memory: {result.memory:.1f} MB, {result.growth:+.2f} MB an hour; threads: {first},'
        f' then {last}'
    )


def main(words: Sequence[str]) -> int:
    """Run the node, and print the result; return the exit status."""
    parser = command.parser('soak', __doc__)
    parser.add_argument(
        '--duration', type=float, default=HOUR, help='simulated time, s (default: 3600)'
    )
    command.add_count(parser, '--seed', 0, 'seed of faults and commands', least=0)
    options = parser.parse_args(words)
    with alone():
        result = run(options.duration, options.seed)
    command.show(options, dataclasses.asdict(result), table(result, options.seed))
    return 1 if result.missed else 0
