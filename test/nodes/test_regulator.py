# SPDX-License-Identifier: Apache-2.0
import dataclasses
import math

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import State
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from lifecycle_msgs.srv import GetState
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import FluidPressure
from std_srvs.srv import Trigger

from ros_pad.errors import ConfigError
from ros_pad.errors import TransportError
from ros_pad.nodes import regulator as module
from ros_pad.nodes import topics
from ros_pad.nodes.regulator import RegulatorNode
from ros_pad.nodes.stamps import nanoseconds
from ros_pad.nodes.stamps import set_stamp
from ros_pad.regulators import BACKENDS
from ros_pad.regulators import Reading
from ros_pad.regulators.protocol import permitted

AMBIENT = 101325.0
MS = 1_000_000


class Robot:
    """The rest of the robot: it has the clock, sends set-points, and hears what comes back."""

    def __init__(self, context, executor, until):
        self.node = Node('robot', context=context)
        executor.add_node(self.node)
        self._context = context
        self._executor = executor
        self.until = until
        self.time_ns = 0
        self.regulator = None
        self._clock = topics.CLOCK.publisher(self.node)
        self._setpoints = {
            leg: topics.PRESSURE_SETPOINT.publisher(self.node, leg) for leg in (1, 2)
        }
        self.pressures = {1: [], 2: []}
        self.diagnostics = []
        for leg in (1, 2):
            topics.PRESSURE.subscription(self.node, self.pressures[leg].append, leg)
        topics.DIAGNOSTICS.subscription(self.node, self.diagnostics.append)

    def start(self, simulated=True, **parameters):
        parameters = {'legs': [1, 2], 'use_sim_time': simulated, **parameters}
        self.regulator = RegulatorNode(
            context=self._context,
            parameter_overrides=[Parameter(name, value=v) for name, v in parameters.items()],
        )
        self._executor.add_node(self.regulator)
        self.until(
            lambda: (
                all(p.get_subscription_count() for p in self._setpoints.values())
                # The node's own clock, and its ticks.
                and (not simulated or self._clock.get_subscription_count() == 2)
                and self.node.count_publishers('leg_2/pressure')
            ),
            what='the regulator node',
        )
        return self.regulator

    def tick(self, seconds=0.01):
        """Let time go on in steps of 10 ms; each is waited for."""
        for _ in range(round(seconds / 0.01)):
            self.time_ns += 10 * MS
            message = topics.CLOCK.message()
            set_stamp(message.clock, self.time_ns)
            self._clock.publish(message)
            self.until(
                lambda: (
                    self.regulator.get_clock().now().nanoseconds == self.time_ns
                    and self.regulator._now_ns == self.time_ns
                )
            )

    def send(self, gauge, leg=1, age=0.0, stamp_ns=None, ambient=AMBIENT):
        """Send a set-point and wait until the node has dealt with it."""
        answered = self.regulator.answered
        message = FluidPressure(fluid_pressure=gauge + ambient)
        now_ns = self.time_ns if stamp_ns is None else stamp_ns
        set_stamp(message.header.stamp, now_ns - round(age * 1e9))
        self._setpoints[leg].publish(message)
        self.until(lambda: self.regulator.answered > answered, what='an answer')

    def hold(self, gauge, seconds, leg=1):
        """Command a pressure as a controller does, every 20 ms."""
        for _ in range(round(seconds / 0.02)):
            self.send(gauge, leg)
            self.tick(0.02)

    def gauge(self, leg=1):
        """What the regulator says now."""
        return self.regulator.channels[leg].regulator.read().pressure

    def status(self, leg=1):
        """What the next message on /diagnostics says of a leg; it comes within a second."""
        count, start_ns = len(self.diagnostics), self.time_ns
        while self.time_ns <= start_ns + 1000 * MS and len(self.diagnostics) == count:
            self.tick()
        self.until(lambda: len(self.diagnostics) > count, what='/diagnostics')
        (status,) = [s for s in self.diagnostics[-1].status if f'leg {leg} ' in s.name]
        return status

    def call(self, service, name, request):
        client = self.node.create_client(service, name)
        self.until(client.service_is_ready, what=name)
        future = client.call_async(request)
        self.until(future.done, what=name)
        return future.result()

    def transit(self, number):
        request = ChangeState.Request(transition=Transition(id=number))
        return self.call(ChangeState, 'regulator/change_state', request).success

    def state(self):
        answer = self.call(GetState, 'regulator/get_state', GetState.Request())
        return answer.current_state.id


@pytest.fixture
def robot(context, executor, until):
    return Robot(context, executor, until)


class Device:
    """A device on a cable that may break, and that outlives the node."""

    made = ()

    def __init__(self, ceiling, port='usb'):
        self.ceiling = ceiling
        self.port = port
        self.setpoint = 40e3  # left over from whoever used it last
        self.is_open = False
        self.broken = None
        Device.made = (*Device.made, self)

    def open(self):
        if self.port == 'none':
            raise TransportError("no such port: 'none'")
        self.is_open = True

    def set_pressure(self, gauge_pa):
        self.setpoint = permitted(gauge_pa, self.ceiling)  # the command arrives, even if
        self._talk()  # the answer does not

    def read(self):
        self._talk()
        return Reading(self.setpoint, self.setpoint, (), 0.0)

    def vent(self):
        self._talk()
        self.setpoint = 0.0

    def close(self):
        self.is_open = False

    def _talk(self):
        assert self.is_open
        if self.broken:
            raise self.broken


@pytest.fixture
def devices(monkeypatch):
    """Make ``device`` a backend; return a function that returns those made, by leg."""
    monkeypatch.setitem(BACKENDS, 'device', Device)
    table = [
        dataclasses.replace(each, choices=('device',)) if each.name == 'backend' else each
        for each in module.PARAMETERS
    ]
    monkeypatch.setattr(module, 'PARAMETERS', table)
    monkeypatch.setattr(Device, 'made', ())
    return lambda: Device.made


def test_a_setpoint_becomes_the_pressure_of_its_pad_alone(robot):
    robot.start()
    robot.hold(60e3, 1.0)
    assert robot.gauge(1) == pytest.approx(60e3, abs=500.0)  # dead band, 0.5 % of full scale
    assert robot.gauge(2) == 0.0
    last = robot.pressures[1][-1]
    assert last.header.frame_id == 'leg_1_pad'
    assert last.fluid_pressure == pytest.approx(AMBIENT + 60e3, abs=500.0)
    assert robot.pressures[2][-1].fluid_pressure == AMBIENT


def test_pressures_come_at_their_rate(robot):
    robot.start(publish_rate=20.0)
    robot.tick(2.0)
    robot.until(lambda: len(robot.pressures[1]) > 40)
    stamps = [nanoseconds(message.header.stamp) for message in robot.pressures[1]]
    assert stamps == [10 * MS, *(k * 50 * MS for k in range(1, 41))]


def test_ambient_pressure_is_a_parameter(robot):
    robot.start(ambient_pressure=85000.0)
    robot.hold(60e3, 0.1)  # 101325 + 60000 Pa absolute is 76325 Pa gauge up there
    assert robot.regulator.channels[1].regulator.read().setpoint == 76325.0


def test_the_ceiling_itself_is_allowed_whatever_the_weather(robot):
    ambient = 83210.7
    assert (ambient + 70e3) - ambient > 70e3  # floating point
    robot.start(ambient_pressure=ambient, ceiling=70e3)
    robot.send(70e3, ambient=ambient)
    assert robot.regulator.channels[1].commands == 1


REFUSED = {
    'stale': ({'gauge': 50e3, 'age': 0.51}, 'set-point is 0.510 s old: at most 0.5 s'),
    'future': ({'gauge': 50e3, 'age': -0.51}, 'set-point is -0.510 s old: at most 0.5 s'),
    'no stamp': ({'gauge': 50e3, 'stamp_ns': 0}, 'set-point is 2.000 s old'),
    'nan': ({'gauge': math.nan}, 'set-point nan Pa is not allowed: 0 to 80000 Pa gauge'),
    'inf': ({'gauge': math.inf}, 'set-point inf Pa is not allowed: 0 to 80000 Pa gauge'),
    'minus inf': ({'gauge': -math.inf}, 'set-point -inf Pa is not allowed: 0 to 80000 Pa gauge'),
    'negative': ({'gauge': -1.0}, 'set-point -1.0 Pa is not allowed: 0 to 80000 Pa gauge'),
    'gauge sent as absolute': ({'gauge': 50e3 - AMBIENT}, 'set-point -51325.0 Pa is not allowed'),
    'above the ceiling': ({'gauge': 80001.0}, 'set-point 80001 Pa is above the ceiling of 80000'),
    'huge': ({'gauge': 1e12}, 'set-point 1e+12 Pa is above the ceiling of 80000'),
}


@pytest.mark.parametrize('case', REFUSED)
def test_a_bad_setpoint_is_refused_and_told_of(robot, case):
    setpoint, message = REFUSED[case]
    robot.start(ceiling=80e3)
    robot.tick(1.4)
    robot.hold(30e3, 0.6)
    robot.send(**setpoint)
    channel = robot.regulator.channels[1]
    assert (channel.commands, channel.refusals) == (30, 1)
    robot.hold(30e3, 0.4)
    assert robot.gauge() == pytest.approx(30e3, abs=500.0)
    assert robot.status(2).level == DiagnosticStatus.STALE
    refused_ns = 2000 * MS
    told = [
        (nanoseconds(array.header.stamp), status)
        for array in robot.diagnostics
        for status in array.status
        if 'leg 1 ' in status.name and status.level == DiagnosticStatus.WARN
    ]
    assert [(refused_ns <= at <= refused_ns + 1000 * MS) for at, _ in told] == [True]
    (_, status) = told[0]
    assert status.message.startswith(message)
    assert {each.key: each.value for each in status.values}['set-points refused'] == '1'
    assert max(m.fluid_pressure for m in robot.pressures[1]) <= AMBIENT + 30.5e3


def test_pressure_stays_below_the_ceiling(robot):
    """Full steps up and down, at the ceiling, above it, and in anger: sensors show whole 10 Pa."""
    robot.start(ceiling=80e3)
    for gauge in (80e3, 0.0, 80e3, 95e3, 80e3, 20e3, 80e3):
        robot.hold(gauge, 0.4)
    assert len(robot.pressures[1]) > 100
    highest = max(message.fluid_pressure for message in robot.pressures[1]) - AMBIENT
    # A damping ratio of 0.9 overshoots by exp(-pi 0.9/sqrt(1 - 0.81)) = 0.15 % of a step.
    assert 79e3 < highest <= 80e3 * 1.0016


def test_good_setpoints_after_a_bad_one_are_taken(robot):
    robot.start()
    robot.tick()
    robot.send(math.nan)
    robot.send(50e3)
    assert robot.regulator.channels[1].regulator.read().setpoint == 50e3


def test_without_commands_a_pad_is_vented(robot):
    robot.start(command_timeout=0.3)
    robot.hold(60e3, 1.0)
    robot.tick(0.28)
    assert robot.gauge() > 59e3
    robot.tick(0.5)
    assert robot.gauge() < 1e3
    assert robot.status().message == 'no set-points: vented'
    robot.hold(60e3, 0.6)  # and when they come again, it is back
    assert robot.gauge() > 59e3


def test_bad_commands_do_not_keep_a_pad_up(robot):
    robot.start(command_timeout=0.3)
    robot.hold(60e3, 0.6)
    for _ in range(40):
        robot.send(60e3, age=0.4)
        robot.tick(0.02)
    assert robot.regulator.channels[1].refusals == 40
    assert robot.gauge() < 1e3


def test_vent_lasts_until_somebody_activates_again(robot):
    robot.start()
    robot.hold(60e3, 0.6)
    robot.hold(40e3, 0.6, leg=2)
    answer = robot.call(Trigger, 'regulator/vent', Trigger.Request())
    assert answer.success
    assert answer.message == '2 pads told to vent; activate to accept set-points again'
    publisher = robot._setpoints[1]  # nobody answers to a controller that goes on
    for _ in range(50):
        message = FluidPressure(fluid_pressure=AMBIENT + 60e3)
        set_stamp(message.header.stamp, robot.time_ns)
        publisher.publish(message)
        robot.tick(0.02)
    assert (robot.gauge(1) < 1e3, robot.gauge(2) < 1e3) == (True, True)
    assert robot.transit(Transition.TRANSITION_ACTIVATE)
    robot.hold(60e3, 0.6)
    assert robot.gauge() > 59e3


def test_the_life_of_the_node(robot):
    node = robot.start(autostart=False)
    assert robot.state() == State.PRIMARY_STATE_UNCONFIGURED
    assert not node.channels
    assert robot.transit(Transition.TRANSITION_CONFIGURE)
    assert robot.state() == State.PRIMARY_STATE_INACTIVE
    robot.tick(0.1)
    robot.until(lambda: robot.pressures[1], what='a pressure while inactive')
    message = FluidPressure(fluid_pressure=AMBIENT + 60e3)
    set_stamp(message.header.stamp, robot.time_ns)
    robot._setpoints[1].publish(message)
    robot.tick(0.2)
    assert node.answered == 0
    assert robot.gauge() == 0.0
    assert robot.transit(Transition.TRANSITION_ACTIVATE)
    assert robot.state() == State.PRIMARY_STATE_ACTIVE
    robot.hold(60e3, 0.6)
    assert robot.gauge() > 59e3
    assert robot.transit(Transition.TRANSITION_DEACTIVATE)
    assert robot.state() == State.PRIMARY_STATE_INACTIVE
    robot.tick(1.0)
    assert robot.gauge() < 1e3
    devices = [channel.regulator for channel in node.channels.values()]
    assert robot.transit(Transition.TRANSITION_CLEANUP)
    assert robot.state() == State.PRIMARY_STATE_UNCONFIGURED
    for device in devices:
        with pytest.raises(TransportError, match='not open'):
            device.read()
    assert robot.transit(Transition.TRANSITION_CONFIGURE)
    assert robot.transit(Transition.TRANSITION_ACTIVATE)
    robot.hold(50e3, 0.6)
    assert robot.gauge() > 49e3
    assert robot.transit(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    assert robot.state() == State.PRIMARY_STATE_FINALIZED
    assert not node.channels


def test_autostart_activates(robot):
    robot.start()
    assert robot.state() == State.PRIMARY_STATE_ACTIVE


def test_what_a_device_was_left_at_is_vented_first(robot, devices):
    robot.start(simulated=False, backend='device')
    assert [device.setpoint for device in devices()] == [0.0, 0.0]


@pytest.mark.parametrize('end', ['deactivate', 'cleanup', 'shutdown', 'destroy', 'vent'])
def test_every_end_vents(robot, devices, executor, end):
    node = robot.start(simulated=False, backend='device')
    for leg in (1, 2):
        robot.send(50e3, leg, stamp_ns=node.get_clock().now().nanoseconds)
    assert [device.setpoint for device in devices()] == [50e3, 50e3]
    if end == 'destroy':
        executor.remove_node(node)
        node.destroy_node()
    elif end == 'vent':
        assert robot.call(Trigger, 'regulator/vent', Trigger.Request()).success
    elif end == 'shutdown':
        assert robot.transit(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    else:
        assert robot.transit(Transition.TRANSITION_DEACTIVATE)
        if end == 'cleanup':
            assert robot.transit(Transition.TRANSITION_CLEANUP)
    assert [device.setpoint for device in devices()] == [0.0, 0.0]
    closed = end in ('cleanup', 'destroy', 'shutdown')
    assert [device.is_open for device in devices()] == [not closed] * 2


@pytest.mark.parametrize('error', [TransportError('cable'), OSError(5, 'cable')])
def test_a_broken_cable_does_not_keep_the_other_pads_up(robot, devices, error):
    node = robot.start(simulated=False, backend='device')
    for leg in (1, 2):
        robot.send(50e3, leg, stamp_ns=node.get_clock().now().nanoseconds)
    first, second = devices()
    real_read, first.read = first.read, second.read  # only its commands are lost
    first.broken = error
    answer = robot.call(Trigger, 'regulator/vent', Trigger.Request())
    assert not answer.success
    assert answer.message == 'cannot vent leg 1'
    assert (first.setpoint, second.setpoint) == (50e3, 0.0)
    first.broken, first.read = None, real_read  # plugged in again: the node has not given up
    robot.until(lambda: first.setpoint == 0.0, what='the vent')


def test_a_command_whose_answer_is_lost_is_vented(robot, devices):
    """The device may have taken it: that nobody confirmed it does not make the pad flat."""
    node = robot.start(simulated=False, backend='device')
    first, _ = devices()
    first.read = lambda: Reading(0.0, 0.0, (), 0.0)
    first.broken = TransportError('no answer')
    robot.send(50e3, stamp_ns=node.get_clock().now().nanoseconds)
    assert first.setpoint == 50e3
    robot.until(
        lambda: any(
            s.message == 'cannot be vented' or s.message == 'no answer'
            for d in robot.diagnostics
            for s in d.status
        )
    )
    first.broken = None
    robot.until(lambda: first.setpoint == 0.0, what='the vent')


def test_a_silent_device_is_an_error_on_diagnostics(robot, devices):
    robot.start(simulated=False, backend='device')
    devices()[1].broken = TransportError('the line is silent')
    robot.until(
        lambda: any(
            (s.level, s.message) == (DiagnosticStatus.ERROR, 'the line is silent')
            and 'leg 2' in s.name
            for d in robot.diagnostics
            for s in d.status
        ),
        timeout=3.0,
    )
    # One line is silent, and it alone is in error.
    silent = [s.name for s in robot.diagnostics[-1].status if s.level == DiagnosticStatus.ERROR]
    assert len(silent) == 1 and 'leg 2' in silent[0]


def test_commands_that_stop_are_noticed_when_the_time_of_day_is_set_back(robot, devices):
    node = robot.start(simulated=False, backend='device', command_timeout=0.2)
    robot.send(50e3, stamp_ns=node.get_clock().now().nanoseconds)
    node.channels[1].commanded_ns += 3600 * 10**9  # it was an hour later then
    assert devices()[0].setpoint == 50e3
    robot.until(lambda: devices()[0].setpoint == 0.0, timeout=2.0, what='the vent')
    assert devices()[0].setpoint == 0.0


def test_a_device_that_is_not_there(robot, devices, context):
    overrides = [
        Parameter(name, value=value)
        for name, value in {'backend': 'device', 'backend_options.port': 'none'}.items()
    ]
    with pytest.raises(TransportError, match="node regulator: no such port: 'none'"):
        RegulatorNode(context=context, parameter_overrides=overrides)
    node = robot.start(
        simulated=False, backend='device', autostart=False, **{'backend_options.port': 'none'}
    )
    assert not robot.transit(Transition.TRANSITION_CONFIGURE)
    assert robot.state() == State.PRIMARY_STATE_UNCONFIGURED
    assert not node.channels


def test_real_devices_do_not_live_in_simulated_time(context, devices):
    overrides = [Parameter('backend', value='device'), Parameter('use_sim_time', value=True)]
    with pytest.raises(
        ConfigError, match='use_sim_time = True is not allowed with backend device'
    ):
        RegulatorNode(context=context, parameter_overrides=overrides)


def test_volumes_and_hoses_are_options_of_the_simulated_backend(robot):
    robot.start(**{'backend_options.hose_length': 20.0, 'backend_options.hose_diameter': 0.001})
    robot.hold(60e3, 0.1)
    assert robot.gauge() < 30e3  # a thin long hose is slow
