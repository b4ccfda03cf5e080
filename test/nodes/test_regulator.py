# SPDX-License-Identifier: Apache-2.0
"""The regulator node: commands in, pressures out, life cycle, faults, and every way to a vent."""

import dataclasses
import functools
import math
import re

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from helpers import MS, SECOND, command, overrides
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import SetParameters
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from shared import Device
from std_srvs.srv import Trigger

from ros_pad import configuration
from ros_pad.bags import topics
from ros_pad.control.faults import Kind
from ros_pad.errors import ConfigError, TransportError
from ros_pad.nodes import regulator as module
from ros_pad.nodes.regulator import RegulatorNode
from ros_pad.regulators import BACKENDS, SimulatedRegulator
from ros_pad.regulators.channel import SupervisedChannel

ERROR, WARN, OK, STALE = (
    getattr(DiagnosticStatus, each) for each in ('ERROR', 'WARN', 'OK', 'STALE')
)
NONE = math.nan


class Robot:
    """A regulator node on a bench, and commands for it."""

    def __init__(self, bench):
        self.bench = bench

    def start(self, simulated=True, **parameters):
        # In real time, commands must not time out on a slow machine.
        patience = {} if simulated else {'command_timeout': 5.0}
        parameters = {'use_sim_time': simulated, **patience, **parameters}
        self.node = self.bench.start(RegulatorNode, **parameters)
        return self.node

    @property
    def pressures(self):
        """Rows of all pressure records."""
        return np.array([block.rows[-1] for block in self.bench.heard(topics.PRESSURE)])

    def send(self, *gauges, age=0.0):
        """Send a command for each leg, Pa gauge."""
        now_ns = self.node.now_ns()
        self.bench.give(topics.COMMAND, command(now_ns - round(age * 1e9), gauges))

    def hold(self, seconds, *gauges):
        """Command pressures as a controller does, every 20 ms."""
        for _ in range(round(seconds / 0.02)):
            self.send(*gauges)
            self.bench.tick(0.02)

    def channel(self, leg):
        return next(each for each in self.node.supervision.channels if each.leg == leg)

    def device(self, leg=1):
        return self.channel(leg).regulator

    def gauge(self, leg=1):
        """Return the pressure of a pad now, Pa gauge."""
        return self.device(leg).read().pressure

    def counts(self, leg=1):
        answers = self.channel(leg).answers
        return answers.accepted, answers.refused

    def reported(self, name, level=ERROR):
        """Return time, s, and message of the first status with name and level, or None."""
        found = self.bench.statuses(name)
        return next(((at, each.message) for at, each in found if each.level == level), None)

    def vent(self):
        return self.bench.call('/vent', Trigger.Request())

    def transit(self, name):
        return getattr(self.node, f'trigger_{name}')() == TransitionCallbackReturn.SUCCESS

    def state(self):
        return self.node._state_machine.current_state[0]


@pytest.fixture
def robot(bench):
    return Robot(bench)


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


def test_a_command_becomes_the_pressure_of_its_pad_alone(robot):
    robot.start()
    robot.hold(1.0, 60e3, NONE)
    assert robot.gauge(1) == pytest.approx(60e3, abs=500.0)  # dead band, 0.5 % of full scale
    assert robot.gauge(2) == 0.0
    first, second = robot.pressures[-1]
    assert first['pressure'] == first['pad'] == pytest.approx(60e3, abs=500.0)
    assert (first['setpoint'], first['fault']) == (60e3, 0.0)
    assert (second['pressure'], second['setpoint']) == (0.0, 0.0)


def test_each_command_is_answered_at_its_moment(robot):
    """Without a message of /clock, too: the stamps of commands are the time."""
    robot.start()
    for number in range(1, 6):
        robot.bench.give(topics.COMMAND, command(20 * MS * number, 30e3))
    stamps = [block.last_ns for block in robot.bench.heard(topics.PRESSURE)]
    assert stamps == [20 * MS * number for number in range(1, 6)]
    assert robot.counts() == (5, 0)


def test_records_ahead_of_the_clock_and_late_ones_vent_nothing(robot):
    """Simulated time seems to go back where a record came before /clock."""
    robot.start()
    robot.hold(0.5, 60e3, 40e3)
    for ahead_ms in (80, 40, 150, 0, 80):
        stamp_ns = robot.bench.now_ns + ahead_ms * MS
        robot.bench.give(topics.COMMAND, command(stamp_ns, (60e3, 40e3)))
        assert robot.device(1).read().setpoint == 60e3
    assert [robot.counts(leg) for leg in (1, 2)] == [(30, 0)] * 2


@pytest.mark.parametrize('missing', [NONE, -5.0, 1e6, math.inf])
def test_a_row_that_is_missing_or_invalid_concerns_its_leg_only(robot, missing):
    robot.start()
    robot.hold(0.5, 60e3, 40e3)
    robot.hold(0.48, missing, 40e3)
    assert robot.device().read().setpoint == 60e3
    robot.hold(0.04, missing, 40e3)
    assert robot.device().read().setpoint == 0.0  # command_timeout
    robot.hold(0.5, missing, 40e3)
    assert robot.gauge(1) < 1e3
    assert robot.gauge(2) == pytest.approx(40e3, abs=500.0)
    assert robot.counts(2) == (76, 0)


def test_a_bad_setpoint_is_refused_and_reported(robot, devices):
    robot.start(simulated=False, backend='device', ceiling=80e3)
    robot.send(30e3, 20e3)
    robot.send(80001.0, NONE)
    assert (robot.counts(1), robot.counts(2)) == ((1, 1), (1, 0))
    robot.send(50e3, 50e3, age=7.0)
    assert (robot.counts(1), robot.counts(2)) == ((1, 2), (1, 1))
    assert [each.setpoint for each in devices()] == [30e3, 20e3]
    robot.bench.until(lambda: robot.reported('leg 1', WARN), what='the report')
    (_, status), *_ = [each for each in robot.bench.statuses('leg 1') if each[1].level == WARN]
    assert re.match(r'stamp of the set-point is [7-9]\S* s old: at most 5 s', status.message)
    assert {each.key: each.value for each in status.values}['set-points refused'] == '2'


def test_a_vent_lasts_until_the_next_activation(robot):
    robot.start()
    robot.hold(0.6, 60e3, 40e3)
    answer = robot.vent()
    assert answer.success
    assert 'activated again' in answer.message
    count = len(robot.pressures)
    robot.hold(1.0, 60e3, 40e3)  # the controller goes on
    assert (robot.gauge(1) < 1e3, robot.gauge(2) < 1e3) == (True, True)
    assert len(robot.pressures) == count + 51  # by the clock
    assert robot.transit('activate')
    robot.hold(0.6, 60e3, 40e3)
    assert robot.gauge() > 59e3


def test_the_life_of_the_node(robot, context, executor):
    """By services, as operators do."""
    node, client = robot.start(autostart=False), Node('client', context=context)
    executor.add_node(client)

    def call(service, name, request):
        caller = client.create_client(service, f'regulator/{name}')
        robot.bench.until(caller.service_is_ready, what=name)
        future = caller.call_async(request)
        robot.bench.until(future.done, what=name)
        return future.result()

    def transit(name):
        number = getattr(Transition, f'TRANSITION_{name}')
        request = ChangeState.Request(transition=Transition(id=number))
        assert call(ChangeState, 'change_state', request).success
        answer = call(GetState, 'get_state', GetState.Request())
        return answer.current_state.id

    assert robot.state() == State.PRIMARY_STATE_UNCONFIGURED
    assert not node.supervision.channels
    robot.send(60e3, NONE)  # nobody hears it
    assert transit('CONFIGURE') == State.PRIMARY_STATE_INACTIVE
    robot.hold(0.2, 60e3, NONE)
    assert (robot.counts(), robot.gauge()) == ((0, 0), 0.0)
    assert len(robot.pressures)  # also while inactive
    assert transit('ACTIVATE') == State.PRIMARY_STATE_ACTIVE
    robot.hold(0.6, 60e3, NONE)
    assert robot.gauge() > 59e3
    assert transit('DEACTIVATE') == State.PRIMARY_STATE_INACTIVE
    robot.bench.tick(1.0)
    assert robot.gauge() < 1e3
    devices = [channel.regulator for channel in node.supervision.channels]
    assert transit('CLEANUP') == State.PRIMARY_STATE_UNCONFIGURED
    for device in devices:
        with pytest.raises(TransportError, match='not open'):
            device.read()
    assert transit('CONFIGURE') == State.PRIMARY_STATE_INACTIVE
    assert transit('ACTIVATE') == State.PRIMARY_STATE_ACTIVE
    changed = SetParameters.Request(
        parameters=[Parameter('command_timeout', value=100.0).to_parameter_msg()]
    )
    (result,) = call(SetParameters, 'set_parameters', changed).results
    assert not result.successful and 'command_timeout out of range' in result.reason
    robot.hold(0.6, 50e3, NONE)
    assert robot.gauge() > 49e3
    assert call(Trigger, 'vent', Trigger.Request()).success
    assert transit('INACTIVE_SHUTDOWN') == State.PRIMARY_STATE_FINALIZED
    assert not node.supervision.channels


# How the pads are vented, and the reason in the log.
ENDS = {
    'timeout': 'vented: no set-point for 0.2 s',
    'deactivate': 'vented: the node was deactivated',
    'cleanup': 'vented: the node was deactivated',
    'vent': 'vented: the node was deactivated',
    'shutdown': 'vented: closing the device: the node was shut down',
    'error': 'vented: closing the device: a transition failed',
    'destroy': 'vented: closing the device: the node ends',
}


@pytest.mark.parametrize('end', ENDS)
def test_every_end_vents_and_the_log_has_the_reason(robot, devices, monkeypatch, capfd, end):
    robot.start(simulated=False, backend='device')
    assert [device.setpoint for device in devices()] == [0.0, 0.0]  # vented when opened
    robot.send(50e3, 50e3)
    assert [device.setpoint for device in devices()] == [50e3, 50e3]
    if end == 'timeout':
        assert robot.bench.set('command_timeout', 0.2).successful
        robot.bench.until(lambda: devices()[1].setpoint == 0.0, what='the vent')
    elif end == 'destroy':
        robot.bench.stop()
    elif end == 'vent':
        assert robot.vent().success
    elif end == 'shutdown':
        assert robot.transit('shutdown')
    else:
        if end == 'error':
            fail_once(monkeypatch, SupervisedChannel, 'deactivate')
        assert robot.transit('deactivate') == (end != 'error')
        if end == 'cleanup':
            assert robot.transit('cleanup')
    assert [device.setpoint for device in devices()] == [0.0, 0.0]
    closed = end in ('cleanup', 'destroy', 'shutdown', 'error')
    assert [device.is_open for device in devices()] == [not closed] * 2
    assert f'leg 1: {ENDS[end]}' in capfd.readouterr().err


def test_a_broken_cable_does_not_keep_the_other_pads_up(robot, devices):
    robot.start(simulated=False, backend='device')
    robot.send(50e3, 50e3)
    first, second = devices()
    real_read, first.read = first.read, second.read  # only commands are lost
    first.broken = OSError(5, 'cable')
    answer = robot.vent()
    assert not answer.success
    assert 'leg 1' in answer.message
    assert (first.setpoint, second.setpoint) == (50e3, 0.0)
    first.broken, first.read = None, real_read  # the node still tries to vent
    robot.bench.until(lambda: first.setpoint == 0.0, what='the vent')


def test_a_silent_device_is_an_error_on_diagnostics_and_missing_in_records(robot, devices):
    robot.start(simulated=False, backend='device')
    devices()[1].broken = TransportError('the line is silent')
    robot.bench.until(lambda: robot.reported('leg 2'))
    assert robot.reported('leg 2')[1] == 'the line is silent'
    assert robot.reported('leg 1') is None
    robot.bench.until(lambda: np.isnan(robot.pressures[-1]['pressure'][1]))
    assert robot.pressures[-1]['pressure'][0] == 0.0
    assert robot.pressures[-1]['fault'].tolist() == [0.0, Kind.DEVICE.code]


def test_a_port_can_be_corrected_and_tried_again(robot, devices, capfd):
    port = {'backend_options.port': 'none'}
    node = robot.start(simulated=False, backend='device', autostart=False, **port)
    assert not robot.transit('configure')
    assert "node regulator: no such port: 'none'" in capfd.readouterr().err
    assert robot.bench.set('backend_options.port', 'usb').successful
    assert robot.transit('configure')
    assert [channel.regulator.port for channel in node.supervision.channels] == [
        'usb',
        'usb',
    ]
    settings = robot.channel(1).settings
    changes = {'command_timeout': 0.1, 'backend_options.port': 'other'}
    refused = node.set_parameters_atomically(overrides(changes))
    assert not refused.successful
    assert robot.channel(1).settings == settings
    assert node.values['command_timeout'] != 0.1
    assert 'clean up the node first' in refused.reason


def test_real_devices_are_refused_in_simulated_time(context, devices):
    given = overrides({'backend': 'device', 'use_sim_time': True})
    with pytest.raises(ConfigError, match='use_sim_time = True is not allowed with backend devi'):
        RegulatorNode(context=context, parameter_overrides=given)


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
        **{'backend_options.hose_length': [0.5, 20.0], 'backend_options.hose_diameter': 0.001}
    )
    assert [each['hose_length'] for each in options] == [0.5, 20.0]
    assert [each['hose_diameter'] for each in options] == [0.001, 0.001]
    robot.hold(0.1, 60e3, 60e3)
    assert robot.gauge(2) < 0.5 * robot.gauge(1)  # a long thin hose is slow


def test_options_overrule_hose_and_faults_of_a_scene(robot, options, tmp_path):
    path = tmp_path / 'mine.yaml'
    text = configuration.locate('scenes', 'hexapod_patches').read_text()
    path.write_text(
        text.replace('hose_length: 1.0 ', 'hose_length: 3.0 ') + '\nfaults:\n'
        '  - {kind: leak, legs: [2], start: 1.5, conductance: 1.0e-9}\n'
        '  - {kind: force_dead, legs: [2], start: 1.5}\n'
    )
    robot.start(scene=str(path), **{'backend_options.hose_diameter': 0.002})
    sound, leaking = options
    for each in (sound, leaking):
        assert each['hose_length'] == 3.0  # from the scene
        assert each['hose_diameter'] == 0.002
    assert not sound['faults']
    (fault,) = leaking['faults']
    assert (fault.kind, fault.start, fault.conductance) == ('leak', 1.5, 1e-9)


def test_diagnostics_of_sound_pads_come_each_second_and_when_commands_stop(robot):
    robot.start()
    for one, two, seconds in ((60e3, 0.0, 0.5), (0.0, 88e3, 0.5), (90e3, 20e3, 1.0), (0, 90e3, 1)):
        robot.hold(seconds, one, two)
    robot.bench.tick(2.0)
    assert robot.reported('') is None
    levels = [(round(at * 1e3), each.level) for at, each in robot.bench.statuses('leg 1')]
    # OK is published each second, and STALE at once after 0.5 s without set-points.
    assert levels == [
        (0, STALE), *((at, OK) for at in (100, 1000, 2000, 3000)),
        *((at, STALE) for at in (3500, 4000, 5000)),
    ]  # fmt: skip


@pytest.mark.parametrize('timeout', [0.03, 0.3])
def test_the_clock_vents_at_the_timeout(robot, timeout):
    """In simulated time, too, where records are the moments of all else."""
    robot.start(command_timeout=timeout)
    robot.hold(0.5, 60e3, NONE)
    robot.send(60e3, NONE)
    last_ns = robot.bench.now_ns
    while robot.device().read().setpoint:
        robot.bench.tick(0.01)
    assert robot.bench.now_ns - last_ns == pytest.approx((timeout + 0.01) * SECOND)


def fail_once(monkeypatch, where, name):
    """Let the next call of a method fail with an unexpected error."""
    real = getattr(where, name)

    def fail(*_):
        monkeypatch.setattr(where, name, real)
        raise ZeroDivisionError

    monkeypatch.setattr(where, name, fail)


@pytest.mark.parametrize('failing', ['configure', 'activate', 'deactivate', 'cleanup'])
def test_after_a_transition_that_fails_it_can_be_configured_again(
    robot, devices, monkeypatch, failing
):
    node = robot.start(simulated=False, backend='device', autostart=False)
    names = ['configure', 'activate', 'deactivate', 'cleanup']
    assert all(map(robot.transit, names[: names.index(failing)]))
    culprit = {
        'configure': (Device, 'vent'), 'activate': (SupervisedChannel, 'activate'),
        'deactivate': (SupervisedChannel, 'deactivate'), 'cleanup': (SupervisedChannel, 'close'),
    }  # fmt: skip
    fail_once(monkeypatch, *culprit[failing])
    assert not robot.transit(failing)
    assert robot.state() == State.PRIMARY_STATE_UNCONFIGURED
    assert not node.supervision.channels
    assert devices()
    assert not any(each.is_open for each in devices())
    assert robot.transit('configure')
    assert robot.transit('activate')
    robot.send(50e3, NONE)
    assert devices()[-2].setpoint == 50e3
