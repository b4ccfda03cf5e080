# SPDX-License-Identifier: Apache-2.0
"""Replays of bags of ros_pad, and of bags of other robots, which rosbags writes here."""

import json
import math
import operator
import re

import numpy as np
import pytest

from ros_pad import configuration
from ros_pad.bags import BagReader, BagWriter, annotate, topics
from ros_pad.bags.codec import message_type, put_field
from ros_pad.bags.wire import Wire, legs_of
from ros_pad.errors import BagError, InvalidInput
from ros_pad.estimation import doubt as doubts
from ros_pad.records import COMMAND, ESTIMATE, Block, Field, Kind
from ros_pad.records import SAMPLE as SAMPLES
from ros_pad.simulation.faults import Fault
from ros_pad.simulation.scene import Scene
from ros_pad.trials.bag_notes import CHANGES, PARAMETERS
from ros_pad.trials.comparison import Stream, compare
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.replay import replay

pytest.importorskip('rosbags', reason='bags of other robots are written with rosbags')

from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

SAMPLE = configuration.shared_folder().parent / 'bags' / 'hexapod_patches' / 'bag'
RENEW = (
    'rm -r bags/hexapod_patches && '
    'pad run hexapod_patches --seed 9 --cycles 5 --no-compare --out bags/hexapod_patches'
)
LEGS = (1, 2, 3, 4, 5, 6)
MS = 1_000_000
# Without its description a copy of the sample lacks this value, which is not the default.
TOLD = {'expected_load': 6.8343}
QUANTITIES = len(ESTIMATE.fields) + len(COMMAND.fields)


def found_in(bag, values=None, namespace=None, remaps=None, **changes):
    bag = BagReader(bag)
    settings = NodeSettings.of(bag).changed(values, **changes)
    return replay(bag, settings, namespace, remaps)


STORE = get_typestore(Stores.ROS2_JAZZY)


def type_of(name):
    return message_type(name, STORE.generate_msgdef(name, ros_version=2)[0])


def of_legs(name, data):
    """Yield topic, type and bytes of what drivers would have published in place of a record."""
    kind = {'/feet/sample': SAMPLES, '/feet/pressure': topics.PRESSURE.record}[name]
    legs = legs_of(data)
    numbers = Wire(kind, legs).decode(data).rows.view('f8').reshape(len(legs), -1)
    stamp = Wire(kind, legs).decode(data).last_ns
    for topic in (topics.LEG_WRENCH, topics.LEG_POSITION, topics.LEG_PRESSURE):
        if topic.record is kind:
            places = [kind.columns.index(each) for each in topic.columns]
            paths = (*topics.STAMP, *topic.values)
            message = type_of(topic.type_name).blank()
            for leg, row in zip(legs, numbers, strict=True):
                values = topics.from_record(topic, row[places], 101325.0).tolist()
                for path, value in zip(paths, (*divmod(stamp, 10**9), *values), strict=True):
                    put_field(message, path, value)
                data = type_of(topic.type_name).encode(message)
                yield f'/{topic.name(leg)}', topic.type_name, data


def copy(
    folder,
    name=lambda topic: topic,
    keep=lambda topic, number: True,
    time=lambda ns, number, topic: ns,
    begin=0.0,
    end=2.0,
    storage=StoragePlugin.MCAP,
    legs=False,
):
    """Copy a part of the sample with rosbags, as another recorder would have written it.

    ``number`` counts the messages of a topic in ``keep``, and all messages in ``time``. With
    ``legs``, there are wrenches, positions and pressures of single legs in place of their records.
    """
    writer = Writer(folder, version=9, storage_plugin=storage)
    with AnyReader([SAMPLE]) as reader, writer:
        connections, counts = {}, {}

        def write(number, topic, kind, ns, data):
            counts[topic] = counts.get(topic, -1) + 1
            if ns * 1e-9 < begin or not keep(topic, counts[topic]) or name(topic) is None:
                return
            if topic not in connections:
                connections[topic] = writer.add_connection(name(topic), kind, typestore=STORE)
            writer.write(connections[topic], time(ns, number, topic), data)

        for number, (connection, ns, data) in enumerate(reader.messages()):
            topic = connection.topic
            if ns * 1e-9 > end:
                break
            if legs and topic in ('/feet/sample', '/feet/pressure'):
                for own, kind, each in of_legs(topic, data):
                    write(number, own, kind, ns, each)
            else:
                write(number, topic, connection.msgtype, ns, data)
    return folder


def of(comparisons, name):
    return [each for each in comparisons if each.quantity == name]


def fine(comparison):
    return comparison.verdict in ('equal', 'rounding')


def without_clock(topic):
    return topic if topic.startswith(('/leg_', '/feet')) else None


# --- bags of ros_pad ----------------------------------------------------------------------------


shown = []


@pytest.fixture(scope='module')
def sample():
    return replay(BagReader(SAMPLE), progress=shown.append)


def test_the_shipped_bag_is_replayed_as_it_was_recorded(sample):
    """It is bit-identical on the kind of processor that recorded it, else equal up to rounding."""
    parted = [
        f'leg {each.leg}, {each.quantity} at {each.first_difference_s:.3f} s'
        f' by {each.largest_difference}'
        for each in sample.comparisons
        if not fine(each)
    ]
    assert not parted, (
        f'results differ from those when the bag was recorded: {parted[:3]}. If the change is'
        f' intended, record the bag again: {RENEW}'
    )
    assert sample.verdict in ('equal', 'rounding') and sample.notes == []
    assert len(sample.comparisons) == 6 * QUANTITIES
    for each in sample.comparisons:
        assert each.compared == 301 and each.missing == each.not_recorded == 0
        if each.quantity in ('doubt', 'dome', 'slipping', 'setpoint'):
            assert each.equal == each.compared
    assert set(sample.samples.values()) == {6 * 250}  # 1 s to settle, 5 cycles


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
    assert all(each.equal == each.compared == 201 for each in found.comparisons)
    assert all(each.missing == each.not_recorded == 0 for each in found.comparisons)
    rows = found.streams['estimate'].block.rows[:, 2]
    texts = {doubts.text(code, *detail) for code, detail in rows[['doubt', 'detail']].tolist()}
    assert any('stands still' in each for each in texts)
    assert sum(each.switches[1] for each in found.outcomes) > 0
    # Without yaw moments the estimates differ.
    other = found_in(tmp_path / 'bag', {'moment_noise': 0.0})
    assert other.verdict == 'different'


# --- other parameters ---------------------------------------------------------------------------


def test_another_policy_changes_decisions_alone():
    other = found_in(SAMPLE, policy='flat')
    for each in other.comparisons:
        if each.quantity not in ('dome', 'setpoint'):
            assert fine(each), each
    assert {each.switches[1] for each in other.outcomes} == {0}
    assert set(other.replayed[2, 'setpoint'].values[:, 0]) == {0.0}
    fixed = found_in(SAMPLE, {'dome_pressure': 60e3}, policy='dome')
    assert set(fixed.replayed[2, 'setpoint'].values[:, 0]) == {60e3}
    # The recorded pressures follow other set-points, but no pad counts as stuck.
    assert {each.switches[1] for each in fixed.outcomes} == {0}


@pytest.mark.parametrize('changes', [{'dome_pressure': None}, {'margin': 'much'}])
def test_parameters_of_other_nodes_are_an_error_of_ours(tmp_path, changes):
    # Parameters as nodes of another version have them.
    said = json.loads(BagReader(SAMPLE).custom_data[PARAMETERS])
    (controller,) = (each for each in said.values() if {'policy', 'margin'} <= each.keys())
    controller.update(changes)
    BagWriter(tmp_path / 'bag', {PARAMETERS: json.dumps(said)}).close()
    with pytest.raises(BagError, match='is missing or not valid'):
        NodeSettings.of(BagReader(tmp_path / 'bag'))


# --- bags of other robots -----------------------------------------------------------------------


def test_remapped_topics_in_a_namespace_without_clock(tmp_path):
    def name(topic):
        if without_clock(topic) is None:
            return None
        topic = re.sub(r'/leg_(\d)/wrench', r'/spider/foot_\1/ft', topic)
        topic = re.sub(r'/leg_(\d)/position', r'/spider/mocap/foot\1', topic)
        return topic if topic.startswith('/spider') else '/spider' + topic

    bag = copy(tmp_path / 'bag', name, legs=True)
    remaps = {'leg_{leg}/wrench': 'foot_{leg}/ft', 'leg_{leg}/position': '/spider/mocap/foot{leg}'}
    found = found_in(bag, TOLD, 'spider', remaps)
    assert fine(found)
    assert found.comparisons[0].topic == '/spider/feet/estimate'
    assert found.samples == dict.fromkeys(LEGS, 500)
    assert 'foot large37' in found.notes[0]


def test_a_leg_may_be_another_one(tmp_path):
    def name(topic):
        return topic.replace('/leg_4/', '/left/') if topic in inputs else None

    inputs = ['/leg_4/wrench', '/leg_4/position', '/leg_4/pressure']
    bag = copy(tmp_path / 'bag', name, legs=True)
    remaps = {each.replace('/leg_4/', 'leg_2/'): each.replace('leg_4', 'left') for each in inputs}
    alone = {'learn_friction': False}  # else it depends on the other legs
    found = found_in(bag, TOLD | alone, remaps=remaps)
    every = found_in(SAMPLE, alone)
    assert found.legs == (2,) and found.verdict == 'nothing'
    rows = len(found.replayed[2, 'slip'].times)
    assert rows == 101
    for kind in ('slip', 'wetness', 'margin'):
        one, other = found.replayed[2, kind], every.replayed[4, kind]
        np.testing.assert_array_equal(one.values, other.values[:rows])


def test_times_of_day_that_jitter_are_no_difference(tmp_path):
    start = 1_750_000_000 * 10**9

    # Messages arrive with jitter, as over a network, and estimates later than the next samples.
    def time(ns, number, topic):
        late = 35 * MS if topic in ('/feet/estimate', '/feet/command') else 0
        return start + ns + number % 97 * 9000 + late

    found = found_in(copy(tmp_path / 'bag', without_clock, time=time, legs=True), TOLD)
    assert fine(found)
    assert {each.compared for each in found.comparisons} == {101}
    assert found.start_ns - start < 10 * MS and found.duration_s == pytest.approx(2.03, abs=0.02)


def test_what_nodes_say_and_receive_before_the_first_estimate_is_left_out(tmp_path):
    """The recorder starts first, and the estimator receives samples from 4 ms on.

    Between samples, nodes tell of feet whose sensors are silent.
    """
    bag = copy(tmp_path / 'bag', without_clock, end=1.0)
    with AnyReader([bag]) as reader:
        messages = [(each.topic, ns, data) for each, ns, data in reader.messages()]
    nothing = Wire(ESTIMATE, LEGS).encode(Block.of(500_000, ESTIMATE.rows(6)))
    messages.append(('/feet/estimate', 500_000, nothing))
    added = [('/feet/sample', 1.0), ('/feet/sample', 2.0), ('/feet/sample', 3.0)]
    added += [('/feet/estimate', 701.3), ('/feet/command', 701.3)]
    for topic, ms in added:
        data = next(data for each, ns, data in messages if each == topic and ns >= 4 * MS)
        # The nanoseconds of the stamp follow the CDR header and the seconds.
        other = data[:8] + round(ms * MS).to_bytes(4, 'little') + data[12:]
        messages.append((topic, round(ms * MS), other))
    made = Writer(tmp_path / 'late', version=9, storage_plugin=StoragePlugin.MCAP)
    with made as writer:
        connections = {
            topic: writer.add_connection(topic, topics.SAMPLE.type_name, typestore=STORE)
            for topic in {topic for topic, _, _ in messages}
        }
        for topic, ns, data in sorted(messages, key=operator.itemgetter(1)):
            writer.write(connections[topic], ns, data)
    found = found_in(tmp_path / 'late', TOLD)
    assert fine(found) and {each.compared for each in found.comparisons} == {51}
    assert re.match('the estimator started later .* 3 samples', found.notes[-1])
    assert set(found.samples.values()) == {250}


def test_parameters_that_changed_meanwhile_are_reported(tmp_path):
    bag = copy(tmp_path / 'bag', end=0.5)
    annotate(bag, {CHANGES: json.dumps([[300_000_000, '/controller', 'margin', 1.5]])})
    assert any(
        re.fullmatch(r'0\.30 s: parameter margin of /controller became 1\.5; .*', note)
        for note in found_in(bag).notes
    )


def test_drop_outs_of_a_leg_are_noted_and_no_difference(tmp_path):
    # Wrenches of leg 2 are missing from 1.2 to 1.4 s, in a stance.
    bag = copy(
        tmp_path / 'bag',
        keep=lambda topic, number: topic != '/leg_2/wrench' or not 300 <= number < 350,
        end=3.0,
        legs=True,
    )
    found = found_in(bag, TOLD)
    assert found.verdict == 'gap'
    of_leg = {(each.leg, each.quantity): each for each in found.comparisons}
    load = of_leg[2, 'load']
    assert load.missing == 0 and load.verdict == 'gap'
    assert load.first_difference_s == pytest.approx(1.22, abs=0.025)
    assert fine(of_leg[1, 'slip'])
    assert of_leg[1, 'wetness'].verdict in ('equal', 'rounding', 'gap')
    assert any('force of leg 2: 1 gap, the first 1.19' in note for note in found.notes)
    # A difference before the gap still counts.
    assert found_in(bag, TOLD | {'wet_prior': 0.3}).verdict == 'different'


def test_lost_records_are_noted_and_no_difference(tmp_path):
    bag = copy(
        tmp_path / 'bag',
        keep=lambda topic, number: topic != '/feet/sample' or not 300 <= number < 350,
        end=3.0,
    )
    found = found_in(bag, TOLD)
    assert found.verdict == 'gap'
    assert {(each.missing, each.verdict) for each in found.comparisons} == {(10, 'gap')}
    assert all(
        each.first_difference_s == pytest.approx(1.2, abs=0.025) for each in found.comparisons
    )
    assert any('sample: 1 gap, the first 1.19' in note for note in found.notes)


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
        legs=True,
    )
    found = found_in(bag, TOLD)
    track, other = (found.replayed[leg, 'doubt'] for leg in (2, 1))
    silent = [doubts.kind(code) == 'no wrench' for code in track.values[:, 0]]
    assert track.stamps[silent][0] * 1e-9 == pytest.approx(1.0 + 0.4, abs=0.25)
    assert 'no wrench' not in {doubts.kind(code) for code in other.values[:, 0]}
    # Without estimates there are no set-points.
    track = found.replayed[2, 'setpoint']
    setpoints = track.stamps[np.isfinite(track.values[:, 0])] * 1e-9
    assert not np.any((setpoints > 1.05) & (setpoints < 1.95))
    assert np.any(setpoints > 2.0)


def test_bags_in_sqlite_are_refused_with_the_way_out(tmp_path):
    bag = copy(tmp_path / 'bag', end=0.1, storage=StoragePlugin.SQLITE3)
    with pytest.raises(BagError, match='ros2 bag convert'):
        BagReader(bag)


@pytest.mark.parametrize(
    ('remaps', 'said'),
    [
        ({'leg_{leg}/wrenches': '/x_{leg}'}, "Did you mean 'leg_{leg}/wrench'"),
        ({'leg_{leg}/wrench': '/leg_{leg}/fts'}, "'/leg_{leg}/fts' is not allowed: one of"),
        ({'leg_1/wrench': '/leg_{leg}/wrench'}, 'on both sides of := or on neither'),
        ({'leg_{leg}/wrench': '/leg_{leg}/wrench', 'leg_1/wrench': '/leg_2/wrench'}, 'already'),
    ],
)
def test_remaps_that_fit_nothing(tmp_path, remaps, said):
    bag = copy(tmp_path / 'bag', end=0.1, legs=True)
    with pytest.raises(InvalidInput, match=re.escape(said)):
        found_in(bag, remaps=remaps)


def test_a_bag_without_wrenches_lists_its_topics(tmp_path):
    bag = copy(tmp_path / 'bag', lambda topic: topic if 'estimate' in topic else None, end=0.1)
    with pytest.raises(BagError, match=r'no wrench of a leg.*/feet/estimate'):
        found_in(bag)


# --- comparing, by hand -------------------------------------------------------------------------


KIND = Kind('estimate', '', (Field('wetness', '', ''),))


def stream(*records):
    """Return a stream of one number: (ms, number) for each record."""
    stamps = np.array([ms * MS for ms, _ in records], np.int64)
    rows = KIND.rows(len(records), 1)
    rows['wetness'][:, 0] = [value for _, value in records]
    return Stream(KIND, (1,), stamps, Block(stamps, rows))


def compared(one, other, **options):
    (found,) = compare('/feet/estimate', one, other, **options)
    return found


def test_numbers_are_compared_to_the_bit():
    nan, inf = math.nan, math.inf
    same = stream((20, 0.1), (40, nan), (60, inf))
    found = compared(same, same)
    assert (found.compared, found.equal, found.largest_difference) == (3, 3, 0.0)
    assert found.verdict == 'equal'
    found = compared(same, stream((20, 0.1), (40, 0.2), (60, inf)))
    assert (found.equal, found.largest_difference, found.verdict) == (2, inf, 'different')
    found = compared(stream((20, 0.5), (40, 0.5)), stream((20, 0.5), (40, 0.75)), start_ns=10 * MS)
    assert (found.equal, found.largest_difference) == (1, 0.25)
    assert found.first_difference_s == pytest.approx(0.030)
    rounded = np.nextafter(0.5, 1.0)
    found = compared(stream((20, 0.5)), stream((20, rounded)))
    assert (found.equal, found.verdict, found.first_difference_s) == (0, 'rounding', None)
    # Rounding before a gap is not its first difference.
    found = compared(
        stream((20, 0.5), (40, 0.5)), stream((20, rounded), (40, 1.0)), gap_ns=30 * MS
    )
    assert (found.verdict, found.first_difference_s) == ('gap', pytest.approx(0.040))
    assert compared(stream((20, 0.5)), stream((20, 0.5 + 1e-11))).verdict == 'different'
