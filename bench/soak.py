# SPDX-License-Identifier: Apache-2.0
"""Soak the regulator node in hours of commands and faults: it must miss no vent, and not grow.

``python bench/soak.py`` sends set-points at 100 Hz to six feet for an hour of simulated time, on
the real node with simulated regulators, in this process. Devices fall silent, stick, leak, drift
and lose their supply; commands stop, come with wrong stamps, above the ceiling, or are no numbers;
``~/vent`` is called; and every five minutes the node is cleaned up and configured anew. All of it
follows from a seed.

At each tick the devices are asked, not the node: a pad whose commands have stopped, or whose
pressure has passed the ceiling, must have been told to vent after ``command_timeout`` and one tick
at the latest, and a device that did not answer must be told again at each tick. What does not
happen is a missed vent, and the exit status is then 1.
"""

from __future__ import annotations

import argparse
import dataclasses
import inspect
import json
import math
import os
import pathlib
import random
import sys
import time
from collections.abc import Callable
from typing import Any
from typing import ClassVar

import numpy as np
import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.logging import LoggingSeverity
from rclpy.logging import set_logger_level
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from tqdm import tqdm

from ros_pad import regulators
from ros_pad.nodes import topics
from ros_pad.nodes.regulator import RegulatorNode
from ros_pad.nodes.stamps import set_stamp
from ros_pad.regulators import Reading
from ros_pad.regulators import SimulatedRegulator
from ros_pad.simulation.faults import Fault

HOUR = 3600.0
PERIOD = 0.01  # of ticks and of commands, s
ROUND = 300.0  # from one configuration of the node to the next, s
TIMEOUT = 0.3  # command_timeout, s
CEILING = 90e3  # Pa gauge
TOLERANCE = 0.02
AMBIENT = 101325.0
START = 100.0  # s: stamps can be older than that
PATIENCE = 10.0  # s of wall time for one tick
LEGS = topics.LEGS
# Mean time between two troubles of one kind, s, of a leg or of all.
FAULT_EVERY, SUPPLY_EVERY, TROUBLE_EVERY, VENT_EVERY = 60.0, 150.0, 15.0, 60.0
TROUBLES = ('stop', 'stale', 'future', 'above', 'nan')


class Device(SimulatedRegulator):
    """A simulated regulator that remembers what it was told and when, answered or not."""

    made: ClassVar[list[Device]] = []  # of the present round, by leg
    __signature__ = inspect.signature(SimulatedRegulator)  # options are looked up there

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._time: Callable[[], float] = options['clock']
        self.vents = 0
        self.filled = False  # the last order that may have arrived was a pressure
        self.over: float | None = None  # since when it reads too much, and no vent has come
        self.passed = False  # the ceiling, since the last activation
        self.disobeyed = 0  # pressures that were sent all the same
        self.reactions: list[float] = []  # from passing the ceiling to the vent, s
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
    """What a soak found.

    Attributes
    ----------
    simulated, wall : float
        s.
    set_points, refused, faults, stops, passes, calls : int
        Set-points sent and refused, faults of devices, times that commands stopped or were all
        refused for longer than the timeout, times a pad passed the ceiling, and calls of
        ``~/vent``.
    missed : int
        Vents that did not come in time.
    reaction, ceiling_reaction : float
        Longest time from the last good command, and from passing the ceiling, to the vent, s.
    growth : float
        Of resident memory over the last three quarters, MB an hour of simulated time.
    memory : float
        Resident at the end, MB.
    threads : tuple of int
        After the first minute, and at the end.
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


class Commander:
    """The commands of one leg: domes and flats, with troubles now and then."""

    def __init__(self, chance: random.Random) -> None:
        self._chance = chance
        self._gauge, self._until = 0.0, START
        self._trouble, self._trouble_until = '', START + chance.expovariate(1.0 / TROUBLE_EVERY)
        self.good: float | None = None  # time of the last good command since the activation
        self.stopped = False  # and a vent has come since

    def next(self, now: float) -> tuple[float, float] | None:
        """Return gauge pressure, Pa, and age of the stamp, s, of the command at a time."""
        chance = self._chance
        if now >= self._until:
            self._gauge = 0.0 if self._gauge else chance.uniform(0.4, 1.0) * CEILING
            self._until = now + chance.uniform(0.3, 1.5)
        if now >= self._trouble_until:
            self._trouble = '' if self._trouble else chance.choice(TROUBLES)
            mean = 1.0 if self._trouble else TROUBLE_EVERY
            self._trouble_until = now + chance.expovariate(1.0 / mean)
        match self._trouble:
            case 'stop':
                return None
            case 'stale':
                return self._gauge, TIMEOUT + 0.01 + chance.random()
            case 'future':
                return self._gauge, -TIMEOUT - 0.02 - chance.random()
            case 'above':
                return CEILING + 1.0 + chance.random() * 1e6, 0.0
            case 'nan':
                return chance.choice((math.nan, math.inf, -math.inf, -1.0)), 0.0
        return self._gauge, 0.0

    @property
    def obeyed(self) -> bool:
        """Whether the present commands are such as a node may take."""
        return not self._trouble


def drawn_faults(chance: random.Random, start: float, end: float) -> list[Fault]:
    """Return what the devices suffer from one time to another, s."""
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
    """The node, its commanders, and the judge of both."""

    def __init__(self, context: rclpy.Context, seed: int) -> None:
        self.result = Result()
        self._chance = random.Random(seed)
        self._executor = EventsExecutor(context=context)
        self._robot = Node('robot', context=context, start_parameter_services=False)
        # Given, so that it is declared; each round brings its own.
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
        self._message = topics.PRESSURE_SETPOINT.message()
        self._publishers = [topics.PRESSURE_SETPOINT.publisher(self._robot, leg) for leg in LEGS]
        self._vent_client = self._robot.create_client(Trigger, 'regulator/vent')
        self._commanders = [Commander(random.Random(seed + 100 * leg)) for leg in LEGS]
        self._ticks = round(START / PERIOD)
        self._last_ns = 0
        self._round_until = START
        self._vent_at = START + self._chance.expovariate(1.0 / VENT_EVERY)
        self._active = False
        self._spin(self._connected, 'the node')
        self._show(self._ticks * round(PERIOD * 1e9))

    def _connected(self) -> bool:
        heard = all(each.get_subscription_count() for each in self._publishers)
        clocks = self._clock.get_subscription_count() == 2  # the node's own, and its ticks
        return heard and clocks and self._vent_client.service_is_ready()

    def _spin(self, done: Callable[[], bool], what: str) -> None:
        deadline = time.monotonic() + PATIENCE
        while not done():
            self._executor.spin_once(timeout_sec=0.1)
            if time.monotonic() > deadline:
                raise TimeoutError(f'waited {PATIENCE:g} s in vain for {what}')

    def _begin_round(self, now: float) -> None:
        """Configure the node with new devices and the faults of the next minutes."""
        faults = drawn_faults(self._chance, now + 0.1, now + ROUND)
        self.result.faults += len(faults)
        texts = [str(each) for each in faults] or ['{kind: silence, start: 0.0, end: 1.0e-9}']
        (done,) = self.node.set_parameters([Parameter('backend_options.faults', value=texts)])
        assert done.successful, done.reason
        Device.made.clear()
        self.node.trigger_configure()
        assert len(Device.made) == len(LEGS), 'configuring failed'
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
        """Call ``~/vent``: each device must be told before the answer comes."""
        self.result.calls += 1
        before = [each.vents for each in Device.made]
        future = self._vent_client.call_async(Trigger.Request())
        self._spin(future.done, 'the answer of ~/vent')
        told = [each.vents for each in Device.made]
        self.result.missed += sum(b <= a for a, b in zip(before, told, strict=True))
        self._deactivated()

    def _show(self, now_ns: int) -> None:
        """Let time go on."""
        set_stamp(self._clock_message.clock, now_ns)
        self._clock.publish(self._clock_message)
        self._spin(lambda: self.node._now_ns == now_ns, f'the node to come to {now_ns} ns')
        self._last_ns = now_ns

    def tick(self) -> None:
        """Send what is due, let time go on, and judge."""
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
        node, message = self.node, self._message
        vents = [each.vents for each in Device.made]
        refusals = sum(each.refusals for each in node.channels.values())
        answered, sent = node.answered, 0
        for commander, publisher in zip(self._commanders, self._publishers, strict=True):
            command = commander.next(now)
            if command is None:
                continue
            gauge, age = command
            message.fluid_pressure = gauge + AMBIENT
            # As a controller that acted on the last tick.
            set_stamp(message.header.stamp, self._last_ns - round(age * 1e9))
            publisher.publish(message)
            sent += 1
            if self._active and commander.obeyed:
                commander.good, commander.stopped = now, False
        if self._active:
            self._spin(lambda: node.answered >= answered + sent, 'set-points to be answered')
        self._show(now_ns)
        self.result.set_points += sent
        self.result.refused += sum(each.refusals for each in node.channels.values()) - refusals
        for commander, device, before in zip(self._commanders, Device.made, vents, strict=True):
            self._judge(commander, device, now, device.vents > before)

    def _judge(self, commander: Commander, device: Device, now: float, told: bool) -> None:
        """Count what a device was not told in time at this tick."""
        result = self.result
        late = TIMEOUT + PERIOD + 1e-6
        overdue = commander.good is None or now - commander.good > late
        if overdue and device.filled and not told:
            result.missed += 1
        if device.over is not None and now - device.over > late:
            result.missed += 1
        result.missed += device.disobeyed
        device.disobeyed = 0
        result.passes += len(device.reactions)
        result.ceiling_reaction = max(result.ceiling_reaction, *device.reactions, 0.0)
        device.reactions.clear()
        if told and commander.good is not None and now > commander.good and not commander.stopped:
            commander.stopped = True
            result.stops += 1
            result.reaction = max(result.reaction, now - commander.good)

    def close(self) -> None:
        """End the node; each device must be told to vent."""
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


def resident() -> float:
    """Return the resident memory of this process, MB."""
    pages = int(pathlib.Path('/proc/self/statm').read_text().split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE') / 1e6


def threads() -> int:
    """Return the number of threads of this process, those of the middleware too."""
    return len(list(pathlib.Path('/proc/self/task').iterdir()))


def run(duration: float = HOUR, seed: int = 0) -> Result:
    """Soak the node for a simulated time, s; return what was found."""
    context = rclpy.Context()
    rclpy.init(context=context, args=[])
    before = regulators.BACKENDS['simulated']
    regulators.BACKENDS['simulated'] = Device
    memory: list[tuple[float, float]] = []
    started = time.perf_counter()
    try:
        soak = Soak(context, seed)
        result = soak.result
        count = round(duration / PERIOD)
        sample = max(1, count // 60)
        bar = tqdm(total=round(duration), unit='s', desc='simulated', file=sys.stderr)
        try:
            for tick in range(1, count + 1):
                soak.tick()
                if tick % sample == 0:
                    memory.append((tick * PERIOD, resident()))
                    if len(memory) == 1:
                        result.threads = (threads(), 0)
                    bar.update(round(tick * PERIOD) - bar.n)
            result.threads = (result.threads[0], threads())
        finally:
            bar.close()
            soak.close()
    finally:
        regulators.BACKENDS['simulated'] = before
        Device.made.clear()
        rclpy.shutdown(context=context)
    result.simulated, result.wall = duration, time.perf_counter() - started
    times, sizes = np.array(memory[len(memory) // 4 :]).T
    result.growth = float(np.polyfit(times, sizes, 1)[0]) * HOUR
    result.memory = float(sizes[-1])
    return result


def main() -> int:
    """Soak, and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--duration', type=float, default=HOUR, help='simulated time, s')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    chosen = parser.parse_args()
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'OFF'  # no regulator out there is to hear this
    result = run(chosen.duration, chosen.seed)
    if chosen.json:
        print(json.dumps(dataclasses.asdict(result)))
    else:
        first, last = result.threads
        print(
            f'{result.simulated:.0f} s simulated in {result.wall:.0f} s, seed {chosen.seed}\n'
            f'{result.set_points} set-points, {result.refused} refused; {result.faults} faults of'
            f' devices, {result.calls} calls of ~/vent\n'
            f'missed vents: {result.missed}\n'
            f'commands stopped {result.stops} times: told to vent after {result.reaction:.3f} s at'
            f' the latest, command_timeout is {TIMEOUT:g} s\n'
            f'ceiling passed {result.passes} times: told to vent after'
            f' {result.ceiling_reaction:.3f} s at the latest\n'
            f'memory: {result.memory:.1f} MB, {result.growth:+.2f} MB an hour; threads: {first},'
            f' then {last}'
        )
    return 1 if result.missed else 0


if __name__ == '__main__':
    sys.exit(main())
