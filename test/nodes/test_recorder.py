# SPDX-License-Identifier: Apache-2.0
import json
import os
import re
import signal
import subprocess
import sys
import time
import warnings

import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from rcl_interfaces.msg import Parameter as RosParameter
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.msg import ParameterValue
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import HistoryPolicy
from rclpy.qos import QoSProfile
from rclpy.qos import ReliabilityPolicy
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64
from std_msgs.msg import String

import ros_pad
from ros_pad.bags import BagReader
from ros_pad.bags import BagWriter
from ros_pad.errors import BagError
from ros_pad.errors import ConfigError
from ros_pad.nodes import qos
from ros_pad.nodes import topics
from ros_pad.nodes.recorder import RecorderNode
from ros_pad.trials import label

QUIET = {'start_parameter_services': False, 'enable_rosout': False}


@pytest.fixture(
    params=[pytest.param(SingleThreadedExecutor, marks=pytest.mark.slow), EventsExecutor],
    ids=['single', 'events'],
)
def executor(request, context):
    executor = request.param(context=context)
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
        parameters = {'folder': str(tmp_path / 'trial'), **parameters}
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        node = RecorderNode(context=context, parameter_overrides=overrides, **QUIET)
        executor.add_node(node)
        return node

    return record


def data_on(folder, topic):
    return [message.data for _, message, _ in BagReader(folder).messages({topic})]


def custom_data(folder, key):
    """Return a value of the custom data of a bag, also while it is open; None if missing."""
    file = folder / 'metadata.yaml'
    if not file.exists():  # no message yet
        return None
    text = file.read_text(encoding='utf-8')
    end = yaml.safe_load(text[text.index('  custom_data:') :])  # all of it can take seconds
    return json.loads(end['custom_data'].get(key, 'null'))


@pytest.fixture
def destroy(executor, until):
    """Destroy a node while its executor goes on, but only after the executor dropped its services.

    The events executor drops services with its next events. Before that it would accept a request
    and find no service for the response.
    """

    def destroy(node):
        executor.remove_node(node)
        dropped = executor.create_task(lambda: None)
        until(dropped.done)
        node.destroy_node()

    return destroy


def test_everything_that_is_published_is_recorded(robot, record, until, tmp_path):
    publishers = {
        topics.LEG_TOPICS[0].name(leg).replace('pressure', name): publisher
        for leg in (1, 4)
        for name, publisher in [
            (topic.name(leg).split('/')[1], topic.publisher(robot, leg))
            for topic in topics.LEG_TOPICS
        ]
    } | {topic.name().lstrip('/'): topic.publisher(robot) for topic in topics.COMMON_TOPICS}
    assert len(publishers) == 2 * 15 + 8
    recorder = record(legs=[1, 4])
    until(lambda: all(p.get_subscription_count() for p in publishers.values()))
    for round_number in range(1, 21):
        for publisher in publishers.values():
            publisher.publish(publisher.msg_type())
        until(lambda n=round_number: recorder.message_count == n * len(publishers))
    recorder.close({'outcome': 'done'})
    reader = BagReader(tmp_path / 'trial')
    assert reader.counts == {f'/{name}': 20 for name in publishers}
    assert reader.custom_data['outcome'] == 'done'
    assert reader.custom_data[label.RECORDED_AT] == 'receiver'
    assert json.loads(reader.custom_data[label.LOST]) == {}
    assert json.loads(reader.custom_data[label.MADE_WITH])['ros_pad'] == ros_pad.__version__
    assert {f'/{topic.name(4)}': topic.type_name for topic in topics.LEG_TOPICS} == {
        name: type_name for name, type_name in reader.topics.items() if 'leg_4' in name
    }


def test_messages_that_publishers_hand_over_are_recorded_once(
    robot, executor, context, until, tmp_path
):
    """Such a recorder does not subscribe: what comes through DDS is not recorded."""
    folder = Parameter('folder', value=str(tmp_path / 'trial'))
    recorder = RecorderNode(
        subscribes=False, context=context, parameter_overrides=[folder], **QUIET
    )
    executor.add_node(recorder)
    assert not [each for each in recorder.subscriptions if 'leg_' in each.topic_name]
    publisher = topics.WETNESS.publisher(robot, 1)
    for number in range(3):
        message = serialize_message(Float64(data=float(number)))
        recorder.record('/leg_1/wetness', message)
        publisher.publish(message)
    ticks = []
    robot.create_timer(0.1, lambda: ticks.append(1))
    until(lambda: len(ticks) == 3)
    assert recorder.message_count == 3
    with pytest.raises(KeyError):
        recorder.record('/leg_7/wetness', message)
    recorder.close()
    assert data_on(tmp_path / 'trial', '/leg_1/wetness') == [0.0, 1.0, 2.0]
    assert BagReader(tmp_path / 'trial').custom_data[label.RECORDED_AT] == 'publisher'


def test_a_burst_is_recorded_whole_and_in_order(robot, record, until, tmp_path):
    publisher = robot.create_publisher(Float64, 'leg_2/wetness', qos.RECORD)
    recorder = record()
    until(lambda: publisher.get_subscription_count())
    for number in range(900):
        publisher.publish(Float64(data=float(number)))
    until(lambda: recorder.message_count == 900)
    recorder.close()
    assert data_on(tmp_path / 'trial', '/leg_2/wetness') == [float(n) for n in range(900)]


def test_what_was_latched_before_is_recorded(robot, record, until, tmp_path):
    topics.MORPHOLOGY.publisher(robot, 3).publish(String(data='dome'))
    recorder = record()
    until(lambda: recorder.message_count)
    recorder.close()
    assert data_on(tmp_path / 'trial', '/leg_3/morphology') == ['dome']


def test_a_best_effort_driver_is_recorded_too(robot, record, until, tmp_path):
    recorder = record()
    reliable = topics.WRENCH.publisher(robot, 1)
    until(lambda: reliable.get_subscription_count())
    driver = robot.create_publisher(WrenchStamped, 'leg_1/wrench', qos.SENSOR)
    volatile = robot.create_publisher(String, 'leg_1/morphology', 10)
    publishers = (reliable, driver, volatile)
    until(lambda: all(p.get_subscription_count() for p in publishers))
    for publisher in publishers:
        publisher.publish(publisher.msg_type())
    until(lambda: recorder.message_count == 3)
    recorder.close()
    assert BagReader(tmp_path / 'trial').counts['/leg_1/wrench'] == 2


def on_disk(folder, topic):
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        try:
            return BagReader(folder).counts[topic]
        except BagError:  # no bag yet
            return 0


def test_a_last_message_reaches_the_disk_although_none_follows(robot, record, until, tmp_path):
    recorder = record()
    publisher = topics.WETNESS.publisher(robot, 1)
    until(lambda: publisher.get_subscription_count())
    for number in (1, 2):
        publisher.publish(Float64())
        until(lambda n=number: recorder.message_count == n)
    until(lambda: on_disk(tmp_path / 'trial', '/leg_1/wetness') == 2)
    # It was on disk before close(), and close() does not write it twice.
    recorder.close()
    assert BagReader(tmp_path / 'trial').counts['/leg_1/wetness'] == 2


def test_the_parameters_of_the_robots_nodes_are_in_the_bag(
    context, executor, record, until, tmp_path
):
    nodes = [
        Node('gait', context=context, enable_rosout=False),
        Node('other', namespace='elsewhere', context=context, enable_rosout=False),
        Node('_hidden', context=context, enable_rosout=False),
    ]
    for node in nodes:
        node.declare_parameter('stride', 0.14)
        node.declare_parameter('homes', [0.1, 0.2])
        executor.add_node(node)
    recorder = record()
    bag = tmp_path / 'trial'
    until(lambda: '/gait' in (custom_data(bag, label.PARAMETERS) or {}))
    changed = Parameter('stride', value=0.10)
    events = nodes[1].create_publisher(ParameterEvent, '/parameter_events', 10)
    until(lambda: events.get_subscription_count() >= 1)
    strange = RosParameter(name='stride', value=ParameterValue(type=99))  # from another node
    events.publish(ParameterEvent(node='/gait', changed_parameters=[strange]))
    before = time.time_ns()
    assert nodes[0].set_parameters([changed])[0].successful
    until(lambda: custom_data(bag, label.CHANGES))
    recorder.close()
    ((at, *change),) = json.loads(BagReader(bag).custom_data[label.CHANGES])
    assert change == ['/gait', 'stride', 0.1]
    assert before <= at <= time.time_ns()
    parameters = json.loads(BagReader(bag).custom_data[label.PARAMETERS])
    assert parameters['/gait'] == {
        'homes': [0.1, 0.2],
        'stride': 0.14,
        'use_sim_time': False,
        'start_type_description_service': True,
    }
    assert set(parameters) <= {'/gait', '/robot', '/recorder'}


def test_parameters_of_other_peoples_nodes_do_not_end_the_recording(
    context, executor, record, until, tmp_path
):
    driver = Node('driver', context=context, enable_rosout=False)
    # If one requested parameter has no value, rclpy and rclcpp return no values at all.
    driver.declare_parameter('serial_number', Parameter.Type.STRING)
    driver.declare_parameter('rate', 250)
    driver.declare_parameter('key', [b'\x01', b'\xff'])
    executor.add_node(driver)
    recorder = record()

    def parameters():
        return (custom_data(tmp_path / 'trial', label.PARAMETERS) or {}).get('/driver', {})

    until(lambda: {'rate', 'key'} <= set(parameters()))
    recorder.close()
    assert (parameters()['rate'], parameters()['key']) == (250, [1, 255])
    assert 'serial_number' not in parameters()


@pytest.fixture
def gait(context, executor):
    def gait(stride):
        node = Node('gait', context=context, enable_rosout=False)
        node.declare_parameter('stride', stride)
        executor.add_node(node)
        return node

    return gait


@pytest.fixture
def stride_in(tmp_path):
    """Return a function for the parameter stride of /gait in the bag; None if missing."""

    def stride_in():
        parameters = custom_data(tmp_path / 'trial', label.PARAMETERS) or {}
        return parameters.get('/gait', {}).get('stride')

    return stride_in


def test_a_node_that_comes_back_is_asked_again(gait, record, until, destroy, stride_in):
    recorder = record()
    for stride in (0.14, 0.2):
        node = gait(stride)
        until(lambda stride=stride: stride_in() == stride)
        destroy(node)
        until(lambda: ('gait', '/') not in recorder.get_node_names_and_namespaces())
    recorder.close()
    assert stride_in() == 0.2


@pytest.mark.slow
def test_a_node_that_comes_back_before_its_name_is_dropped_is_asked_again(
    gait, record, until, executor, stride_in
):
    recorder = record()
    killed = []
    for stride in (0.14, 0.2):
        node = gait(stride)
        until(lambda stride=stride: stride_in() == stride)
        executor.remove_node(node)  # it does not answer, but is on the graph
        killed.append(node)
    for node in killed:
        node.destroy_node()
    recorder.close()
    assert stride_in() == 0.2


@pytest.mark.slow
@pytest.mark.parametrize('executor', [SingleThreadedExecutor], indirect=True)
def test_messages_that_do_not_come_are_counted(robot, until, tmp_path):
    driver = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    publisher = robot.create_publisher(WrenchStamped, 'leg_2/wrench', driver)
    process = start(f'folder:={tmp_path / "trial"}')
    sent = 0
    statuses = []
    topics.DIAGNOSTICS.subscription(robot, lambda array: statuses.extend(array.status))

    def send(count):
        nonlocal sent
        for _ in range(count):
            publisher.publish(WrenchStamped())
        sent += count

    try:
        until(lambda: publisher.get_subscription_count())
        until(lambda: send(1) or on_disk(tmp_path / 'trial', '/leg_2/wrench'))
        os.kill(process.pid, signal.SIGSTOP)
        send(20_000)  # more than all queues hold
        os.kill(process.pid, signal.SIGCONT)
        before = on_disk(tmp_path / 'trial', '/leg_2/wrench')
        # The middleware detects lost messages when a later one arrives.
        until(lambda: send(1) or on_disk(tmp_path / 'trial', '/leg_2/wrench') > before)
        until(lambda: statuses, what='a report of lost messages')
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    reader = BagReader(tmp_path / 'trial')
    (lost,) = json.loads(reader.custom_data[label.LOST]).items()
    assert lost[0] == '/leg_2/wrench'
    assert lost[1] > 1000
    # Messages sent before discovery or while the recorder ends are not counted as lost.
    assert sent - 50 <= lost[1] + reader.counts['/leg_2/wrench'] <= sent
    assert 'messages lost so far' in errors
    (value,) = statuses[0].values
    assert (statuses[0].name, statuses[0].level) == (
        'recorder: lost messages', DiagnosticStatus.WARN,
    )  # fmt: skip
    assert statuses[0].message == f'too slow: {value.value} messages lost so far'
    assert (value.key, 0 < int(value.value) <= lost[1]) == ('/leg_2/wrench', True)


def test_numbers_of_several_publishers_are_no_losses(robot, record, until):
    first, second = (topics.DIAGNOSTICS.publisher(robot) for _ in range(2))
    for _ in range(300):
        first.publish(DiagnosticArray())
    recorder = record()
    until(lambda: first.get_subscription_count() and second.get_subscription_count())
    until(lambda: recorder.count_publishers('/diagnostics') == 3)  # its own, too
    for count in range(1, 6):
        second.publish(DiagnosticArray())
        first.publish(DiagnosticArray())
        until(lambda count=count: recorder.message_count == 2 * count)
    assert recorder.lost == {}


@pytest.mark.parametrize('reliable', [False, True])
def test_measurements_are_repeated_only_where_that_is_wanted(robot, record, until, reliable):
    """Set-points and states are reliable in any case."""

    def asked(name):
        peers = robot.get_subscriptions_info_by_topic(name)
        return [peer.qos_profile.reliability for peer in peers]

    node = record(**({'reliable': True} if reliable else {}))
    measured = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
    for topic in topics.LEG_TOPICS:
        state = topic in (topics.PRESSURE_SETPOINT, topics.DOUBT, topics.MORPHOLOGY)
        name = f'/{topic.name(3)}'
        until(lambda name=name: asked(name), what=name)
        assert asked(name) == [ReliabilityPolicy.RELIABLE if state else measured], name
    assert asked('/diagnostics') == [ReliabilityPolicy.RELIABLE]
    node.close()


def test_time_is_that_of_the_machine(robot, record, until, tmp_path):
    recorder = record()
    publisher = topics.WETNESS.publisher(robot, 1)
    until(lambda: publisher.get_subscription_count())
    before = time.time_ns()
    publisher.publish(Float64())
    until(lambda: recorder.message_count)
    after = time.time_ns()
    recorder.close()
    ((_, _, log_time),) = BagReader(tmp_path / 'trial').messages()
    assert before <= log_time <= after


def test_simulated_time_is_that_of_the_clock(robot, record, until, tmp_path):
    recorder = record(use_sim_time=True)
    clock = topics.CLOCK.publisher(robot)
    wetness = topics.WETNESS.publisher(robot, 1)
    until(lambda: clock.get_subscription_count() and wetness.get_subscription_count())

    def send(publisher, message):
        count = recorder.message_count
        publisher.publish(message)
        until(lambda: recorder.message_count > count)

    def tick(seconds, nanoseconds):
        message = Clock()
        message.clock.sec = seconds
        message.clock.nanosec = nanoseconds
        send(clock, message)

    send(wetness, Float64())
    tick(0, 4_000_000)
    send(wetness, Float64())
    tick(3_000, 999_999_999)
    send(wetness, Float64())
    recorder.close()
    assert [(t, at) for t, _, at in BagReader(tmp_path / 'trial').messages()] == [
        ('/leg_1/wetness', 0),
        ('/clock', 4_000_000),
        ('/leg_1/wetness', 4_000_000),
        ('/clock', 3_000_999_999_999),
        ('/leg_1/wetness', 3_000_999_999_999),
    ]


def test_a_full_disk_is_not_silent(robot, record, until, monkeypatch):
    def write(*_):
        raise BagError('7 messages are saved')

    monkeypatch.setattr(BagWriter, 'write', write)
    recorder = record()
    publisher = topics.WETNESS.publisher(robot, 1)
    until(lambda: publisher.get_subscription_count())
    publisher.publish(Float64())
    with pytest.raises(BagError, match='7 messages are saved'):
        until(lambda: False)
    recorder.close()


def test_a_namespace_moves_the_robot_but_not_the_clock(context, tmp_path):
    folder = Parameter('folder', value=str(tmp_path / 'trial'))
    node = RecorderNode(
        context=context, namespace='lab/robot_7', parameter_overrides=[folder], **QUIET
    )
    node.close()
    node.destroy_node()
    recorded = BagReader(tmp_path / 'trial').topics
    assert len(recorded) == 6 * 15 + 8
    assert {'/lab/robot_7/leg_6/wrench', '/lab/robot_7/body/pose', '/clock'} <= set(recorded)
    assert recorded['/diagnostics'] == 'diagnostic_msgs/msg/DiagnosticArray'


@pytest.mark.parametrize('legs', [[0], [9], [1, 1]])
def test_legs_that_are_none_are_refused(context, tmp_path, legs):
    overrides = [
        Parameter('legs', value=legs),
        Parameter('folder', value=str(tmp_path / 'trial')),
    ]
    with pytest.raises(ConfigError, match=re.escape(f'legs = {legs} is not allowed')):
        RecorderNode(context=context, parameter_overrides=overrides, **QUIET)
    assert not (tmp_path / 'trial').exists()


def start(*parameters):
    arguments = [word for parameter in parameters for word in ('-p', parameter)]
    return subprocess.Popen(
        [sys.executable, '-m', 'ros_pad.nodes.recorder', '--ros-args', *arguments],
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('executor', [SingleThreadedExecutor], indirect=True)
def test_signals_close_the_bag(number, robot, until, tmp_path):
    publisher = robot.create_publisher(Float64, 'leg_5/friction', qos.RECORD)
    process = start(f'folder:={tmp_path / "trial"}', 'reliable:=true')
    try:
        until(lambda: publisher.get_subscription_count())
        for value in range(100):
            publisher.publish(Float64(data=float(value)))

        def recorded():  # a message a second later causes the flush to the file
            publisher.publish(Float64(data=100.0))
            with warnings.catch_warnings():
                warnings.simplefilter('ignore')
                try:
                    return BagReader(tmp_path / 'trial').counts['/leg_5/friction'] > 100
                except BagError:
                    return False

        until(recorded)
        process.send_signal(number)
        _, errors = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    assert 'Traceback' not in errors
    reader = BagReader(tmp_path / 'trial')
    assert reader.problem is None
    recorded_data = data_on(tmp_path / 'trial', '/leg_5/friction')
    assert recorded_data[:100] == [float(value) for value in range(100)]
    assert set(recorded_data[100:]) == {100.0}


def test_exit_status_depends_on_the_error(tmp_path):
    (tmp_path / 'trial').mkdir()
    for parameter, status, message in [
        (f'folder:={tmp_path / "trial"}', 1, 'exists already, and bags are never overwritten'),
        ('legs:=[9]', 2, r'legs = \[9\] is not allowed'),
        ('legs:=all', 2, 'legs'),
    ]:
        process = start(parameter, *([] if 'folder' in parameter else ['folder:=/nonexistent/x']))
        _, errors = process.communicate(timeout=120)
        assert (process.returncode, bool(re.search(message, errors))) == (status, True), errors
        assert 'Traceback' not in errors


def test_recorded_topics_say_what_their_publishers_offer(robot, until):
    publishers = [t.publisher(robot, 1) for t in (*topics.LEG_TOPICS, *topics.COMMON_TOPICS)]
    for publisher in publishers:
        name = publisher.topic_name
        until(lambda n=name: robot.get_publishers_info_by_topic(n))
        (info,) = robot.get_publishers_info_by_topic(name)
        offered = info.qos_profile
        (topic,) = [
            t for t in (*topics.LEG_TOPICS, *topics.COMMON_TOPICS) if t.name(1) in (name, name[1:])
        ]
        # All lines that the middleware announces; it does not announce history and depth.
        for line in qos.offered_profiles(topic.publish).splitlines()[2:]:
            assert line in qos.offered_profiles(offered).splitlines()


def test_recording_accepts_the_weakest_publisher():
    best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    assert qos.recording([]) == qos.RECORD
    assert qos.recording([qos.SENSOR_PUBLISH]).reliability == ReliabilityPolicy.RELIABLE
    assert qos.recording([qos.SENSOR_PUBLISH, best_effort]).reliability == (
        ReliabilityPolicy.BEST_EFFORT
    )
    measured = qos.recording([qos.SENSOR_PUBLISH], measured=True)
    assert measured.reliability == ReliabilityPolicy.BEST_EFFORT
    assert measured.history == HistoryPolicy.KEEP_ALL
    assert qos.recording([qos.STATE]).durability == qos.STATE.durability
    assert qos.recording([qos.STATE, qos.COMMAND]).durability == qos.COMMAND.durability
    assert qos.recording([qos.SENSOR_PUBLISH]).history == HistoryPolicy.KEEP_ALL
