# SPDX-License-Identifier: Apache-2.0
"""Composed nodes in lock-step: the same walk as the loop without ROS, and its bag."""

import contextlib
import dataclasses
import math
import os
import pathlib
import signal

import numpy as np
import pytest
import rclpy
from helpers import MS, SIX, pressure
from mcap.reader import make_reader
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from shared import wait_for

from ros_pad import cli, configuration, trials
from ros_pad.bags import BagReader, BagWriter
from ros_pad.bags.wire import Wire
from ros_pad.errors import BagError, PadError
from ros_pad.estimation import doubt as doubts
from ros_pad.nodes import composed
from ros_pad.nodes.composed import ComposedTrial
from ros_pad.records import KINDS, SAMPLE
from ros_pad.simulation.faults import Fault
from ros_pad.simulation.scene import Scene
from ros_pad.trials import recorded
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.replay import replay
from ros_pad.trials.trial import SLOW

SERIES = ('time', 'force', 'position', 'slow_time', 'odom')
RECORDS = {f'/feet/{kind.name}': kind for kind in KINDS}


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


def records_of(bag):
    """Return the blocks of all records in a bag, by kind."""
    found = BagReader(bag).records(RECORDS)
    return {RECORDS[topic].name: block for topic, (_, _, block) in found.items()}


def raw_messages(bag):
    """Return log times and bytes of the messages in a bag, by topic."""
    (file,) = bag.glob('*.mcap')
    found = {}
    with file.open('rb') as stream:
        for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            found.setdefault(channel.topic, []).append((message.log_time, message.data))
    return found


def both(scene, policy, seed, bag):
    """Walk on nodes and without ROS, compare all but the heading, and return both."""
    on_nodes = composed.run(scene, policy, seed=seed, bag=bag)
    without = trials.run(scene, policy, seed=seed)
    for series in SERIES:
        one, other = getattr(on_nodes, series), getattr(without, series)
        assert np.array_equal(one, other, equal_nan=True), series
    for name in SLOW.names:
        one, other = (each.slow[name].astype(float) for each in (on_nodes, without))
        assert np.array_equal(one, other, equal_nan=True), name
    assert np.array_equal(on_nodes.body[:, :2], without.body[:, :2])
    # The heading is sent as a quaternion, which costs 1e-15 rad.
    assert np.max(np.abs(on_nodes.body[:, 2] - without.body[:, 2])) < 1e-15
    assert on_nodes.metrics == without.metrics
    return on_nodes, without


@pytest.mark.parametrize(
    ('name', 'policy', 'cycles', 'moves'),
    [
        ('hexapod_patches', 'adaptive', 8, 1),
        ('hexapod_patches', 'oracle', 3, 1),
        ('leg_wet_dome_60', 'dome', 2, 0),
    ],
)
def test_the_nodes_walk_as_the_loop_without_ros_does(name, policy, cycles, moves, tmp_path):
    scene = scene_of(name, cycles)
    on_nodes, _ = both(scene, policy, 2, tmp_path / 'bag')
    assert len(on_nodes.time) == round(scene.duration * 250)
    assert not on_nodes.settings['interrupted']
    # The walks are not trivial: there is pressure, switches and distance.
    assert np.max(on_nodes.slow['pressure']) > 30e3
    assert sum(on_nodes.metrics.switches) >= moves
    assert on_nodes.metrics.distance_m > 0.0


def test_faults_come_to_both_alike_and_records_have_the_true_pressures(tmp_path):
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
    on_nodes, _ = both(scene, 'dome', 3, tmp_path / 'bag')
    sound = trials.run(scene_of('hexapod_patches', 4), 'dome', seed=3)
    at = {round(time, 3): row for row, time in enumerate(sound.slow_time)}
    assert on_nodes.slow['pressure'][at[2.6], 5] > 70e3  # received again
    assert np.ptp(on_nodes.slow['pressure'][at[0.5] : at[3.0], 3]) < 20.0  # stuck
    assert (on_nodes.slow['pressure'][at[3.56]] < 30e3).all()
    assert on_nodes.slow['pressure'][at[2.9], 1] < sound.slow['pressure'][at[2.9], 1]
    block = records_of(tmp_path / 'bag')['pressure']
    rows = {stamp // MS: row for stamp, row in zip(block.stamps.tolist(), block.rows, strict=True)}
    assert np.isnan(rows[1900]['pressure'][[0, 5]]).all()
    assert rows[1900]['pad'][5] > 70e3  # nobody hears of it, but the robot stands on it
    drift = rows[2900]['pad'][2] - rows[2900]['pressure'][2]
    assert drift == pytest.approx(8e3, abs=10.0)
    assert np.isfinite(block.rows['pad']).all()


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
    _, without = both(scene, 'adaptive', 3, tmp_path / 'bag')
    faults = {(fault['leg'], fault['reason']): fault for fault in without.metrics.faults}
    assert faults[1, 'force stands still']['end'] is not None
    assert faults[2, 'force stands still']['start'] < 1.5 + 1.2  # reported in the next stance
    codes = records_of(tmp_path / 'bag')['estimate'].rows['doubt']
    for leg, kind in {
        1: 'force stands still', 2: 'force stands still', 4: 'force out of range',
        5: 'marker stands still',
    }.items():  # fmt: skip
        said = [doubts.kind(code) for code in codes[:, leg - 1]]
        assert kind in said
        if leg in (1, 5):  # this fault ends
            assert said[-1] != kind
    assert not any('still' in doubts.kind(code) for code in codes[:, 5])


def test_every_record_is_answered_by_one_of_its_moment(tmp_path):
    scene = scene_of('hexapod_patches', 3)
    stepped = []
    with trial_of(scene, 'oracle', 2, tmp_path / 'bag') as trial:
        step = trial.simulator.robot.step
        trial.simulator.robot.step = lambda given: stepped.append(tuple(given)) or step(given)
        trial.walk()
        assert trial.estimator.stage.used == [len(stepped)] * 6
    found = records_of(tmp_path / 'bag')
    steps = round(scene.duration * 250)
    assert found['sample'].stamps.tolist() == [4 * MS * n for n in range(1, steps + 1)]
    moments = found['estimate'].stamps.tolist()
    assert moments == [4 * MS, *range(20 * MS, steps * 4 * MS + 1, 20 * MS)]
    assert found['command'].stamps.tolist() == moments
    answers = found['pressure'].stamps.tolist()
    assert answers[: len(moments)] == moments  # then the pads are vented, without commands
    # A pressure reaches the robot before the next sample.
    place = np.searchsorted(answers, found['sample'].stamps, side='left')
    pads = np.concatenate([np.zeros((1, 6)), found['pressure'].rows['pad']])
    assert np.array_equal(stepped, pads[place])
    assert np.max(stepped) > 30e3


def test_the_same_seed_gives_the_same_messages(tmp_path):
    for name, cycles, seed in [('first', 3, 5), ('second', 3, 5), ('other', 1, 6)]:
        scene = scene_of('hexapod_patches', cycles)
        composed.run(scene, 'adaptive', seed=seed, bag=tmp_path / name)
    one, two, other = (raw_messages(tmp_path / name) for name in ('first', 'second', 'other'))
    assert set(one) == {*RECORDS, '/clock', '/body/pose', '/joint_states', '/markers',
                        '/diagnostics'}  # fmt: skip
    assert one == two
    assert one['/feet/sample'][:250] != other['/feet/sample'][:250]


def test_the_bag_has_what_is_published_in_order(monkeypatch, tmp_path):
    """The reference are the calls of rclpy's publishers: none may pass the recorder by."""
    published = {}
    publish = Publisher.publish

    def watched(publisher, message):
        data = message if isinstance(message, bytes) else serialize_message(message)
        kind = RECORDS.get(publisher.topic_name)
        messages = [each for _, each in Wire(kind, (1,)).split(data)] if kind else [data]
        published.setdefault(publisher.topic_name, []).extend(messages)
        publish(publisher, message)

    monkeypatch.setattr(Publisher, 'publish', watched)
    with trial_of(scene_of('leg_wet_dome_60', 2), 'dome', 0, tmp_path / 'bag') as trial:
        trial.walk()
        assert trial.recorder.lost == {}
    recorded = raw_messages(tmp_path / 'bag')
    assert {*RECORDS, '/clock', '/body/pose', '/diagnostics', '/markers'} <= recorded.keys()
    for name, messages in recorded.items():
        assert [data for _, data in messages] == published[name], name
        log_times = [log_time for log_time, _ in messages]
        assert log_times == sorted(log_times)
    for name, kind in RECORDS.items():  # their log time is their stamp
        blocks = [Wire(kind, (1,)).decode(data) for _, data in recorded[name]]
        assert [each.last_ns for each in blocks] == [at for at, _ in recorded[name]]


# --- without markers ----------------------------------------------------------------------------

WALKED = 985  # samples: of 1000, the first 15 wait for a calm robot


@pytest.fixture(scope='module')
def walked(tmp_path_factory):
    """Return a walk on nodes, the same one without ROS, and the bag."""
    bag = tmp_path_factory.mktemp('joints') / 'bag'
    scene = scene_of('hexapod_patches', 3)
    on_nodes = composed.run(scene, 'adaptive', seed=2, bag=bag, sensing='joints')
    return on_nodes, trials.run(scene, 'adaptive', seed=2, sensing='joints'), bag


def test_without_markers_the_nodes_walk_as_the_loop_does(walked):
    on_nodes, without, bag = walked
    assert on_nodes.settings['sensing'] == without.settings['sensing'] == 'joints'
    for series in SERIES:
        one, other = getattr(on_nodes, series), getattr(without, series)
        # The true heading is sent as a quaternion, which costs 1e-15 rad, and turns feet by it.
        if series in ('position', 'force'):
            assert np.abs(one - other).max() < 1e-13, series
        else:
            assert np.array_equal(one, other), series
    assert np.abs(on_nodes.body - without.body).max() < 1e-13
    assert on_nodes.metrics == without.metrics
    assert on_nodes.metrics.distance_m > 0.25
    counts = BagReader(bag).counts
    assert counts['/imu/data'] == counts['/joint_states'] == counts['/feet/force'] == 1000
    assert counts['/odom'] == len(on_nodes.time) == WALKED and counts['/feet/estimate'] == 201
    samples = records_of(bag)['sample']
    for name in ('force', 'position', 'velocity', 'variance'):
        assert np.isfinite(samples.rows[name]).all(axis=(1, 2)).sum() == WALKED


def test_a_silent_imu_leaves_a_gap_and_then_a_doubt(tmp_path):
    text = configuration.locate('scenes', 'hexapod_patches').read_text()
    text += """
faults:
  - {kind: imu_silent, start: 1.5, end: 2.3}
  - {kind: joints_silent, start: 2.6, end: 2.65}
"""
    (tmp_path / 'mine.yaml').write_text(text)  # the simulator loads it again
    scene = dataclasses.replace(Scene.load(tmp_path / 'mine.yaml'), cycles=2)
    on_nodes = composed.run(scene, 'flat', seed=1, bag=tmp_path / 'bag', sensing='joints')
    without = trials.run(scene, 'flat', seed=1, sensing='joints')
    assert np.diff(on_nodes.time).max() == pytest.approx(0.804, abs=1e-9)
    assert np.isfinite(on_nodes.odom).all()
    assert np.array_equal(on_nodes.odom, without.odom)
    assert on_nodes.metrics == without.metrics
    said = [
        message.data for _, message, _ in BagReader(tmp_path / 'bag').messages(['/body/doubt'])
    ]
    kinds = [each.partition(':')[0] for each in said]
    assert kinds[0] == ''
    assert 'no IMU' in kinds
    assert kinds[kinds.index('no IMU') + 1] == 'gap'
    assert kinds[kinds.index('gap') + 1] == ''
    codes = records_of(tmp_path / 'bag')['estimate'].rows['doubt'][:, 1]
    assert 'no wrench' in {doubts.kind(code) for code in codes}


def test_a_robot_from_urdf_without_markers(tmp_path):
    urdf = pathlib.Path(__file__).resolve().parents[2] / 'bags' / 'quadruped' / 'robot.urdf'
    named = f'robot: {urdf}\nfeet: [FL_foot, FR_foot, RL_foot, RR_foot]'
    text = configuration.locate('scenes', 'quadruped_patches').read_text()
    (tmp_path / 'mine.yaml').write_text(text.replace('robot: go2', named))
    scene = dataclasses.replace(Scene.load(tmp_path / 'mine.yaml'), cycles=1)
    on_nodes = composed.run(scene, 'flat', seed=1, bag=tmp_path / 'bag', sensing='joints')
    without = trials.run(scene, 'flat', seed=1, sensing='joints')
    assert len(on_nodes.odom) > 360  # the last control period is not whole
    assert np.array_equal(on_nodes.odom, without.odom[: len(on_nodes.odom)])


def test_a_replay_of_the_bag_is_equal_to_the_bit(walked):
    *_, path = walked
    bag = BagReader(path)
    found = replay(bag)
    assert found.settings.tuning.source == 'joints'
    assert not found.settings.tuning.pads_shear
    assert found.verdict == 'equal'
    assert not found.refused
    assert found.samples == dict.fromkeys(SIX, WALKED)
    of_body = [each for each in found.comparisons if each.topic in ('/odom', '/feet/sample')]
    assert len(of_body) == 2 + 6 * len(SAMPLE.fields)
    for each in of_body:
        assert (each.equal, each.missing, each.not_recorded) == (WALKED, 0, 0)
    # Without the velocities it is another estimate: nothing of markers is in this bag.
    settings = NodeSettings.of(bag).changed({'alarm.distance': 1e-3})
    assert replay(bag, settings).verdict == 'different'


# --- ends ---------------------------------------------------------------------------------------


def check_vented(bag):
    """Check that the bag is complete, and that pads had pressure and are flat at its end."""
    assert BagReader(bag).problem is None
    found = records_of(bag)
    pads = found['pressure'].rows['pad']
    assert (pads.max(axis=0) > 30e3).all()
    assert (pads[-1] < 1000.0).all()
    return found


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
    assert recorded.load(tmp_path / 'bag').settings['interrupted']
    assert 2.5 < trial.metrics.duration_s < 2.8
    assert signal.getsignal(signal.SIGTERM) is before
    check_vented(tmp_path / 'bag')


class Hasty:
    """An executor that waits less long once a node is gone."""

    def __init__(self, executor, gone):
        self._executor, self._gone = executor, gone

    def __getattr__(self, name):
        return getattr(self._executor, name)

    def spin_until_future_complete(self, done, timeout_sec):
        while not done.done() and not self._gone:
            self._executor.spin_until_future_complete(done, 0.1)
        self._executor.spin_until_future_complete(done, 0.3)


@pytest.mark.parametrize('deaf', ['estimator', 'regulator'])
def test_a_node_that_does_not_answer_is_reported(deaf, tmp_path):
    with trial_of(scene_of('hexapod_patches', 2), 'dome', 0, tmp_path / 'bag') as trial:
        gone = []
        trial.executor = Hasty(trial.executor, gone)

        def progress(at):
            if at > 0.49 and not gone:
                gone.append(at)
                trial.executor.remove_node(getattr(trial, deaf))

        words = r'waited more than 30 s of wall time for the pressures that answer the samples at'
        with pytest.raises(PadError, match=rf'{words} 0\.5\d\d s: pad doctor checks ROS 2'):
            trial.walk(progress)
    assert BagReader(tmp_path / 'bag').problem is None
    assert len(records_of(tmp_path / 'bag')['sample'].stamps) > 120


def test_an_answer_that_comes_twice_or_late_does_no_harm(monkeypatch, tmp_path):
    """The simulator steps once for each of its moments."""
    scene = scene_of('leg_wet_dome_60', 2)
    send = composed.RegulatorNode._on_command

    def again(node, block):
        send(node, block)
        for stamp_ns in (block.last_ns, block.last_ns - 20 * MS):
            late = pressure(stamp_ns, math.nan)
            node._send(late._replace(rows=late.rows[:, :1]))

    monkeypatch.setattr(composed.RegulatorNode, '_on_command', again)
    on_nodes = composed.run(scene, 'dome', seed=2, bag=tmp_path / 'bag')
    assert np.array_equal(on_nodes.force, trials.run(scene, 'dome', seed=2).force)


def test_a_full_disk_ends_the_trial_with_its_message(context, monkeypatch, tmp_path):
    write = BagWriter.write
    count = 0

    def until_full(self, *arguments):
        nonlocal count
        count += 1
        if count > 500:
            raise BagError('no space left: 500 messages are saved')
        write(self, *arguments)

    monkeypatch.setattr(BagWriter, 'write', until_full)
    with pytest.raises(BagError, match='500 messages are saved'):
        composed.run(scene_of('hexapod_patches', 2), 'dome', bag=tmp_path / 'bag')
    # No node remains and publishes.
    observer = Node('observer', context=context)
    wait_for(lambda: not observer.count_publishers('/feet/command'), 'the end of the nodes')
    observer.destroy_node()


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
