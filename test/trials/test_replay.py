# SPDX-License-Identifier: Apache-2.0
"""Replays of bags of ros_pad, and of bags of other robots, which rosbags writes here."""

import dataclasses
import json
import math
import pathlib
import re

import numpy as np
import pytest
import yaml
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from ros_pad import configuration
from ros_pad.bags import BagReader
from ros_pad.bags import BagWriter
from ros_pad.bags import annotate
from ros_pad.errors import BagError
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.simulation.faults import Fault
from ros_pad.simulation.scene import Scene
from ros_pad.trials import recorded
from ros_pad.trials.comparison import Track
from ros_pad.trials.comparison import compare
from ros_pad.trials.label import CHANGES
from ros_pad.trials.label import PARAMETERS
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.replay import open_bag
from ros_pad.trials.replay import replay

pytest.importorskip('rosbags', reason='bags of other robots are written with rosbags')

from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat
from rosbags.rosbag2 import CompressionMode
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer

SAMPLE = configuration.shared_folder().parent / 'bags' / 'hexapod_patches' / 'bag'
RENEW = (
    'rm -r bags/hexapod_patches && '
    'pad run hexapod_patches --seed 9 --cycles 5 --no-compare --out bags/hexapod_patches'
)
LEGS = (1, 2, 3, 4, 5, 6)
MS = 1_000_000
# Without its description a copy of the sample lacks this value, which is not the default.
TOLD = {'expected_load': 6.8343}


def found_in(bag, values=None, namespace=None, remaps=None, **changes):
    bag = open_bag(bag)
    settings = NodeSettings.of(bag).changed(values, **changes)
    return replay(bag, settings, namespace, remaps)


def copy(
    folder,
    name=lambda topic: topic,
    keep=lambda topic, number: True,
    time=lambda ns, number, topic: ns,
    begin=0.0,
    end=2.0,
    storage=StoragePlugin.MCAP,
    compression=None,
):
    """Copy a part of the sample with rosbags, as another recorder would have written it.

    ``number`` counts the messages of a topic in ``keep``, and all messages in ``time``.
    """
    writer = Writer(folder, version=9, storage_plugin=storage)
    if compression:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with AnyReader([SAMPLE]) as reader, writer:
        connections, counts = {}, {}
        for number, (connection, ns, data) in enumerate(reader.messages()):
            if ns * 1e-9 > end:
                break
            topic = connection.topic
            counts[topic] = counts.get(topic, -1) + 1
            if ns * 1e-9 < begin or not keep(topic, counts[topic]):
                continue
            if name(topic) is None:
                continue
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    name(topic),
                    connection.msgtype,
                    msgdef=connection.msgdef.data,
                    rihs01=connection.digest,
                )
            writer.write(connections[topic], time(ns, number, topic), data)
    return folder


def of(comparisons, kind):
    return [each for each in comparisons if each.kind == kind]


def without_clock(topic):
    return None if topic in ('/clock', '/diagnostics', '/joint_states') else topic


# --- bags of ros_pad ----------------------------------------------------------------------------


shown = []


@pytest.fixture(scope='module')
def sample():
    return replay(open_bag(SAMPLE), progress=shown.append)


def test_the_shipped_bag_is_replayed_as_it_was_recorded(sample):
    """It is bit-identical on the kind of processor that recorded it, else equal up to rounding."""
    parted = [
        f'{each.topic} at {each.first_difference_s:.3f} s by {each.largest_difference}'
        for each in sample.comparisons
        if each.verdict not in ('equal', 'rounding')
    ]
    assert not parted, (
        f'results differ from those when the bag was recorded: {parted[:3]}. If the change is'
        f' intended, record the bag again: {RENEW}'
    )
    assert sample.verdict in ('equal', 'rounding') and sample.notes == []
    assert len(sample.comparisons) == 6 * 8
    for each in sample.comparisons:
        assert each.compared == each.recorded == each.replayed > 0, each.topic
        assert each.missing == each.not_recorded == 0
        if each.kind in ('doubt', 'morphology', 'slipping', 'pressure_setpoint'):
            assert each.equal == each.compared
    assert set(sample.samples.values()) == {6 * 250}  # 1 s to settle, 5 cycles


def test_the_shipped_bag_is_small_and_has_something_to_see(sample):
    files = [path for path in SAMPLE.rglob('*') if path.is_file()]
    assert {path.name for path in files} == {'bag_0.mcap', 'metadata.yaml'}
    assert sum(path.stat().st_size for path in files) < 2_000_000
    assert sum(each.switches[1] for each in sample.outcomes) >= 4
    assert all(each.slips[1] > 0 for each in sample.outcomes)
    trial = recorded.load(SAMPLE)
    assert sum(trial.metrics.switches) == sum(each.switches[0] for each in sample.outcomes)
    assert 0.2 < trial.wet().mean() < 0.8


@pytest.mark.slow
def test_a_walk_on_nodes_is_replayed_to_the_bit(tmp_path):
    """The walk has faults of regulators and sensors; silence is replayed, too."""
    composed = pytest.importorskip('ros_pad.nodes.composed', reason='a walk on nodes needs ROS 2')
    texts = (
        '{kind: silence, legs: [1], start: 1.51, end: 1.93}',
        '{kind: leak, legs: [2], start: 1.0, conductance: 1.0e-9}',
        '{kind: force_frozen, legs: [3], start: 1.2, end: 2.9}',
        '{kind: marker_frozen, legs: [5], start: 1.3, end: 2.3}',
    )
    text = configuration.locate('scenes', 'hexapod_patches').read_text()
    text = text.replace('cycles: 60', 'cycles: 3')
    text = text.replace('  position_noise:', '  moment_noise: 5.0e-4\n  position_noise:')
    path = tmp_path / 'mine.yaml'
    path.write_text(text + 'faults:\n' + ''.join(f'  - {each}\n' for each in texts))
    scene = Scene.load(path)
    assert scene.faults == tuple(Fault.parse(each) for each in texts)
    composed.run(scene, 'adaptive', seed=3, bag=tmp_path / 'bag')
    found = found_in(tmp_path / 'bag')
    assert found.verdict == 'equal', [
        each for each in found.comparisons if each.verdict != 'equal'
    ]
    assert all(each.equal == each.recorded == each.replayed for each in found.comparisons)
    doubts = found.replayed[3, 'doubt'].texts
    assert any('stands still' in each for each in doubts)
    assert sum(len(found.replayed[leg, 'morphology']) for leg in LEGS) > 6
    # Without yaw moments the estimates differ.
    other = found_in(tmp_path / 'bag', {'moment_noise': 0.0})
    assert other.verdict == 'different'


# --- other parameters ---------------------------------------------------------------------------


def test_other_parameters_change_what_they_should(sample):
    other = found_in(SAMPLE, {'wet_prior': 0.9})
    assert other.verdict == 'different'
    first = other.replayed[1, 'wetness'].numbers[0]
    assert sample.replayed[1, 'wetness'].numbers[0] == pytest.approx(0.5, abs=0.02)
    assert first == pytest.approx(0.9, abs=0.02)
    # Measured slip does not depend on the prior.
    assert all(each.verdict in ('equal', 'rounding') for each in of(other.comparisons, 'slip'))
    worst = of(other.comparisons, 'wetness')[0]
    assert 0.3 < worst.largest_difference < 1.0
    assert worst.first_difference_s < 0.03


def test_another_policy_changes_decisions_alone():
    other = found_in(SAMPLE, policy='flat')
    for each in other.comparisons:
        if each.kind not in ('morphology', 'pressure_setpoint'):
            assert each.verdict in ('equal', 'rounding'), each
    assert {each.switches[1] for each in other.outcomes} == {0}
    assert set(other.replayed[2, 'pressure_setpoint'].numbers) == {101325.0}
    fixed = found_in(SAMPLE, {'dome_pressure': 60e3}, policy='dome')
    assert set(fixed.replayed[2, 'pressure_setpoint'].numbers) == {161325.0}


def test_an_oracle_sees_the_floor_of_the_bag():
    other = found_in(SAMPLE, policy='oracle')
    floor = recorded.load(SAMPLE).floor
    for leg in LEGS:
        shapes, setpoints = (
            other.replayed[leg, 'morphology'],
            other.replayed[leg, 'pressure_setpoint'],
        )
        assert shapes.texts[0] == 'flat' and len(setpoints) == 301
    assert sum(each.switches[1] for each in other.outcomes) > 3
    assert (other.settings.floor.wet_map == floor.wet_map).all()


def test_estimates_may_be_published_more_often(sample):
    other = found_in(SAMPLE, {'publish_rate': 125.0})
    # Samples are at 4, 8 ... 6000 ms; the first of each period gives an estimate.
    assert len(sample.replayed[1, 'wetness']) == 6000 // 20 + 1
    assert len(other.replayed[1, 'wetness']) == 6000 // 8 + 1


@pytest.mark.parametrize(
    ('values', 'said'),
    [
        ({'wet_priors': 0.3}, "Did you mean 'wet_prior'"),
        ({'wet_prior': 2.0}, 'wet_prior'),
        ({'policy.dwell': -1}, 'policy.dwell=-1'),
        ({'tow.weight': 3.0}, "'tow.weight' is unknown"),
        ({'expected_load': 'much'}, 'expected_load'),
        ({'dome_pressure': 95e3}, 'ceiling of 90000 Pa'),
        ({'margin': 0}, 'margin'),
    ],
)
def test_parameters_that_are_not_allowed(values, said):
    with pytest.raises(InvalidInput, match=re.escape(said)):
        NodeSettings.of(BagReader(SAMPLE)).changed(values)


def test_another_policy_and_back_keeps_the_policys_parameters():
    settings = NodeSettings.of(BagReader(SAMPLE)).changed({'policy.dwell': 3})
    flat = settings.changed(policy='flat')
    assert 'policy.dwell' not in flat.as_dict()
    assert flat.changed(policy='adaptive').as_dict()['policy.dwell'] == 3


def test_what_does_not_go_together():
    settings = NodeSettings.of(BagReader(SAMPLE))
    with pytest.raises(InvalidInput, match='only the adaptive'):
        settings.changed({'policy.dwell': 3}, policy='dome')
    with pytest.raises(InvalidInput, match='floor'):
        dataclasses.replace(settings, floor=None).changed(policy='oracle')
    with pytest.raises(ConfigError, match='large19'):
        settings.changed(foot='wide')
    assert settings.changed(foot='large19').foot.source == 'large19'


@pytest.mark.parametrize('changes', [{'dome_pressure': None}, {'margin': 'much'}])
def test_parameters_of_other_nodes_are_an_error_of_ours(tmp_path, changes):
    # Parameters as nodes of another version have them.
    said = json.loads(BagReader(SAMPLE).custom_data[PARAMETERS])
    (controller,) = (each for each in said.values() if {'policy', 'margin'} <= each.keys())
    controller.update(changes)
    BagWriter(tmp_path / 'bag', {PARAMETERS: json.dumps(said)}).close()
    with pytest.raises(BagError, match='is missing or not valid'):
        NodeSettings.of(BagReader(tmp_path / 'bag'))
    del controller['dome_pressure']
    BagWriter(tmp_path / 'other', {PARAMETERS: json.dumps(said)}).close()
    with pytest.raises(BagError, match=r"not valid: key 'dome_pressure' is missing"):
        NodeSettings.of(BagReader(tmp_path / 'other'))


def test_a_bag_of_the_planner_of_probes_is_refused_under_its_policy(tmp_path):
    said = json.loads(BagReader(SAMPLE).custom_data[PARAMETERS])
    (controller,) = (each for each in said.values() if {'policy', 'margin'} <= each.keys())
    controller['policy.probing'] = 'value'
    BagWriter(tmp_path / 'bag', {PARAMETERS: json.dumps(said)}).close()
    settings = NodeSettings.of(BagReader(tmp_path / 'bag'))
    with pytest.raises(InvalidInput, match=r"policy.probing = 'value'.*cannot be replayed"):
        settings.changed()
    assert settings.changed(policy='dome').rules()
    controller['policy.probing'] = 'threshold'  # this way of probing is left
    BagWriter(tmp_path / 'other', {PARAMETERS: json.dumps(said)}).close()
    assert NodeSettings.of(BagReader(tmp_path / 'other')).changed().policy == 'adaptive'


# --- bags of other robots -----------------------------------------------------------------------


def test_remapped_topics_in_a_namespace_without_clock(tmp_path):
    def name(topic):
        if without_clock(topic) is None:
            return None
        topic = re.sub(r'/leg_(\d)/wrench', r'/spider/foot_\1/ft', topic)
        topic = re.sub(r'/leg_(\d)/position', r'/spider/mocap/foot\1', topic)
        return topic if topic.startswith('/spider') else '/spider' + topic

    bag = copy(tmp_path / 'bag', name)
    remaps = {'leg_{leg}/wrench': 'foot_{leg}/ft', 'leg_{leg}/position': '/spider/mocap/foot{leg}'}
    found = found_in(bag, TOLD, 'spider', remaps)
    assert found.verdict in ('equal', 'rounding')
    assert found.comparisons[0].topic == '/spider/leg_1/slip'
    assert found.samples == dict.fromkeys(LEGS, 500)
    assert 'foot large37' in found.notes[0]


def test_a_leg_may_be_another_one(tmp_path):
    def name(topic):
        return topic.replace('/leg_4/', '/left/') if topic in inputs else None

    inputs = ['/leg_4/wrench', '/leg_4/position', '/leg_4/pressure']
    bag = copy(tmp_path / 'bag', name)
    remaps = {each.replace('/leg_4/', 'leg_2/'): each.replace('leg_4', 'left') for each in inputs}
    alone = {'learn_friction': False}  # else it depends on the other legs
    found = found_in(bag, TOLD | alone, remaps=remaps)
    every = found_in(SAMPLE, alone)
    assert found.legs == (2,) and found.verdict == 'nothing'
    rows = len(found.replayed[2, 'slip'])
    assert rows == 101
    for kind in ('slip', 'wetness', 'friction_margin'):
        one, other = found.replayed[2, kind], every.replayed[4, kind]
        np.testing.assert_array_equal(one.values, other.values[:rows])


def test_times_of_day_that_jitter_are_no_difference(tmp_path):
    start = 1_750_000_000 * 10**9

    # Messages arrive with jitter, as over a network, and friction later than the next estimate.
    def time(ns, number, topic):
        return start + ns + number % 97 * 9000 + (35 * MS if topic.endswith('friction') else 0)

    bag = copy(tmp_path / 'bag', without_clock, time=time)
    found = found_in(bag, TOLD)
    assert found.verdict in ('equal', 'rounding')
    compared = {each.kind: each.compared for each in found.comparisons if each.leg == 3}
    assert compared['wetness'] == compared['slip'] == 101


def test_samples_before_the_estimator_received_any_are_left_out(tmp_path):
    """The recorder starts first, and the estimator receives samples from 4 ms on."""
    bag = tmp_path / 'bag'
    with (
        AnyReader([SAMPLE]) as reader,
        Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer,
    ):
        connections = {
            each.topic: writer.add_connection(
                each.topic, each.msgtype, msgdef=each.msgdef.data, rihs01=each.digest
            )
            for each in reader.connections
            if each.topic.startswith('/leg_1/')
        }
        wanted = [each for each in reader.connections if each.topic in connections]
        messages = [each for each in reader.messages(wanted) if each[1] <= 1000 * MS]
        for ms in (1, 2, 3):
            for connection, _, data in messages[:2]:
                assert connection.topic.endswith(('wrench', 'position'))
                # The nanoseconds of the stamp follow the CDR header and the seconds.
                early = data[:8] + (ms * MS).to_bytes(4, 'little') + data[12:]
                writer.write(connections[connection.topic], ms * MS, early)
        for connection, ns, data in messages:
            writer.write(connections[connection.topic], ns, data)
    found = found_in(bag, TOLD)
    assert found.verdict in ('equal', 'rounding')
    assert re.match('leg 1: .* later', found.notes[-1])
    assert found.samples == {1: 250}


def test_parameters_that_changed_meanwhile_are_reported(tmp_path):
    bag = copy(tmp_path / 'bag', end=0.5)
    annotate(bag, {CHANGES: json.dumps([[300_000_000, '/controller', 'margin', 1.5]])})
    assert any(
        re.fullmatch(r'0\.30 s: parameter margin of /controller became 1\.5; .*', note)
        for note in found_in(bag).notes
    )


def test_missing_legs_are_noted_and_no_difference(tmp_path):
    def name(topic):
        return None if topic.startswith('/leg_6/') else topic

    bag = copy(tmp_path / 'bag', name, end=7)
    # The copy keeps the description, which lists the sixth leg.
    metadata = yaml.safe_load((SAMPLE / 'metadata.yaml').read_text())
    said = metadata['rosbag2_bagfile_information']['custom_data']
    path = bag / 'metadata.yaml'
    copied = yaml.safe_load(path.read_text())
    copied['rosbag2_bagfile_information']['custom_data'] = said
    path.write_text(yaml.dump(copied))
    found = found_in(bag)
    assert found.legs == (1, 2, 3, 4, 5)
    assert any(note.startswith('leg 6: no wrench') for note in found.notes)
    assert found.verdict == 'gap'
    for each in found.comparisons:
        expected = ('equal', 'rounding')
        if each.kind not in ('slip', 'slipping'):  # what feet learn of friction, and decisions
            expected += ('gap',)
        assert each.verdict in expected, each


def test_a_leg_that_only_spoke_is_missed(tmp_path):
    # The bag has no number of legs, but estimates of leg 6, on whose axes those of others rest.
    bag = copy(tmp_path / 'bag', lambda topic: None if '/leg_6/wrench' in topic else topic, end=7)
    found = found_in(bag, TOLD | {'learn_friction': False, 'wet_prior': 0.3})
    assert any(note.startswith('leg 6: no wrench') for note in found.notes)
    assert found.verdict == 'gap'


def test_drop_outs_are_noted_and_no_difference(tmp_path):
    # Wrenches of leg 2 are missing from 1.2 to 1.4 s, in a stance.
    bag = copy(
        tmp_path / 'bag',
        keep=lambda topic, number: topic != '/leg_2/wrench' or not 300 <= number < 350,
        end=3.0,
    )
    found = found_in(bag, TOLD)
    assert found.verdict == 'gap'
    by_topic = {each.topic: each for each in found.comparisons}
    slip = by_topic['/leg_2/slip']
    assert slip.missing == 10 and slip.excused
    assert slip.first_difference_s == pytest.approx(1.2, abs=0.025)
    assert by_topic['/leg_1/slip'].verdict in ('equal', 'rounding')
    assert by_topic['/leg_1/wetness'].verdict in ('equal', 'rounding', 'gap')
    assert any('leg 2: wrench, 1 gap, the first 1.19' in note for note in found.notes)
    # A difference before the gap still counts.
    assert found_in(bag, TOLD | {'wet_prior': 0.3}).verdict == 'different'


def test_messages_that_were_not_recorded_of_the_answer_are_counted(tmp_path):
    bag = copy(
        tmp_path / 'bag',
        keep=lambda topic, number: topic != '/leg_2/wetness' or number % 3,
    )
    found = found_in(bag, TOLD)
    assert found.verdict in ('equal', 'rounding')
    (wetness,) = [each for each in found.comparisons if each.topic == '/leg_2/wetness']
    assert (wetness.compared, wetness.not_recorded) == (67, 34)


def test_slower_markers_and_other_rates(tmp_path):
    bag = copy(
        tmp_path / 'bag',
        without_clock,
        keep=lambda topic, number: 'position' not in topic or number % 4 == 0,
    )
    found = found_in(bag, TOLD)
    assert all(499 <= each <= 500 for each in found.samples.values())
    assert not found.refused
    # With every second wrench there are half as many samples.
    bag = copy(
        tmp_path / 'half',
        without_clock,
        keep=lambda topic, number: not re.search('wrench|position', topic) or number % 2,
    )
    assert set(found_in(bag, TOLD).samples.values()) == {250}


def test_a_foot_that_falls_silent_is_doubted_as_the_node_does(tmp_path):
    # From 1 to 2 s leg 2 has pressures, but no wrenches and positions.
    bag = copy(
        tmp_path / 'bag',
        lambda topic: (
            topic if re.fullmatch('/leg_[12]/(wrench|position|pressure)', topic) else None
        ),
        keep=lambda topic, number: (
            not (re.fullmatch('/leg_2/(wrench|position)', topic) and 250 <= number < 500)
        ),
        end=3.0,
    )
    found = found_in(bag, TOLD)
    track = found.replayed[2, 'doubt']
    (row,) = [i for i, text in enumerate(track.texts) if text.startswith('no wrench')]
    assert track.times[row] * 1e-9 == pytest.approx(1.0 + 0.4, abs=0.25)
    assert 'no wrench' not in ' '.join(found.replayed[1, 'doubt'].texts)
    # Without estimates there are no set-points.
    setpoints = np.array(found.replayed[2, 'pressure_setpoint'].times) * 1e-9
    assert not np.any((setpoints > 1.05) & (setpoints < 1.95))
    assert np.any(setpoints > 2.0)


def test_without_positions_nothing_is_estimated_which_is_noted(tmp_path):
    bag = copy(tmp_path / 'bag', lambda topic: topic if topic.endswith('wrench') else None)
    found = found_in(bag)
    assert set(found.samples.values()) == {0}
    assert any('no position' in note for note in found.notes)
    assert any('no pressure' in note for note in found.notes)
    assert found.replayed[1, 'doubt'].texts[0].startswith('no position')
    assert found.verdict == 'nothing'
    assert found.outcomes[0].wet_ends == (None, 0)


def test_splits_are_one_bag(tmp_path):
    first = copy(tmp_path / 'bag', end=1.0)
    second = copy(tmp_path / 'more', begin=1.0000001, end=2.0)
    (part,) = second.glob('*.mcap')
    part.rename(first / 'bag_1.mcap')
    path = first / 'metadata.yaml'
    metadata = yaml.safe_load(path.read_text())
    information = metadata['rosbag2_bagfile_information']
    information['relative_file_paths'].append('bag_1.mcap')
    path.write_text(yaml.dump(metadata))
    found = found_in(first, TOLD)
    assert found.verdict in ('equal', 'rounding')
    assert set(found.samples.values()) == {500}


def test_chunks_in_zstd_and_lz4(tmp_path):
    bag = copy(tmp_path / 'zstd', end=0.5, compression=CompressionMode.STORAGE)
    path = bag / 'metadata.yaml'
    # rosbags writes the compression as a mode of the bag; ros2 bag record leaves the mode empty.
    metadata = yaml.safe_load(path.read_text())
    metadata['rosbag2_bagfile_information']['compression_mode'] = ''
    path.write_text(yaml.dump(metadata))
    (file,) = bag.glob('*.mcap')
    assert b'zstd' in file.read_bytes()
    assert found_in(bag, TOLD).verdict in ('equal', 'rounding')
    lone = tmp_path / 'lone.mcap'
    with lone.open('wb') as stream, AnyReader([SAMPLE]) as reader:
        writer = McapWriter(stream, compression=CompressionType.LZ4)
        writer.start(profile='ros2', library='test')
        channels = {}
        for connection, ns, data in reader.messages():
            if ns > 500 * MS:
                break
            if connection.topic not in channels:
                schema = writer.register_schema(
                    connection.msgtype, 'ros2msg', connection.msgdef.data.encode()
                )
                channels[connection.topic] = writer.register_channel(
                    connection.topic, 'cdr', schema
                )
            writer.add_message(channels[connection.topic], ns, data, ns)
        writer.finish()
    found = found_in(lone, TOLD)
    assert found.verdict in ('equal', 'rounding') and set(found.samples.values()) == {125}


def test_bags_in_sqlite_are_refused_with_the_way_out(tmp_path):
    bag = copy(tmp_path / 'bag', end=0.1, storage=StoragePlugin.SQLITE3)
    (file,) = bag.glob('*.db3')
    for path in (bag, file):
        with pytest.raises(BagError, match=r'ros2 bag convert -i \S+bag -o mcap.yaml'):
            open_bag(path)


@pytest.mark.parametrize(
    ('topic', 'kind'),
    [
        ('/leg_1/wrench', 'geometry_msgs/msg/Wrench'),
        ('/leg_1/position', 'geometry_msgs/msg/PoseStamped'),
        ('/leg_1/pressure', 'sensor_msgs/msg/Range'),
        ('/clock', 'builtin_interfaces/msg/Time'),
    ],
)
def test_other_types_are_named(tmp_path, topic, kind):
    from rosbags.typesys import Stores
    from rosbags.typesys import get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for name, type_name in (
            ('/leg_2/wrench', 'geometry_msgs/msg/WrenchStamped'),
            (topic, kind),
        ):
            connection = writer.add_connection(name, type_name, typestore=store)
            writer.write(connection, 1, bytes(400))
    with pytest.raises(BagError, match=f'{topic} is a {kind}: .* is needed'):
        found_in(tmp_path / 'bag')


@pytest.mark.parametrize(
    ('remaps', 'said'),
    [
        ({'leg_{leg}/wrenches': '/x_{leg}'}, 'Did you mean leg_{leg}/wrench?'),
        ({'leg_{leg}/wrench': '/leg_{leg}/fts'}, 'has no topic /leg_{leg}/fts; similar ones are'),
        ({'leg_1/wrench': '/leg_{leg}/wrench'}, 'on both sides of := or on neither'),
        ({'leg_{leg}/wrench': '/leg_{leg}/wrench', 'leg_1/wrench': '/leg_2/wrench'}, 'already'),
    ],
)
def test_remaps_that_fit_nothing(remaps, said):
    with pytest.raises(InvalidInput, match=re.escape(said)):
        found_in(SAMPLE, remaps=remaps)


def test_a_bag_without_wrenches_lists_its_topics(tmp_path):
    bag = copy(tmp_path / 'bag', lambda topic: topic if 'wetness' in topic else None, end=0.1)
    with pytest.raises(BagError, match=r'no wrench of a leg.*/leg_1/wetness'):
        found_in(bag)


# --- comparing, by hand -------------------------------------------------------------------------


def track(*messages, width=1):
    """Return a track of messages (ms, number), or (ms, text) if ``width`` is 0."""
    made = Track(width)
    for ms, value in messages:
        if width:
            made.add(ms * MS, (value,))
        else:
            made.add_text(ms * MS, value)
    return made


def compared(one, other, **options):
    return compare('/leg_1/wetness', 1, 'wetness', one, other, **options)


def test_numbers_are_compared_to_the_bit():
    nan, inf = math.nan, math.inf
    same = track((20, 0.1), (40, nan), (60, inf))
    found = compared(same, same)
    assert (found.compared, found.equal, found.largest_difference) == (3, 3, 0.0)
    assert found.verdict == 'equal'
    found = compared(same, track((20, 0.1), (40, 0.2), (60, inf)))
    assert (found.equal, found.largest_difference, found.verdict) == (2, inf, 'different')
    found = compared(track((20, 0.5), (40, 0.5)), track((20, 0.5), (40, 0.75)), start_ns=10 * MS)
    assert (found.equal, found.largest_difference) == (1, 0.25)
    assert found.first_difference_s == pytest.approx(0.030)
    found = compared(track((20, 0.5)), track((20, np.nextafter(0.5, 1.0))))
    assert (found.equal, found.verdict) == (0, 'rounding')
    assert compared(track((20, 0.5)), track((20, 0.5 + 1e-11))).verdict == 'different'


def test_messages_that_are_late_or_lost():
    # 40 is 15 ms late, 60 is 1 ms early, 80 is not recorded, and 100 is not replayed.
    one = track((20, 2.0), (55, 4.0), (59, 6.0), (100, 10.0))
    other = track((20, 2.0), (40, 4.0), (60, 6.0), (80, 8.0))
    found = compared(one, other)
    assert (found.compared, found.equal, found.missing, found.not_recorded) == (3, 3, 1, 1)
    assert found.verdict == 'different' and found.first_difference_s == pytest.approx(0.1)
    assert compared(one, other, gap_ns=90 * MS).verdict == 'gap'
    assert compared(one, other, gap_ns=101 * MS).verdict == 'different'
    # A message is compared with one other message only.
    found = compared(track((20, 1.0), (25, 1.0)), track((20, 1.0)))
    assert (found.compared, found.missing) == (1, 1)
    nothing = compared(track(), track())
    assert (nothing.compared, nothing.verdict) == (0, 'equal')


def test_texts_count_each():
    one = track((20, 'flat'), (60, 'dome'), width=0)
    assert compared(one, one).verdict == 'equal'
    found = compared(one, track((20, 'flat'), (60, 'flat'), width=0))
    assert (found.equal, found.verdict, found.largest_difference) == (1, 'different', None)
    more = track((20, 'flat'), (60, 'dome'), (90, 'flat'), width=0)
    found = compared(one, more)
    assert found.verdict == 'different' and found.first_difference_s == pytest.approx(0.09)


def test_progress_ends_at_one(sample):
    assert shown == sorted(shown) and shown[-1] == 1.0 and len(shown) >= 5


def test_a_missing_scene_is_noted(tmp_path):
    bag = copy(tmp_path / 'bag', end=0.2)
    path = bag / 'metadata.yaml'
    content = yaml.safe_load(path.read_text())
    said = yaml.safe_load((SAMPLE / 'metadata.yaml').read_text())
    text = said['rosbag2_bagfile_information']['custom_data']['ros_pad']
    content['rosbag2_bagfile_information']['custom_data'] = {
        'ros_pad': text.replace('"scene": "hexapod_patches"', '"scene": "/gone/mine.yaml"')
    }
    path.write_text(yaml.dump(content))
    found = found_in(bag)
    assert found.notes[0].startswith("scene '/gone/mine.yaml' of the bag cannot be read")
    content['rosbag2_bagfile_information']['custom_data'] = {'ros_pad': '[1, 2]'}
    path.write_text(yaml.dump(content))
    with pytest.raises(BagError, match='does not describe a trial'):
        found_in(bag)
    assert pathlib.Path(bag).exists()
