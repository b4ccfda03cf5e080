# SPDX-License-Identifier: Apache-2.0
import dataclasses
import functools
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
from ros_pad.regulators import SimulatedRegulator
from ros_pad.regulators.protocol import permitted
from ros_pad.regulators.supervisor import SupervisedChannel

AMBIENT = 101325.0
MS = 1_000_000


class Robot:
    """The rest of the robot: publishes clock and set-points, and records the node's messages."""

    def __init__(self, context, executor, until):
        self.node = Node('robot', context=context)
        executor.add_node(self.node)
        self._context = context
        self._executor = executor
        self.until = until
        self.time_ns = 0
        self.regulator = None
        self._clock = topics.CLOCK.publisher(self.node)
        self.setpoints = {
            leg: topics.PRESSURE_SETPOINT.publisher(self.node, leg) for leg in (1, 2)
        }
        self.pressures = {1: [], 2: []}
        self.diagnostics = []
        for leg in (1, 2):
            topics.PRESSURE.subscription(self.node, self.pressures[leg].append, leg)
        topics.DIAGNOSTICS.subscription(self.node, self.diagnostics.append)

    def start(self, simulated=True, **parameters):
        # In real time, commands must not time out on a slow machine.
        patience = {} if simulated else {'command_timeout': 60.0}
        parameters = {'legs': [1, 2], 'use_sim_time': simulated, **patience, **parameters}
        self.regulator = RegulatorNode(
            context=self._context,
            parameter_overrides=[Parameter(name, value=v) for name, v in parameters.items()],
        )
        self._executor.add_node(self.regulator)
        self.until(
            lambda: (
                all(p.get_subscription_count() for p in self.setpoints.values())
                # Two subscriptions to /clock: the node's time and its ticks.
                and (not simulated or self._clock.get_subscription_count() == 2)
                and self.node.count_publishers('leg_2/pressure')
            ),
            what='the regulator node',
        )
        return self.regulator

    def tick(self, seconds=0.01):
        """Advance simulated time in steps of 10 ms, and wait for each."""
        for _ in range(round(seconds / 0.01)):
            self.time_ns += 10 * MS
            message = topics.CLOCK.message()
            set_stamp(message.clock, self.time_ns)
            self._clock.publish(message)
            self.until(
                lambda: (
                    self.regulator.get_clock().now().nanoseconds == self.time_ns
                    and self.regulator.tick_ns == self.time_ns
                )
            )

    def send(self, gauge, leg=1, age=0.0, stamp_ns=None, ambient=AMBIENT):
        """Send a set-point, Pa gauge, and wait until it is accepted or refused."""
        answered = self.regulator.answered
        message = FluidPressure(fluid_pressure=gauge + ambient)
        now_ns = self.time_ns if stamp_ns is None else stamp_ns
        set_stamp(message.header.stamp, now_ns - round(age * 1e9))
        self.setpoints[leg].publish(message)
        self.until(lambda: self.regulator.answered > answered, what='an answer')

    def hold(self, gauge, seconds, leg=1):
        """Command a pressure as a controller does, every 20 ms."""
        for _ in range(round(seconds / 0.02)):
            self.send(gauge, leg)
            self.tick(0.02)

    def gauge(self, leg=1):
        """Return the pressure of a pad now, Pa gauge."""
        return self.regulator.channels[leg].regulator.read().pressure

    def status(self, leg=1):
        """Return the next status of a leg on /diagnostics, which is published every second."""
        count, start_ns = len(self.diagnostics), self.time_ns
        while self.time_ns <= start_ns + 1000 * MS and len(self.diagnostics) == count:
            self.tick()
        self.until(lambda: len(self.diagnostics) > count, what='/diagnostics')
        (status,) = [s for s in self.diagnostics[-1].status if f'leg {leg} ' in s.name]
        return status

    def reported(self, name, level=DiagnosticStatus.ERROR):
        """Return time, s, and message of the first status with name and level, or None."""
        for array in self.diagnostics:
            for status in array.status:
                if name in status.name and status.level == level:
                    return nanoseconds(array.header.stamp) * 1e-9, status.message
        return None

    def walk(self, steps):
        """Command both pads; steps are (Pa gauge of leg 1, Pa gauge of leg 2, s)."""
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
    """A device whose cable may break."""

    made = ()

    def __init__(self, ceiling, port='usb'):
        self.ceiling = ceiling
        self.port = port
        self.setpoint = 40e3  # of an earlier user
        self.is_open = False
        self.broken = None
        self.reads = None  # pressure that is read, if not the set-point
        self.faults = ()
        Device.made = (*Device.made, self)

    def open(self):
        if self.port == 'none':
            raise TransportError("no such port: 'none'")
        self.is_open = True

    def set_pressure(self, gauge_pa):
        self.setpoint = permitted(gauge_pa, self.ceiling)
        self._answer()  # when the cable is broken, only the answer is lost

    def read(self):
        self._answer()
        pressure = self.setpoint if self.reads is None else self.reads
        return Reading(pressure, self.setpoint, self.faults, 0.0)

    def vent(self):
        self._answer()
        self.setpoint = 0.0

    def close(self):
        self.is_open = False

    def _answer(self):
        assert self.is_open
        if self.broken:
            raise self.broken


@pytest.fixture
def devices(monkeypatch):
    """Make ``device`` a backend; return a function that returns its devices in order of legs."""
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
    robot.hold(60e3, 0.1)  # 161325 Pa absolute is 76325 Pa gauge there
    assert robot.regulator.channels[1].regulator.read().setpoint == 76325.0


def test_the_ceiling_itself_is_allowed_at_any_ambient_pressure(robot):
    ambient = 83210.7
    assert (ambient + 70e3) - ambient > 70e3  # rounding
    robot.start(ambient_pressure=ambient, ceiling=70e3)
    robot.send(70e3, ambient=ambient)
    assert robot.regulator.channels[1].accepted == 1


REFUSED = {
    'stale': (
        {'gauge': 50e3, 'age': 0.51},
        'stamp of the set-point is 0.510 s old: at most 0.5 s',
    ),
    'future': (
        {'gauge': 50e3, 'age': -0.51},
        'stamp of the set-point is 0.510 s in the future: at most 0.5 s',
    ),
    'no stamp': ({'gauge': 50e3, 'stamp_ns': 0}, 'stamp of the set-point is 2.000 s old'),
    'nan': (
        {'gauge': math.nan},
        'set-point nan Pa is not allowed: a number from 0 to 80000 Pa gauge',
    ),
    'gauge sent as absolute': ({'gauge': 50e3 - AMBIENT}, 'set-point -51325.0 Pa is not allowed'),
    'above the ceiling': (
        {'gauge': 80001.0},
        'set-point 80001 Pa is refused: it is above the ceiling of 80000',
    ),
}


@pytest.mark.parametrize('case', REFUSED)
def test_a_bad_setpoint_is_refused_and_reported(robot, case):
    setpoint, message = REFUSED[case]
    robot.start(ceiling=80e3)
    robot.tick(1.4)
    robot.hold(30e3, 0.6)
    robot.send(**setpoint)
    channel = robot.regulator.channels[1]
    assert (channel.accepted, channel.refused) == (30, 1)
    robot.hold(30e3, 0.4)
    assert robot.gauge() == pytest.approx(30e3, abs=500.0)
    assert robot.status(2).level == DiagnosticStatus.STALE
    refused_ns = 2000 * MS
    reports = [
        (nanoseconds(array.header.stamp), status)
        for array in robot.diagnostics
        for status in array.status
        if 'leg 1 ' in status.name and status.level == DiagnosticStatus.WARN
    ]
    assert [(refused_ns <= at <= refused_ns + 1000 * MS) for at, _ in reports] == [True]
    (_, status) = reports[0]
    assert status.message.startswith(message)
    assert {each.key: each.value for each in status.values}['set-points refused'] == '1'
    assert max(m.fluid_pressure for m in robot.pressures[1]) <= AMBIENT + 30.5e3


def test_pressure_stays_below_the_ceiling(robot):
    """Steps go up to the ceiling and down; one set-point is above the ceiling."""
    robot.start(ceiling=80e3)
    for gauge in (80e3, 0.0, 80e3, 95e3, 80e3, 20e3, 80e3):
        robot.hold(gauge, 0.4)
    assert len(robot.pressures[1]) > 100
    highest = max(message.fluid_pressure for message in robot.pressures[1]) - AMBIENT
    # At a damping ratio of 0.9 the overshoot is exp(-pi 0.9/sqrt(1 - 0.81)) = 0.15 % of a step.
    assert 79e3 < highest <= 80e3 * 1.0016


def test_a_vent_lasts_until_the_next_activation(robot):
    robot.start()
    robot.hold(60e3, 0.6)
    robot.hold(40e3, 0.6, leg=2)
    answer = robot.call(Trigger, 'regulator/vent', Trigger.Request())
    assert answer.success
    assert '2 pads' in answer.message and 'activate' in answer.message
    publisher = robot.setpoints[1]  # the controller goes on
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
    robot.setpoints[1].publish(message)
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


def test_devices_are_vented_when_they_are_opened(robot, devices):
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
    real_read, first.read = first.read, second.read  # only commands are lost
    first.broken = error()
    answer = robot.call(Trigger, 'regulator/vent', Trigger.Request())
    assert not answer.success
    assert 'leg 1' in answer.message
    assert (first.setpoint, second.setpoint) == (50e3, 0.0)
    first.broken, first.read = None, real_read  # the node still tries to vent
    robot.until(lambda: first.setpoint == 0.0, what='the vent')


def test_a_vent_that_reaches_no_device_is_no_success(robot):
    robot.start(autostart=False)
    answer = robot.call(Trigger, 'regulator/vent', Trigger.Request())
    assert not answer.success
    assert 'configure' in answer.message


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
    )
    # Only the silent device has an error.
    silent = [s.name for s in robot.diagnostics[-1].status if s.level == DiagnosticStatus.ERROR]
    assert len(silent) == 1 and 'leg 2' in silent[0]


def test_a_missing_device_is_an_error(robot, devices, context):
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


def test_real_devices_are_refused_in_simulated_time(context, devices):
    overrides = [Parameter('backend', value='device'), Parameter('use_sim_time', value=True)]
    with pytest.raises(
        ConfigError, match='use_sim_time = True is not allowed with backend device'
    ):
        RegulatorNode(context=context, parameter_overrides=overrides)


@pytest.fixture
def options(monkeypatch):
    """Return a list that receives the options of each new simulated regulator."""
    made = []

    @functools.wraps(SimulatedRegulator)
    def make(**own):
        made.append(own)
        return SimulatedRegulator(**own)

    monkeypatch.setitem(BACKENDS, 'simulated', make)
    return made


def test_legs_have_options_of_their_own(robot, options):
    """A list has one value for each leg; a number is for all legs."""
    robot.start(
        legs=[1, 2],
        **{'backend_options.hose_length': [0.5, 20.0], 'backend_options.hose_diameter': 0.001},
    )
    assert [each['hose_length'] for each in options] == [0.5, 20.0]
    assert [each['hose_diameter'] for each in options] == [0.001, 0.001]


def test_a_list_that_does_not_fit_the_legs_is_refused(robot):
    with pytest.raises(ConfigError, match=r'hose_length = \[1.0, 2.0, 3.0\] .* one for each leg'):
        robot.start(legs=[1, 2], **{'backend_options.hose_length': [1.0, 2.0, 3.0]})


def test_volumes_and_hoses_are_options_of_the_simulated_backend(robot):
    robot.start(**{'backend_options.hose_length': 20.0, 'backend_options.hose_diameter': 0.001})
    robot.hold(60e3, 0.1)
    assert robot.gauge() < 30e3  # a long thin hose is slow


def test_options_overrule_hose_and_faults_of_a_scene(robot, options, tmp_path):
    path = tmp_path / 'mine.yaml'
    text = configuration.locate('scenes', 'hexapod_patches').read_text()
    path.write_text(
        text.replace('hose_length: 1.0 ', 'hose_length: 3.0 ') + '\nfaults:\n'
        '  - {kind: leak, legs: [2], start: 1.5, conductance: 1.0e-9}\n'
        '  - {kind: force_dead, legs: [2], start: 1.5}\n'
    )
    robot.start(legs=[1, 2], scene=str(path), **{'backend_options.hose_diameter': 0.002})
    sound, leaking = options
    for each in (sound, leaking):
        assert each['hose_length'] == 3.0  # from the scene
        assert each['hose_diameter'] == 0.002
    assert not sound['faults']
    (fault,) = leaking['faults']
    assert (fault.kind, fault.start, fault.conductance) == ('leak', 1.5, 1e-9)


def test_a_scene_gives_no_options_to_other_backends(robot, devices):
    """Other backends have no hose and would refuse its options."""
    robot.start(simulated=False, backend='device', scene='hexapod_patches')
    assert len(devices()) == 2


# Fault of leg 1, time from which it can be seen, s, and first words of its report.
FAULTS = {
    'leak': (
        '{kind: leak, legs: [1], start: 1.5, conductance: 1.0e-8}', 1.5, 'sags: ',
    ),
    'silence': (
        '{kind: silence, legs: [1], start: 1.5, end: 2.4}', 1.5,
        'the simulated regulator does not answer',
    ),
}  # fmt: skip


@pytest.mark.parametrize('case', FAULTS)
def test_each_fault_is_reported_within_a_second(robot, case):
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
    at, message = robot.reported('leg 1')
    assert visible <= at <= visible + 1.0
    assert message.startswith(words)
    assert robot.reported('leg 2') is None
    assert robot.reported('supply') is None  # one pad shows no loss of supply
    if case != 'silence':
        assert answered.refused == 0  # the fault is only reported


def test_a_low_supply_has_a_status_of_its_own(robot):
    robot.start(**{'backend_options.faults': ['{kind: supply_loss, start: 1.0}']})
    robot.walk([(60e3, 50e3, 2.4)])
    at, message = robot.reported('supply')
    # The supply falls from 100 kPa with a time constant of 1 s: to 60 kPa in 0.51 s, 50 in 0.69 s.
    assert 1.69 < at <= 2.69
    assert message == 'the supply of air is low: pads of legs 1, 2 are below their set-points'
    assert robot.status(2).level == DiagnosticStatus.ERROR
    assert [s.name for s in robot.diagnostics[0].status] == [
        'regulator: leg 1 regulator', 'regulator: leg 2 regulator', 'regulator: supply',
    ]  # fmt: skip


def test_diagnostics_of_sound_pads_come_each_second_and_when_commands_stop(robot):
    robot.start()
    robot.walk([(60e3, 0.0, 0.5), (0.0, 88e3, 0.5), (90e3, 20e3, 1.0), (0.0, 90e3, 1.0)])
    robot.tick(2.0)
    robot.until(lambda: nanoseconds(robot.diagnostics[-1].header.stamp) >= 5e9)
    assert robot.reported('') is None
    levels = {
        (nanoseconds(array.header.stamp) // MS, status.level)
        for array in robot.diagnostics
        for status in array.status
        if 'leg 1 ' in status.name
    }
    # OK is published each second, and STALE at once after 0.5 s without set-points.
    assert sorted(levels) == [
        *((at, DiagnosticStatus.OK) for at in (10, 1000, 2000, 3000)),
        *((at, DiagnosticStatus.STALE) for at in (3500, 4000, 5000)),
    ]


def test_a_faulty_pad_is_held_until_the_node_is_activated_again(robot, capfd):
    leak = '{kind: leak, legs: [1], start: 1.0, end: 2.5, conductance: 1.0e-8}'
    robot.start(on_fault='vent', **{'backend_options.faults': [leak]})
    robot.walk([(60e3, 40e3, 2.0)])
    channel = robot.regulator.channels[1]
    assert channel.regulator.read().setpoint == 0.0
    assert robot.gauge(2) == pytest.approx(40e3, abs=500.0)
    assert 0 < channel.refused == 100 - channel.accepted
    status = robot.status()
    assert status.level == DiagnosticStatus.ERROR
    assert status.message.startswith('sags: ')
    assert 'vented until' in status.message
    assert 'leg 1: vented: sags: ' in capfd.readouterr().err
    robot.walk([(60e3, 40e3, 0.5)])  # the leak has ended, but the pad is held
    assert robot.gauge() < 1e3
    assert robot.call(Trigger, 'regulator/vent', Trigger.Request()).success
    assert robot.transit(Transition.TRANSITION_ACTIVATE)
    robot.diagnostics.clear()
    robot.walk([(60e3, 40e3, 1.0)])
    assert robot.gauge() == pytest.approx(60e3, abs=500.0)
    assert robot.reported('leg 1', DiagnosticStatus.OK)
    assert robot.reported('leg 1') is None


def test_a_reaction_can_be_chosen_while_the_pad_is_faulty(robot):
    robot.start(**{'backend_options.faults': ['{kind: stuck_valve, legs: [1]}']})
    robot.walk([(60e3, 60e3, 1.0)])
    assert robot.regulator.channels[1].refused == 0
    assert robot.set('on_fault', 'vent').successful
    robot.tick(0.02)
    robot.send(60e3)
    assert robot.regulator.channels[1].refused == 1


def test_a_reading_that_is_not_finite_is_not_published(robot, devices):
    robot.start(simulated=False, backend='device')
    count = len(robot.pressures[1])
    devices()[0].reads = math.nan
    robot.until(lambda: robot.reported('leg 1'), what='/diagnostics')
    assert 'nan Pa' in robot.reported('leg 1')[1]
    assert all(math.isfinite(each.fluid_pressure) for each in robot.pressures[1][count:])


def test_a_shorter_timeout_acts_at_once(robot):
    robot.start(command_timeout=5.0)
    robot.hold(60e3, 0.5)
    assert robot.set('command_timeout', 0.1).successful
    robot.tick(0.12)
    assert robot.regulator.channels[1].regulator.read().setpoint == 0.0
    refused = robot.set('command_timeout', 100.0)
    assert not refused.successful
    assert 'command_timeout out of range' in refused.reason


def fail_once(monkeypatch, where, name):
    """Let the next call of a method fail with an unexpected error."""
    real = getattr(where, name)

    def fail(*_):
        monkeypatch.setattr(where, name, real)
        raise ZeroDivisionError

    monkeypatch.setattr(where, name, fail)


REASONS = {
    'timeout': 'vented: no set-point for 0.2 s',
    'deactivate': 'vented: the node was deactivated',
    'vent': 'vented: the node was deactivated',
    'shutdown': 'vented: closing the device: the node was shut down',
    'error': 'vented: closing the device: a transition failed',
    'destroy': 'vented: closing the device: the node ends',
}


@pytest.mark.parametrize('end', REASONS)
def test_the_log_has_the_reason_of_a_vent(robot, devices, executor, monkeypatch, capfd, end):
    node = robot.start(simulated=False, backend='device')
    robot.send(50e3, stamp_ns=node.get_clock().now().nanoseconds)
    assert devices()[0].setpoint == 50e3
    if end == 'timeout':
        assert robot.set('command_timeout', 0.2).successful
        robot.until(lambda: devices()[0].setpoint == 0.0, what='the vent')
    elif end == 'vent':
        assert robot.call(Trigger, 'regulator/vent', Trigger.Request()).success
    elif end == 'destroy':
        executor.remove_node(node)
        node.destroy_node()
    elif end == 'error':
        fail_once(monkeypatch, SupervisedChannel, 'deactivate')
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
    count = len(robot.diagnostics)  # there are diagnostics even without devices
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
    culprit = {
        'configure': (Device, 'vent'), 'activate': (SupervisedChannel, 'activate'),
        'deactivate': (SupervisedChannel, 'deactivate'), 'cleanup': (node, 'vent'),
    }  # fmt: skip
    fail_once(monkeypatch, *culprit[failing])
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
    assert 'backend_options.port' in refused.reason and 'clean up' in refused.reason
