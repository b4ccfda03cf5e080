# SPDX-License-Identifier: Apache-2.0
import collections
import contextlib
import dataclasses
import gc
import os
import signal
import struct
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import rclpy
from mcap.reader import make_reader
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions

from ros_pad import cli
from ros_pad import configuration
from ros_pad import trials
from ros_pad.bags import BagReader
from ros_pad.bags import BagWriter
from ros_pad.errors import BagError
from ros_pad.errors import PadError
from ros_pad.nodes import composed
from ros_pad.nodes import topics
from ros_pad.nodes.batches import BatchReader
from ros_pad.nodes.composed import ComposedTrial
from ros_pad.nodes.recorder import RecorderNode
from ros_pad.simulation.faults import Fault
from ros_pad.simulation.scene import Scene
from ros_pad.trials import label

AMBIENT = 101325.0
LEGS = (1, 2, 3, 4, 5, 6)
SERIES = (
    'time', 'force', 'position', 'slow_time', 'pressure', 'setpoint', 'wet_probability',
    'friction', 'margin', 'slip_speed', 'slipping', 'dome', 'doubt',
)  # fmt: skip


def scene_of(name, cycles):
    return dataclasses.replace(Scene.load(name), cycles=cycles)


@contextlib.contextmanager
def trial_of(scene, policy, seed, bag):
    """Yield the nodes of a trial, connected and before their first step."""
    context = rclpy.Context()
    rclpy.init(context=context, args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        trial = ComposedTrial(scene, policy, seed, bag, context)
        try:
            yield trial
        finally:
            trial.close()
    finally:
        rclpy.shutdown(context=context)


def messages_of(bag):
    """Return the messages in a bag, by topic."""
    found = {}
    for topic, message, _ in BagReader(bag).messages():
        found.setdefault(topic, []).append(message)
    return found


def gauges(messages):
    return [message.fluid_pressure - AMBIENT for message in messages]


@pytest.mark.parametrize(
    ('name', 'policy', 'cycles', 'moves'),
    [
        pytest.param('hexapod_patches', 'adaptive', 8, 1, marks=pytest.mark.slow),
        ('hexapod_patches', 'oracle', 3, 1),
        pytest.param('hexapod_patches', 'dome', 3, 0, marks=pytest.mark.slow),
        ('leg_wet_dome_60', 'dome', 2, 0),
    ],
)
def test_the_nodes_walk_as_the_loop_without_ros_does(name, policy, cycles, moves, tmp_path):
    scene = scene_of(name, cycles)
    on_nodes = composed.run(scene, policy, seed=2, bag=tmp_path / 'bag')
    without = trials.run(scene, policy, seed=2)
    assert len(on_nodes.time) == round(scene.duration * 250)
    for series in SERIES:
        assert np.array_equal(getattr(on_nodes, series), getattr(without, series)), series
    assert np.array_equal(on_nodes.body[:, :2], without.body[:, :2])
    # The heading is sent as a quaternion, which costs 1e-15 rad.
    assert np.max(np.abs(on_nodes.body[:, 2] - without.body[:, 2])) < 1e-15
    assert on_nodes.metrics == without.metrics
    assert not on_nodes.settings['interrupted']
    # The walks are not trivial: there is pressure, switches and distance.
    assert np.max(on_nodes.pressure) > 30e3
    assert sum(on_nodes.metrics.switches) >= moves
    assert on_nodes.metrics.distance_m > 0.0


@pytest.mark.slow
def test_no_node_stays_behind(tmp_path):
    """A second walk in one process must not find nodes of the first one on the graph."""
    gc.collect()
    held = living_nodes()  # nodes of other tests are not counted
    gc.disable()  # else the collector could destroy nodes at any time
    try:
        composed.run(scene_of('leg_wet_dome_60', 1), 'dome', seed=2, bag=tmp_path / 'bag')
        assert not [each for each in living_nodes() if not any(each is old for old in held)]
    finally:
        gc.enable()


def living_nodes():
    return [each for each in gc.get_objects() if isinstance(each, Node)]


@pytest.mark.slow
def test_faults_come_to_both_alike(tmp_path):
    """Regulators are stuck, leaking, drifting and silent, and the supply fails for a while."""
    texts = (
        '{kind: silence, legs: [1], start: 1.51, end: 1.93}',  # too short to be reported
        '{kind: silence, legs: [6], start: 0.053, end: 2.2}',  # reported; the pad is filling
        '{kind: leak, legs: [2], start: 1.0, conductance: 1.0e-9}',
        '{kind: sensor_drift, legs: [3], start: 0.7, offset: -8.0e3, rise: 2.0}',
        '{kind: stuck_valve, legs: [4], start: 0.05}',  # this pad cannot vent
        '{kind: supply_loss, start: 3.0, end: 3.6, time_constant: 0.3}',
    )
    faults = tuple(Fault.parse(text) for text in texts)
    scene = dataclasses.replace(scene_of('hexapod_patches', 4), faults=faults)
    on_nodes = composed.run(scene, 'dome', seed=3, bag=tmp_path / 'bag')
    without = trials.run(scene, 'dome', seed=3)
    for series in SERIES:
        one, other = getattr(on_nodes, series), getattr(without, series)
        assert np.array_equal(one, other), series
    assert on_nodes.metrics == without.metrics
    sound = trials.run(scene_of('hexapod_patches', 4), 'dome', seed=3)
    at = {round(time, 3): row for row, time in enumerate(sound.slow_time)}
    assert on_nodes.pressure[at[2.16], 5] < 60e3 < sound.pressure[at[2.16], 5]  # last value
    assert on_nodes.pressure[at[2.6], 5] > 70e3  # received again
    assert np.ptp(on_nodes.pressure[at[0.5] : at[3.0], 3]) < 20.0  # stuck
    assert (on_nodes.pressure[at[3.56]] < 30e3).all()
    assert on_nodes.pressure[at[2.9], 1] < sound.pressure[at[2.9], 1]


@pytest.mark.slow
def test_faulty_sensors_and_moments_come_to_both_alike(tmp_path):
    """The scene is a file that is not shipped; each node loads it."""
    text = configuration.locate('scenes', 'hexapod_patches').read_text()
    text = text.replace('cycles: 60', 'cycles: 4')
    text = text.replace('  position_noise:', '  moment_noise: 5.0e-4\n  position_noise:')
    text += """
faults:
  - {kind: force_frozen, legs: [1], start: 1.2, end: 2.9}
  - {kind: force_dead, legs: [2], start: 1.5}
  - {kind: force_offset, legs: [3], start: 0.7, load: 1.5}
  - {kind: force_range, legs: [4], start: 1.0, load: 5.0}
  - {kind: marker_frozen, legs: [5], start: 1.3, end: 3.3}
"""
    path = tmp_path / 'mine.yaml'
    path.write_text(text)
    scene = Scene.load(path)
    assert (scene.cycles, scene.sensors.moment) == (4, 5e-4)
    on_nodes = composed.run(scene, 'adaptive', seed=3, bag=tmp_path / 'bag')
    without = trials.run(scene, 'adaptive', seed=3)
    for series in SERIES:
        one, other = getattr(on_nodes, series), getattr(without, series)
        assert np.array_equal(one, other, equal_nan=True), series
    assert on_nodes.metrics == without.metrics
    faults = {(fault['leg'], fault['reason']): fault for fault in without.metrics.faults}
    assert faults[1, 'force stands still']['end'] is not None
    assert faults[2, 'force stands still']['start'] < 1.5 + 1.2  # reported in the next stance
    doubts = messages_of(tmp_path / 'bag')
    for leg, doubt in {
        1: 'force stands still', 2: 'force stands still', 4: 'force out of range',
        5: 'marker stands still',
    }.items():  # fmt: skip
        said = [message.data.partition(':')[0] for message in doubts[f'/leg_{leg}/doubt']]
        assert doubt in said
        if leg in (1, 5):  # this fault ends
            assert said[-1] != doubt
    assert not any('still' in message.data for message in doubts['/leg_6/doubt'])


@pytest.mark.slow
def test_every_message_arrives(tmp_path):
    """Numbers that one node publishes reach the functions of the next one unchanged, in order."""
    scene = scene_of('hexapod_patches', 3)
    felt = {leg: [] for leg in LEGS}
    commanded = {leg: [] for leg in LEGS}
    stepped = []
    with trial_of(scene, 'oracle', 2, tmp_path / 'bag') as trial:

        def watch(thing, name, see):
            method = getattr(thing, name)

            def watched(*arguments):
                see(*arguments)
                return method(*arguments)

            setattr(thing, name, watched)

        for leg in LEGS:
            watch(
                trial.estimator.legs[leg].stage.estimator,
                'update',
                lambda *arguments, leg=leg: felt[leg].append(arguments),
            )
            watch(trial.regulator.channels[leg].regulator, 'set_pressure', commanded[leg].append)
        watch(trial.simulator.robot, 'step', lambda p: stepped.append(tuple(p)))
        trial.walk()
        samples = trial.estimator.samples
    heard = messages_of(tmp_path / 'bag')
    steps = round(scene.duration * 250)
    assert samples == 6 * steps
    assert len(stepped) == steps
    for index, leg in enumerate(LEGS):
        wrenches, positions = heard[f'/leg_{leg}/wrench'], heard[f'/leg_{leg}/position']
        assert len(wrenches) == len(positions) == len(felt[leg]) == steps
        for (at, force, place, *_), wrench, position in zip(
            felt[leg], wrenches, positions, strict=True
        ):
            stamp, f, p = wrench.header.stamp, wrench.wrench.force, position.point
            assert at == (stamp.sec * 10**9 + stamp.nanosec) * 1e-9
            assert force == (f.x, f.y, f.z)
            assert place == (p.x, p.y, p.z)
        assert len({at for at, *_ in felt[leg]}) == steps
        setpoints = gauges(heard[f'/leg_{leg}/pressure_setpoint'])
        # There is a set-point at each control step; at the end the regulator vents without one.
        assert setpoints == commanded[leg][: len(setpoints)]
        assert set(commanded[leg][len(setpoints) :]) <= {0.0}
        assert len(heard[f'/leg_{leg}/wetness']) == len(setpoints) == 201
        # A pressure reaches robot and estimator before the next sample.
        pressures = heard[f'/leg_{leg}/pressure']
        by_time = {
            m.header.stamp.sec * 10**9 + m.header.stamp.nanosec: m.fluid_pressure - AMBIENT
            for m in pressures
        }
        expected, last = [], 0.0
        for number in range(1, steps + 1):
            expected.append(last)
            last = by_time.get(number * 4_000_000, last)
        assert [row[index] for row in stepped] == expected
        assert [each[3] for each in felt[leg]] == expected
    assert any(max(row) > 30e3 for row in stepped)


def raw_messages(bag):
    (file,) = bag.glob('*.mcap')
    found = {}
    with file.open('rb') as stream:
        for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            found.setdefault(channel.topic, []).append((message.log_time, message.data))
    return found


@pytest.mark.slow
def test_the_same_seed_gives_the_same_messages(tmp_path):
    for name, cycles, seed in [('first', 3, 5), ('second', 3, 5), ('other', 1, 6)]:
        scene = scene_of('hexapod_patches', cycles)
        composed.run(scene, 'adaptive', seed=seed, bag=tmp_path / name)
    one, two, other = (raw_messages(tmp_path / name) for name in ('first', 'second', 'other'))
    assert set(one) == set(two)
    assert len(one) == 6 * 13 + 5  # thirteen of each leg; pose, joints, clock, diagnostics
    # rclpy leaves the bytes between numbers of these messages as it finds them in memory.
    padded = {'/diagnostics', '/markers'}
    for topic in set(one) - padded:
        assert one[topic] == two[topic], topic
    first, second = (
        [(topic, log_ns, repr(message)) for topic, message, log_ns in reader.messages(padded)]
        for reader in map(BagReader, (tmp_path / 'first', tmp_path / 'second'))
    )
    assert {topic for topic, *_ in first} == padded
    assert first == second
    assert one['/leg_1/wrench'][:250] != other['/leg_1/wrench'][:250]


def test_the_bag_has_what_is_published_in_order(monkeypatch, tmp_path):
    """The reference are the calls of rclpy's publishers: none may pass the recorder by."""
    published, batches = [], []
    publish = Publisher.publish

    def watched(publisher, message):
        data = message if isinstance(message, bytes) else serialize_message(message)
        if publisher.topic_name.startswith('/_batches/'):
            batches.append(publisher.topic_name)
            published.extend(BatchReader()(data))
        else:
            published.append((publisher.topic_name, data))
        publish(publisher, message)

    monkeypatch.setattr(Publisher, 'publish', watched)
    with trial_of(scene_of('leg_wet_dome_60', 2), 'dome', 0, tmp_path / 'bag') as trial:
        trial.walk()
        assert trial.recorder.lost == {}
        # Only the node's own clock comes through DDS.
        assert {each.topic_name for each in trial.recorder.subscriptions} <= {'/clock'}
    (file,) = (tmp_path / 'bag').glob('*.mcap')
    with file.open('rb') as stream:
        recorded = [
            (channel.topic, message.data, message.log_time)
            for _, channel, message in make_reader(stream).iter_messages(log_time_order=False)
        ]
    reader = BagReader(tmp_path / 'bag')
    assert reader.custom_data[label.RECORDED_AT] == 'publisher'
    published = [each for each in published if each[0] in reader.topics]

    def of(name, messages):
        return [data for topic, data, *_ in messages if topic == name]

    for name in reader.topics:
        assert of(name, recorded) == of(name, published), name
    # All of one moment are one message; no other node subscribes to them alone.
    # Without markers there would be a body estimator, too.
    sources = set(topics.BATCHES) - {'body_estimator'}
    assert set(batches) == {f'/_batches/{source}' for source in sources}
    assert len(published) > 2 * len(batches)
    counts = collections.Counter(name for name, _ in published)
    absent = topics.FOOT_WRENCH, topics.CONTACT_VELOCITY
    always = {topic.name(1) for topic in topics.LEG_TOPICS if topic not in absent}
    always |= {'clock', 'body/pose', 'diagnostics'}
    assert {f'/{name}' for name in always} <= set(counts)
    assert counts['/leg_1/contact_load'] == counts['/leg_1/wetness'] > 100
    assert counts['/leg_1/wrench'] == counts['/leg_1/position'] > 700
    # The log time is that of the last clock before.
    clock = 0
    for topic, data, log_time in recorded:
        if topic == '/clock':
            seconds, fraction = struct.unpack('<4xiI', data)
            clock = seconds * 10**9 + fraction
        assert log_time == clock


def test_another_recorder_receives_what_the_trial_publishes(context, executor, until, tmp_path):
    parameters = {'folder': str(tmp_path / 'other'), 'reliable': True}
    other = RecorderNode(
        context=context,
        parameter_overrides=[Parameter(name, value=each) for name, each in parameters.items()],
    )
    executor.add_node(other)
    names = {other.resolve_topic_name(name) for name in topics.names(topics.LEGS)}
    with trial_of(scene_of('leg_wet_dome_60', 2), 'dome', 0, tmp_path / 'bag') as trial:
        inside = [each for node in trial.executor.get_nodes() for each in node.subscriptions]
        expected = collections.Counter(each.topic_name for each in inside)
        recorded = {
            each: expected[each.topic_name] + 1
            for node in trial.executor.get_nodes()
            for each in node.publishers
            if each.topic_name in names
        }
        assert len(recorded) > 13
        until(lambda: all(each.get_subscription_count() == n for each, n in recorded.items()))
        for _ in range(50):
            trial.step()
            executor.spin_once(timeout_sec=0.0)
        until(lambda: other.message_count == trial.recorder.message_count)
    other.close()
    bags = raw_messages(tmp_path / 'bag'), raw_messages(tmp_path / 'other')
    sent, received = ({name: [data for _, data in m] for name, m in bag.items()} for bag in bags)
    # The venting at the end is not in the other bag.
    assert set(received) > {'/clock', '/leg_1/wrench', '/leg_1/contact_load', '/leg_1/wetness'}
    for name, messages in received.items():
        assert messages == sent[name][: len(messages)], name
    assert len(received['/leg_1/wrench']) == 50
    assert BagReader(tmp_path / 'other').custom_data[label.RECORDED_AT] == 'receiver'


def check_vented(bag):
    """Check that the bag is complete, and that pads had pressure and are flat at its end."""
    assert BagReader(bag).problem is None
    heard = messages_of(bag)
    for leg in LEGS:
        pressures = gauges(heard[f'/leg_{leg}/pressure'])
        assert max(pressures) > 30e3
        assert pressures[-1] < 1000.0
    return heard


@pytest.mark.slow
def test_a_trial_that_is_stopped_leaves_the_pads_flat(tmp_path):
    with trial_of(scene_of('hexapod_patches', 30), 'dome', 0, tmp_path / 'bag') as trial:

        def progress(at):
            trial.stopped = at > 2.5

        trial.walk(progress)
        assert 2.5 < trial.simulator.robot.time < 2.7
    heard = check_vented(tmp_path / 'bag')
    assert len(heard['/leg_1/wrench']) == round(trial.simulator.robot.time * 250)


@pytest.mark.slow
def test_a_trial_that_comes_to_its_end_leaves_the_pads_flat(tmp_path):
    composed.run(scene_of('hexapod_patches', 2), 'dome', bag=tmp_path / 'bag')
    check_vented(tmp_path / 'bag')


@pytest.mark.slow
def test_a_signal_stops_a_trial_that_is_run_from_python(tmp_path):
    before = signal.getsignal(signal.SIGTERM)
    sent = []

    def once(at):
        if at > 2.5 and not sent:
            sent.append(at)
            os.kill(os.getpid(), signal.SIGTERM)

    trial = composed.run(
        scene_of('hexapod_patches', 30), 'dome', bag=tmp_path / 'bag', progress=once
    )
    assert trial.settings['interrupted']
    assert 2.5 < trial.metrics.duration_s < 2.8
    assert signal.getsignal(signal.SIGTERM) is before
    check_vented(tmp_path / 'bag')


@pytest.mark.slow
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_to_pad_run_leaves_the_pads_flat(number, tmp_path):
    arguments = ['run', 'hexapod_patches', '--cycles', '30', '--policy', 'dome']
    out = tmp_path / 'out'
    process = subprocess.Popen(
        [sys.executable, '-m', 'ros_pad.cli', *arguments, '--out', str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        deadline = time.monotonic() + 300.0

        def recorded():
            return sum(file.stat().st_size for file in out.glob('bag/*.mcap'))

        while recorded() < 1_000_000 and process.poll() is None:
            assert time.monotonic() < deadline, 'the bag does not grow'
            time.sleep(0.05)
        process.send_signal(number)
        _, errors = process.communicate(timeout=300)
    finally:
        process.kill()
    assert process.returncode == 130, errors
    assert 'pads vented, bag closed' in errors
    assert 'Traceback' not in errors
    check_vented(out / 'bag')


@pytest.mark.slow
@pytest.mark.parametrize('deaf', ['controller', 'estimator', 'regulator', 'simulator'])
def test_a_node_that_does_not_answer_is_reported(deaf, monkeypatch, tmp_path):
    with (
        trial_of(scene_of('hexapod_patches', 2), 'dome', 0, tmp_path / 'bag') as trial,
        pytest.raises(PadError, match=r'waited more than 0\.3 s of wall time for .* 0\.5'),
    ):

        def progress(at):
            if at > 0.49:
                # Later than the first step, which takes long on a busy machine.
                monkeypatch.setattr(composed, 'PATIENCE', 0.3)
                trial.executor.remove_node(getattr(trial, deaf))

        trial.walk(progress)
    assert BagReader(tmp_path / 'bag').problem is None
    assert len(messages_of(tmp_path / 'bag')['/leg_1/wrench']) > 120


def test_a_full_disk_ends_the_trial_with_its_message(context, monkeypatch, tmp_path):
    write = BagWriter.write
    count = 0

    def until_full(self, *arguments):
        nonlocal count
        count += 1
        if count > 5000:
            raise BagError('no space left: 5000 messages are saved')
        write(self, *arguments)

    monkeypatch.setattr(BagWriter, 'write', until_full)
    with pytest.raises(BagError, match='5000 messages are saved'):
        composed.run(scene_of('hexapod_patches', 2), 'dome', bag=tmp_path / 'bag')
    # No node remains and publishes.
    observer = Node('observer', context=context)
    deadline = time.monotonic() + 60.0
    while observer.count_publishers('/leg_1/morphology'):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    observer.destroy_node()


def test_a_bag_that_exists_is_not_overwritten(tmp_path):
    (tmp_path / 'bag').mkdir()
    with pytest.raises(BagError, match='exists'):
        composed.run(scene_of('hexapod_patches', 1), 'flat', bag=tmp_path / 'bag')
    assert list((tmp_path / 'bag').iterdir()) == []


def test_it_runs_in_a_thread_too(tmp_path):
    """Only the main thread can handle signals; in other threads a trial does not try to."""
    found = []

    def walk():
        found.append(composed.run(scene_of('leg_wet_flat', 1), bag=tmp_path / 'bag'))

    thread = threading.Thread(target=walk)
    thread.start()
    thread.join(timeout=300)
    assert found[0].metrics.duration_s == pytest.approx(scene_of('leg_wet_flat', 1).duration)


def test_pad_run_hides_its_nodes_and_leaves_the_environment_alone(tmp_path, monkeypatch):
    ranges = []

    def look(*arguments, **keywords):
        ranges.append(os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'])
        raise PadError('enough seen')

    monkeypatch.setattr(composed, 'run', look)
    for number, live in enumerate([[], ['--live']]):
        out = str(tmp_path / str(number))
        assert cli.main(['run', 'leg_dry_flat', '--no-compare', '--out', out, *live]) == 1
    assert ranges == ['OFF', 'LOCALHOST']
    assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
