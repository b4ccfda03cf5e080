# SPDX-License-Identifier: Apache-2.0
import json
import os
import signal
import time
import warnings

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from helpers import MS, SECOND, SIX, encoded, header, overrides, start_node
from helpers import record as record_of
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

import ros_pad
from ros_pad.bags import BagReader, BagWriter, topics
from ros_pad.errors import BagError
from ros_pad.nodes import qos
from ros_pad.nodes.controller import ControllerNode
from ros_pad.nodes.recorder import RecorderNode
from ros_pad.records import ESTIMATE, SAMPLE, Block
from ros_pad.trials import bag_notes

KEPT = QoSProfile(history=HistoryPolicy.KEEP_ALL)
QUIET = {'start_parameter_services': False, 'enable_rosout': False}


@pytest.fixture
def executor(context):
    executor = EventsExecutor(context=context)
    yield executor
    for node in list(executor.get_nodes()):
        executor.remove_node(node)
        node.destroy_node()
    executor.shutdown()


@pytest.fixture
def robot(context, executor):
    node = Node('robot', context=context, **QUIET)
    executor.add_node(node)
    return node


@pytest.fixture
def record(context, executor, tmp_path):
    def record(**parameters):
        given = overrides({'folder': str(tmp_path / 'trial'), **parameters})
        node = RecorderNode(context=context, parameter_overrides=given, **QUIET)
        executor.add_node(node)
        return node

    return record


def wetness(stamp_ns=0, value=0.0):
    """Return the message of an estimate of all legs."""
    block = record_of(ESTIMATE, stamp_ns, 6, wetness=value)
    return encoded(topics.ESTIMATE, block, SIX)


def wetness_in(folder, name='/feet/estimate'):
    _, times, block = BagReader(folder).records({name: ESTIMATE})[name]
    return times.tolist(), block.stamps.tolist(), block.rows['wetness'][:, 0].tolist()


def custom_data(folder, key):
    """Return a value of the custom data of a bag, also while it is open; None if missing."""
    file = folder / 'metadata.yaml'
    if not file.exists():  # no message yet
        return None
    text = file.read_text(encoding='utf-8')
    end = yaml.safe_load(text[text.index('  custom_data:') :])  # all of it can take seconds
    return json.loads(end['custom_data'].get(key, 'null'))


def test_everything_that_a_robot_has_once_is_recorded(robot, record, until, tmp_path):
    publishers = {
        topic.name().lstrip('/'): qos.publisher(robot, topic) for topic in topics.RECORDED
    }
    recorder = record()
    until(lambda: all(p.get_subscription_count() for p in publishers.values()))
    for round_number in range(1, 21):
        for publisher in publishers.values():
            publisher.publish(publisher.msg_type())  # a record without names is kept, too
        until(lambda n=round_number: recorder.message_count == n * len(publishers))
    recorder.describe({'outcome': 'done'})
    recorder.close()
    reader = BagReader(tmp_path / 'trial')
    assert reader.counts == {f'/{name}': 20 for name in publishers}
    assert reader.topics == {
        f'/{topic.name().lstrip("/")}': topic.type_name for topic in topics.RECORDED
    }
    assert reader.custom_data['outcome'] == 'done'
    assert json.loads(reader.custom_data[bag_notes.LOST]) == {}
    assert json.loads(reader.custom_data[bag_notes.MADE_WITH])['ros_pad'] == ros_pad.__version__


@pytest.mark.parametrize('simulated', [False, True])
def test_each_record_of_a_block_is_written_alone(robot, record, until, tmp_path, simulated):
    """With its own stamp, and a log time as far before that of the last one."""
    recorder = record(use_sim_time=simulated)
    publisher = qos.publisher(robot, topics.SAMPLE)
    until(lambda: publisher.get_subscription_count())
    rows = SAMPLE.rows(5, 6)
    rows['force'] = np.arange(15.0).reshape(5, 1, 3)
    stamps = SECOND + 4 * MS * np.arange(5)
    before = time.time_ns()
    publisher.publish(encoded(topics.SAMPLE, Block(stamps, rows), SIX))
    until(lambda: recorder.message_count == 5)
    recorder.close()
    _, times, block = BagReader(tmp_path / 'trial').records({'/feet/sample': SAMPLE})[
        '/feet/sample'
    ]
    assert block.stamps.tolist() == stamps.tolist()
    assert block.rows.tobytes() == rows.tobytes()
    assert np.diff(times).tolist() == [4 * MS] * 4
    if simulated:
        assert times.tolist() == stamps.tolist()
    else:
        assert before <= times[-1] <= time.time_ns()


def test_what_is_no_record_is_kept_and_reported(robot, record, until, tmp_path):
    recorder = record()
    publisher = qos.publisher(robot, topics.SAMPLE)
    until(lambda: publisher.get_subscription_count())
    wrong = JointState(name=['knee'], position=[1.0])
    publisher.publish(wrong)
    until(lambda: recorder.message_count == 1)
    recorder.close()
    ((_, message, _),) = BagReader(tmp_path / 'trial').messages()
    assert list(message.name) == ['knee']
    assert recorder.refused == {'/feet/sample': 1}


def test_what_has_arrived_is_written_at_the_end(context, robot, record, until, tmp_path):
    """The recorder takes messages ten times a second; here it ends before it does."""
    recorder = record()
    publisher, heard = qos.publisher(robot, topics.ESTIMATE), []
    qos.subscription(robot, topics.ESTIMATE, heard.append)
    until(lambda: publisher.get_subscription_count() == 2)
    other = SingleThreadedExecutor(context=context)  # the recorder is not spun any more
    recorder.executor.remove_node(robot)
    other.add_node(robot)
    while len(heard) < 20:
        publisher.publish(wetness(1))
        other.spin_once(timeout_sec=0.1)
    other.remove_node(robot)
    recorder.close()
    assert BagReader(tmp_path / 'trial').counts['/feet/estimate'] > 0


def on_disk(folder, topic):
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        try:
            return BagReader(folder).counts[topic]
        except BagError:  # no bag yet
            return 0


def test_a_last_message_reaches_the_disk_although_none_follows(robot, record, until, tmp_path):
    recorder = record()
    publisher = qos.publisher(robot, topics.ESTIMATE)
    until(lambda: publisher.get_subscription_count())
    for number in (1, 2):
        publisher.publish(wetness(number))
        until(lambda n=number: recorder.message_count == n)
    until(lambda: on_disk(tmp_path / 'trial', '/feet/estimate') == 2)
    # It was on disk before close(), and close() does not write it twice.
    recorder.close()
    assert BagReader(tmp_path / 'trial').counts['/feet/estimate'] == 2


def test_the_parameters_of_the_nodes_and_their_changes_are_in_the_bag(
    context, executor, robot, record, until, tmp_path
):
    def controller(margin):
        node = ControllerNode(context=context, parameter_overrides=overrides({'margin': margin}))
        executor.add_node(node)
        return node

    def changes():
        return custom_data(tmp_path / 'trial', bag_notes.CHANGES) or []

    before, node, recorder = time.time_ns(), controller(1.3), record()
    until(lambda: '/controller' in (custom_data(tmp_path / 'trial', bag_notes.PARAMETERS) or {}))
    nonsense = qos.publisher(robot, topics.PARAMETERS)
    until(nonsense.get_subscription_count)
    for text in ('no JSON', '[1]', '{"/controller": 3}'):
        nonsense.publish(String(data=text))
    until(lambda: recorder.refused == {'/parameters': 3})
    assert node.set_parameters([Parameter('margin', value=1.5)])[0].successful
    until(changes)
    executor.remove_node(node)
    node.destroy_node()
    controller(1.7)  # it comes back with another value
    until(lambda: len(changes()) == 2)
    recorder.close()
    times, *rest = zip(*changes(), strict=True)
    assert rest == [('/controller',) * 2, ('margin',) * 2, (1.5, 1.7)]
    assert before <= times[0] <= times[1] <= time.time_ns()
    parameters = json.loads(BagReader(tmp_path / 'trial').custom_data[bag_notes.PARAMETERS])
    assert set(parameters) == {'/controller', '/recorder'}
    assert parameters['/controller']['margin'] == 1.3
    assert parameters['/controller']['legs'] == list(SIX)


@pytest.mark.slow
def test_messages_that_do_not_come_are_counted(robot, until, tmp_path):
    driver = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    publisher = robot.create_publisher(PoseStamped, 'body/pose', driver)
    process = start_node('recorder', f'folder:={tmp_path / "trial"}')
    sent = 0
    statuses = []
    qos.subscription(robot, topics.DIAGNOSTICS, lambda array: statuses.extend(array.status))

    def send(count):
        nonlocal sent
        for _ in range(count):
            publisher.publish(PoseStamped())
        sent += count

    try:
        until(lambda: publisher.get_subscription_count())
        until(lambda: send(1) or on_disk(tmp_path / 'trial', '/body/pose'))
        os.kill(process.pid, signal.SIGSTOP)
        send(20_000)  # more than all queues hold
        os.kill(process.pid, signal.SIGCONT)
        before = on_disk(tmp_path / 'trial', '/body/pose')
        # The middleware detects lost messages when a later one arrives.
        until(lambda: send(1) or on_disk(tmp_path / 'trial', '/body/pose') > before)
        until(lambda: statuses, what='a report of lost messages')
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    reader = BagReader(tmp_path / 'trial')
    (lost,) = json.loads(reader.custom_data[bag_notes.LOST]).items()
    assert lost[0] == '/body/pose'
    assert lost[1] > 1000
    # Messages sent before discovery or while the recorder ends are not counted as lost.
    assert sent - 50 <= lost[1] + reader.counts['/body/pose'] <= sent
    assert 'messages lost so far' in errors
    (value,) = statuses[0].values
    assert (statuses[0].name, statuses[0].level) == (
        'recorder: lost messages', DiagnosticStatus.WARN,
    )  # fmt: skip
    assert statuses[0].message == f'too slow: {value.value} messages lost so far'
    assert (value.key, 0 < int(value.value) <= lost[1]) == ('/body/pose', True)


def test_simulated_time_is_that_of_stamps_and_of_the_clock(robot, record, until, tmp_path):
    recorder = record(use_sim_time=True)
    clock, estimate, doubt, pose = (
        qos.publisher(robot, topic)
        for topic in (topics.CLOCK, topics.ESTIMATE, topics.BODY_DOUBT, topics.BODY_POSE)
    )
    until(lambda: all(p.get_subscription_count() for p in (clock, estimate, doubt, pose)))

    def send(publisher, message):
        count = recorder.message_count
        publisher.publish(message)
        until(lambda: recorder.message_count > count)

    for time_ns in (4 * MS, 3_000 * SECOND + 999_999_999):
        send(doubt, String())
        send(clock, Clock(clock=header(time_ns).stamp))
        send(doubt, String())
        send(estimate, wetness(time_ns + MS))
        send(pose, PoseStamped(header=header(time_ns - MS)))
    send(estimate, wetness(-5 * SECOND))
    recorder.close()
    late = 3_000 * SECOND + 999_999_999
    found = {}
    for topic, _, at in BagReader(tmp_path / 'trial').messages():
        found.setdefault(topic, []).append(at)
    assert found == {
        '/clock': [4 * MS, late],
        '/body/doubt': [0, 4 * MS, 4 * MS, late],
        '/feet/estimate': [5 * MS, late + MS, 0],  # a bag has no times before 0
        '/body/pose': [3 * MS, late - MS],
    }


def test_a_full_disk_is_not_silent(robot, record, until, monkeypatch):
    def write(*_):
        raise BagError('7 messages are saved')

    monkeypatch.setattr(BagWriter, 'write', write)
    recorder = record()
    publisher = qos.publisher(robot, topics.ESTIMATE)
    until(lambda: publisher.get_subscription_count())
    publisher.publish(wetness())
    with pytest.raises(BagError, match='7 messages are saved'):
        until(lambda: False)
    recorder.close()


@pytest.mark.parametrize('number_of_signal', [signal.SIGINT, signal.SIGTERM])
def test_signals_close_the_bag(number_of_signal, robot, until, tmp_path):
    publisher = robot.create_publisher(JointState, 'feet/estimate', KEPT)
    folder = tmp_path / 'trial'
    process = start_node('recorder', f'folder:={folder}', 'reliable:=true')
    try:
        until(lambda: publisher.get_subscription_count())
        for number in range(100):
            publisher.publish(wetness(number, float(number)))

        def recorded():  # a message a second later causes the flush to the file
            publisher.publish(wetness(1000, 100.0))
            return on_disk(folder, '/feet/estimate') > 100

        until(recorded)
        process.send_signal(number_of_signal)
        _, errors = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    assert 'Traceback' not in errors
    assert BagReader(folder).problem is None
    _, _, values = wetness_in(folder)
    assert values[:100] == list(map(float, range(100)))
    assert set(values[100:]) == {100.0}
