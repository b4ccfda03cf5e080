# SPDX-License-Identifier: Apache-2.0
import dataclasses
import math
from functools import partial

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import State
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from lifecycle_msgs.srv import GetState
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import FluidPressure
from std_srvs.srv import Trigger

from ros_pad import configuration
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

    def told(self, name, level=DiagnosticStatus.ERROR):
        """When a level was first told of, s, and its words; None if it never was."""
        for array in self.diagnostics:
            for status in array.status:
                if name in status.name and status.level == level:
                    return nanoseconds(array.header.stamp) * 1e-9, status.message
        return None

    def walk(self, steps):
        """Command pressures of both pads at once, each for some time: (gauge, gauge, seconds)."""
        for one, two, seconds in steps:
            for _ in range(round(seconds / 0.02)):
                self.send(one, 1)
                self.send(two, 2)
                self.tick(0.02)

    def set(self, name, value):
        """Change a parameter as ``ros2 param set`` does."""
        request = SetParameters.Request(
            parameters=[Parameter(name, value=value).to_parameter_msg()]
        )
        return self.call(SetParameters, 'regulator/set_parameters', request).results[0]

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
        self.reads = None  # in place of the set-point
        self.faults = ()
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
        pressure = self.setpoint if self.reads is None else self.reads
        return Reading(pressure, self.setpoint, self.faults, 0.0)

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
    'future': (
        {'gauge': 50e3, 'age': -0.51},
        'set-point is 0.510 s ahead of the clock here: at most 0.5 s',
    ),
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


@pytest.mark.parametrize('error', [partial(TransportError, 'cable'), partial(OSError, 5, 'cable')])
def test_a_broken_cable_does_not_keep_the_other_pads_up(robot, devices, error):
    node = robot.start(simulated=False, backend='device')
    for leg in (1, 2):
        robot.send(50e3, leg, stamp_ns=node.get_clock().now().nanoseconds)
    first, second = devices()
    real_read, first.read = first.read, second.read  # only its commands are lost
    first.broken = error()
    answer = robot.call(Trigger, 'regulator/vent', Trigger.Request())
    assert not answer.success
    assert answer.message == 'cannot vent leg 1'
    assert (first.setpoint, second.setpoint) == (50e3, 0.0)
    first.broken, first.read = None, real_read  # plugged in again: the node has not given up
    robot.until(lambda: first.setpoint == 0.0, what='the vent')


def test_a_vent_that_reaches_no_device_is_no_success(robot):
    """Whoever asked believes otherwise that the pads are flat."""
    robot.start(autostart=False)
    answer = robot.call(Trigger, 'regulator/vent', Trigger.Request())
    assert not answer.success
    assert answer.message == 'no device is open, and none was told: configure the node first'


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


def test_legs_have_options_of_their_own(robot):
    """A list has one for each leg; the longer hose fills more slowly."""
    node = robot.start(
        legs=[1, 2],
        **{'backend_options.hose_length': [0.5, 20.0], 'backend_options.hose_diameter': 0.001},
    )
    fast, slow = (node.channels[leg].regulator._channel.hose.length for leg in (1, 2))
    assert (fast, slow) == (0.5, 20.0)


def test_a_list_that_does_not_fit_the_legs_is_refused(robot):
    with pytest.raises(ConfigError, match=r'hose_length = \[1.0, 2.0, 3.0\] .* one for each leg'):
        robot.start(legs=[1, 2], **{'backend_options.hose_length': [1.0, 2.0, 3.0]})


def test_volumes_and_hoses_are_options_of_the_simulated_backend(robot):
    robot.start(**{'backend_options.hose_length': 20.0, 'backend_options.hose_diameter': 0.001})
    robot.hold(60e3, 0.1)
    assert robot.gauge() < 30e3  # a thin long hose is slow


def test_hose_and_faults_of_a_scene_are_options_that_others_overrule(robot, tmp_path):
    path = tmp_path / 'mine.yaml'
    text = configuration.locate('scenes', 'hexapod_patches').read_text()
    path.write_text(
        text.replace('hose_length: 1.0 ', 'hose_length: 3.0 ') + '\nfaults:\n'
        '  - {kind: leak, legs: [2], start: 1.5, conductance: 1.0e-9}\n'
        '  - {kind: force_dead, legs: [2], start: 1.5}\n'
    )
    node = robot.start(legs=[1, 2], scene=str(path), **{'backend_options.hose_diameter': 0.002})
    sound, leaking = (node.channels[leg].regulator for leg in (1, 2))
    for each in (sound, leaking):
        assert each._channel.hose.length == 3.0  # of the scene
        assert each._channel.hose.inner_diameter == 0.002
    assert sound._faults == ()
    (fault,) = leaking._faults
    assert (fault.kind, fault.start, fault.conductance) == ('leak', 1.5, 1e-9)


def test_a_scene_says_nothing_to_other_backends(robot, devices):
    """They know no hose: its options would be refused."""
    robot.start(simulated=False, backend='device', scene='hexapod_patches')
    assert len(devices()) == 2


# What each fault does to leg 1, when it can be seen, and the first words of what is said of it.
FAULTS = {
    'stuck flat': ('{kind: stuck_valve, legs: [1]}', 1.0, 'does not fill: 0.0 kPa'),
    'stuck filled': ('{kind: stuck_valve, legs: [1], start: 1.5}', 2.2, 'does not vent: 60.'),
    'leak': (
        '{kind: leak, legs: [1], start: 1.5, conductance: 1.0e-8}', 1.5, 'sags: ',
    ),
    'drift': (
        '{kind: sensor_drift, legs: [1], start: 1.5, offset: 8.0e3}', 2.2,
        'does not vent: 8.0 kPa',
    ),
    'drift down': (
        '{kind: sensor_drift, legs: [1], start: 1.5, offset: -8.0e3}', 2.2,
        'reads -8.0 kPa, which no pad has',
    ),
    'silence': (
        '{kind: silence, legs: [1], start: 1.5, end: 2.4}', 1.5,
        'the simulated regulator does not answer',
    ),
    'supply': (
        '{kind: supply_loss, legs: [1], start: 1.5, time_constant: 0.1}', 1.6, 'sags: ',
    ),
}  # fmt: skip


@pytest.mark.parametrize('case', FAULTS)
def test_each_fault_is_told_of_within_a_second(robot, case):
    fault, visible, words = FAULTS[case]
    robot.start(**{'backend_options.faults': [fault]})
    filled = 60e3
    answered = robot.regulator.channels[1]
    for k in range(165):
        gauge = filled if 1.0 <= 0.02 * k < 2.2 else 0.0
        robot.send(gauge, 1)
        robot.send(gauge, 2)
        robot.tick(0.02)
    robot.until(lambda: nanoseconds(robot.diagnostics[-1].header.stamp) >= 3e9)
    at, message = robot.told('leg 1')
    assert visible <= at <= visible + 1.0
    assert message.startswith(words)
    assert robot.told('leg 2') is None
    assert robot.told('supply') is None  # one pad alone is no supply
    if case != 'silence':
        assert answered.refusals == 0  # it is told, and no more


def test_a_supply_that_goes_is_told_apart_from_a_leak(robot):
    robot.start(**{'backend_options.faults': ['{kind: supply_loss, start: 1.0}']})
    robot.walk([(60e3, 50e3, 2.4)])
    at, message = robot.told('supply')
    # It falls from 100 kPa with a time constant of 1 s: to 60 kPa in 0.51 s, to 50 in 0.69 s.
    assert 1.69 < at <= 2.69
    assert message == 'supply sags: legs 1, 2 lack air'
    assert robot.status(2).level == DiagnosticStatus.ERROR
    assert [s.name for s in robot.diagnostics[0].status] == [
        'regulator: leg 1 regulator', 'regulator: leg 2 regulator', 'regulator: supply',
    ]  # fmt: skip


def test_sound_pads_are_not_accused(robot):
    robot.start()
    robot.walk([(60e3, 0.0, 0.5), (0.0, 88e3, 0.5), (90e3, 20e3, 1.0), (0.0, 90e3, 1.0)])
    robot.tick(2.0)
    robot.until(lambda: nanoseconds(robot.diagnostics[-1].header.stamp) >= 5e9)
    assert robot.told('') is None
    levels = {
        (nanoseconds(array.header.stamp) // MS, status.level)
        for array in robot.diagnostics
        for status in array.status
        if 'leg 1 ' in status.name
    }
    # Each second that all is well; and, at once, that no set-points have come for 0.5 s.
    assert sorted(levels) == [
        *((at, DiagnosticStatus.OK) for at in (10, 1000, 2000, 3000)),
        *((at, DiagnosticStatus.STALE) for at in (3500, 4000, 5000)),
    ]


def test_a_faulty_pad_is_vented_and_held_if_one_wants_that(robot, capfd):
    leak = '{kind: leak, legs: [1], start: 1.0, end: 2.5, conductance: 1.0e-8}'
    robot.start(on_fault='vent', **{'backend_options.faults': [leak]})
    robot.walk([(60e3, 40e3, 2.0)])
    channel = robot.regulator.channels[1]
    assert channel.regulator.read().setpoint == 0.0
    assert robot.gauge(2) == pytest.approx(40e3, abs=500.0)
    assert 0 < channel.refusals == 100 - channel.commands
    status = robot.status()
    assert status.level == DiagnosticStatus.ERROR
    assert status.message.startswith('sags: ')
    assert '; vented until the node is activated again' in status.message
    assert 'leg 1: vented: sags: ' in capfd.readouterr().err
    robot.walk([(60e3, 40e3, 0.5)])  # the hole is closed, and still
    assert robot.gauge() < 1e3
    assert robot.call(Trigger, 'regulator/vent', Trigger.Request()).success
    assert robot.transit(Transition.TRANSITION_ACTIVATE)
    robot.diagnostics.clear()
    robot.walk([(60e3, 40e3, 1.0)])
    assert robot.gauge() == pytest.approx(60e3, abs=500.0)
    assert robot.told('leg 1', DiagnosticStatus.OK)
    assert robot.told('leg 1') is None


def test_a_reaction_can_be_chosen_while_the_pad_is_faulty(robot):
    robot.start(**{'backend_options.faults': ['{kind: stuck_valve, legs: [1]}']})
    robot.walk([(60e3, 60e3, 1.0)])
    assert robot.regulator.channels[1].refusals == 0
    assert robot.set('on_fault', 'vent').successful
    robot.tick(0.02)
    robot.send(60e3)
    assert robot.regulator.channels[1].refusals == 1


def test_faults_that_a_device_reports_count_as_well(robot, devices):
    node = robot.start(simulated=False, backend='device', on_fault='vent')
    robot.send(50e3, stamp_ns=node.get_clock().now().nanoseconds)
    devices()[0].faults = ('EXH: the exhaust is open',)
    robot.until(lambda: devices()[0].setpoint == 0.0, what='the vent')
    robot.until(lambda: robot.told('leg 1'), what='/diagnostics')
    assert robot.told('leg 1')[1].startswith('EXH: the exhaust is open')
    assert devices()[0].setpoint == 0.0
    assert node.channels[1].held.startswith('EXH: the exhaust is open')


def test_a_device_that_is_silent_for_long_is_held_but_one_lost_answer_is_not(robot):
    lost = '{kind: silence, legs: [1], start: 1.0, end: 1.1}'
    silent = '{kind: silence, legs: [2], start: 1.0, end: 1.7}'
    robot.start(on_fault='vent', **{'backend_options.faults': [lost, silent]})
    robot.walk([(60e3, 60e3, 2.5)])
    assert robot.gauge(1) == pytest.approx(60e3, abs=500.0)
    assert robot.gauge(2) < 1e3
    assert robot.regulator.channels[2].held.startswith('no reading for 0.5 s')


def test_a_device_that_is_silent_from_the_start_is_missed(robot):
    silent = '{kind: silence, legs: [1], start: 0.005}'  # it heard the first vent
    robot.start(on_fault='vent', **{'backend_options.faults': [silent]})
    robot.walk([(60e3, 60e3, 0.7)])
    assert robot.regulator.channels[1].held.startswith('no reading for 0.5 s')
    assert not robot.regulator.channels[2].held


def test_a_pad_above_the_ceiling_is_vented_at_once_and_held(robot, devices, capfd):
    node = robot.start(simulated=False, backend='device', ceiling=80e3)
    first, second = devices()

    def command():
        for leg in (1, 2):
            robot.send(70e3, leg, stamp_ns=node.get_clock().now().nanoseconds)

    first.reads = 81.5e3  # 80 kPa and 2 %: 81.6 kPa
    read = len(robot.pressures[1])
    robot.until(lambda: len(robot.pressures[1]) > read + 3)
    command()
    assert (first.setpoint, second.setpoint) == (70e3, 70e3)
    first.reads = 81.7e3
    robot.until(lambda: first.setpoint == 0.0, what='the vent')
    command()
    assert (first.setpoint, second.setpoint) == (0.0, 70e3)
    assert node.channels[1].refusal.startswith('set-point 70000 Pa is not allowed: 81700 Pa is')
    robot.until(lambda: robot.told('leg 1'), what='/diagnostics')
    assert robot.told('leg 1')[1].startswith(
        '81700 Pa is above the ceiling of 80000 Pa; vented until the node is activated again'
    )
    assert 'leg 1: vented: 81700 Pa is above the ceiling of 80000 Pa' in capfd.readouterr().err


def test_a_reading_that_is_no_number_is_none(robot, devices):
    robot.start(simulated=False, backend='device')
    count = len(robot.pressures[1])
    devices()[0].reads = math.nan
    robot.until(lambda: robot.told('leg 1'), what='/diagnostics')
    assert robot.told('leg 1')[1] == 'device reads nan Pa: a number is needed'
    assert all(math.isfinite(each.fluid_pressure) for each in robot.pressures[1][count:])


def test_set_points_approach_the_command_no_faster_than_they_may(robot):
    robot.start(slew_limit=50e3)
    channel = robot.regulator.channels[1]
    robot.tick(1.0)  # a rest is not saved up
    sent = []
    for gauge, seconds in ((60e3, 1.5), (15e3, 1.2)):
        for _ in range(round(seconds / 0.02)):
            robot.send(gauge)
            robot.tick(0.02)
            sent.append(channel.regulator.read().setpoint)
    steps = [b - a for a, b in zip([0.0, *sent], sent, strict=False)]
    # 1 kPa each 20 ms: 60 steps up, 15 s at rest, 45 down.
    assert steps[:60] == pytest.approx([1e3] * 60)
    assert steps[60:75] == pytest.approx([0.0] * 15)
    assert steps[75:120] == pytest.approx([-1e3] * 45)
    assert (max(sent), sent[-1]) == (60e3, 15e3)
    assert robot.told('') is None
    assert robot.call(Trigger, 'regulator/vent', Trigger.Request()).success
    assert channel.regulator.read().setpoint == 0.0  # a vent is not slowed


def test_a_slow_set_point_goes_on_between_commands_and_stops_with_them(robot):
    robot.start(slew_limit=50e3, command_timeout=0.3)
    channel = robot.regulator.channels[1]
    robot.tick(0.1)
    robot.send(60e3)
    robot.tick(0.3)
    # Nothing at once, and 1 kPa with each pressure since.
    assert channel.regulator.read().setpoint == pytest.approx(15e3, abs=1001.0)
    robot.tick(0.02)
    assert channel.regulator.read().setpoint == 0.0
    assert robot.set('slew_limit', 0.0).successful
    robot.send(60e3)
    assert channel.regulator.read().setpoint == 60e3


def test_a_slow_set_point_does_not_leap_after_a_silence(robot):
    fault = '{kind: silence, legs: [1], start: 0.4, end: 0.7}'
    robot.start(slew_limit=50e3, **{'backend_options.faults': [fault]})
    robot.tick(0.1)
    robot.hold(60e3, 0.28)
    device = robot.regulator.channels[1].regulator
    before = device.read().setpoint
    assert before > 10e3
    robot.hold(60e3, 0.34)
    assert before < device.read().setpoint < before + 3e3
    robot.hold(60e3, 1.2)
    assert device.read().setpoint == 60e3


def test_a_pad_that_does_not_follow_a_slow_set_point_is_told_of_when_it_has_arrived(robot):
    robot.start(slew_limit=100e3, **{'backend_options.faults': ['{kind: stuck_valve, legs: [1]}']})
    robot.walk([(60e3, 60e3, 1.6)])
    at, message = robot.told('leg 1')
    assert 0.6 < at < 1.6
    assert message.startswith('does not fill')


def test_a_shorter_patience_acts_at_once(robot):
    robot.start(command_timeout=5.0)
    robot.hold(60e3, 0.5)
    assert robot.set('command_timeout', 0.1).successful
    robot.tick(0.12)
    assert robot.regulator.channels[1].regulator.read().setpoint == 0.0
    refused = robot.set('command_timeout', 100.0)
    assert not refused.successful
    assert 'command_timeout out of range' in refused.reason


def fail_once(monkeypatch, where, name):
    """Let the next call of a method fail in a way that nobody foresaw."""
    real = getattr(where, name)

    def fail(*_):
        monkeypatch.setattr(where, name, real)
        raise ZeroDivisionError

    monkeypatch.setattr(where, name, fail)


REASONS = {
    'timeout': 'vented: no set-point for 0.2 s',
    'deactivate': 'vented: deactivated',
    'vent': 'vented: deactivated',
    'shutdown': 'vented: closing: shut down',
    'error': 'vented: closing: a transition failed',
    'destroy': 'vented: closing: the node ends',
}


@pytest.mark.parametrize('end', REASONS)
def test_the_log_says_why_a_pad_is_vented(robot, devices, executor, monkeypatch, capfd, end):
    node = robot.start(simulated=False, backend='device', command_timeout=0.2)
    if end != 'timeout':
        assert robot.set('command_timeout', 60.0).successful
    robot.send(50e3, stamp_ns=node.get_clock().now().nanoseconds)
    if end == 'timeout':
        robot.until(lambda: devices()[0].setpoint == 0.0, what='the vent')
    elif end == 'vent':
        assert robot.call(Trigger, 'regulator/vent', Trigger.Request()).success
    elif end == 'destroy':
        executor.remove_node(node)
        node.destroy_node()
    elif end == 'error':
        fail_once(monkeypatch, node, 'vent')
        robot.transit(Transition.TRANSITION_DEACTIVATE)
        assert robot.state() == State.PRIMARY_STATE_UNCONFIGURED
    else:
        robot.transit(
            Transition.TRANSITION_DEACTIVATE
            if end == 'deactivate'
            else Transition.TRANSITION_ACTIVE_SHUTDOWN
        )
    assert devices()[0].setpoint == 0.0
    assert f'leg 1: {REASONS[end]}' in capfd.readouterr().err


TRANSITIONS = {
    'unconfigured': ((), Transition.TRANSITION_UNCONFIGURED_SHUTDOWN),
    'inactive': ((Transition.TRANSITION_CONFIGURE,), Transition.TRANSITION_INACTIVE_SHUTDOWN),
    'active': (
        (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE),
        Transition.TRANSITION_ACTIVE_SHUTDOWN,
    ),
}


@pytest.mark.parametrize('state', TRANSITIONS)
def test_the_node_can_be_shut_down_in_every_state(robot, devices, state):
    node = robot.start(simulated=False, backend='device', autostart=False)
    way, shutdown = TRANSITIONS[state]
    for transition in way:
        assert robot.transit(transition)
    if state == 'active':
        robot.send(50e3, stamp_ns=node.get_clock().now().nanoseconds)
    assert robot.transit(shutdown)
    assert robot.state() == State.PRIMARY_STATE_FINALIZED
    assert not node.channels
    assert all(each.setpoint == 0.0 and not each.is_open for each in devices())
    count = len(robot.diagnostics)  # it lives on, and says that it serves nobody
    robot.until(lambda: len(robot.diagnostics) > count, what='/diagnostics')


@pytest.mark.parametrize('failing', ['configure', 'activate', 'deactivate', 'cleanup'])
def test_after_a_transition_that_fails_it_can_be_configured_again(
    robot, devices, monkeypatch, failing
):
    node = robot.start(simulated=False, backend='device', autostart=False)
    names = ['configure', 'activate', 'deactivate', 'cleanup']
    numbers = {each: getattr(Transition, f'TRANSITION_{each.upper()}') for each in names}
    for name in names[: names.index(failing)]:
        assert robot.transit(numbers[name])
    culprit = {'configure': (Device, 'vent'), 'activate': (module, 'PadWatch')}
    fail_once(monkeypatch, *culprit.get(failing, (node, 'vent')))
    assert not robot.transit(numbers[failing])
    assert robot.state() == State.PRIMARY_STATE_UNCONFIGURED
    assert not node.channels
    assert devices()
    assert not any(each.is_open for each in devices())
    assert robot.transit(numbers['configure'])
    assert robot.transit(numbers['activate'])
    robot.send(50e3, stamp_ns=node.get_clock().now().nanoseconds)
    assert devices()[-2].setpoint == 50e3


def test_a_port_can_be_corrected_and_tried_again(robot, devices, capfd):
    node = robot.start(
        simulated=False, backend='device', autostart=False, **{'backend_options.port': 'none'}
    )
    assert not robot.transit(Transition.TRANSITION_CONFIGURE)
    assert "node regulator: no such port: 'none'" in capfd.readouterr().err
    assert robot.set('backend_options.port', 'usb').successful
    assert robot.transit(Transition.TRANSITION_CONFIGURE)
    assert [channel.regulator.port for channel in node.channels.values()] == ['usb', 'usb']
    refused = robot.set('backend_options.port', 'other')
    assert not refused.successful
    assert refused.reason == (
        'node regulator: parameter backend_options.port is read when the devices are opened:'
        ' clean up first'
    )
