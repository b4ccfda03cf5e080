# SPDX-License-Identifier: Apache-2.0
import contextlib
import dataclasses
import os
import random
import resource
import shutil
import warnings

import numpy as np
import pytest
import yaml

pytest.importorskip('rclpy', reason='rclpy is needed: it serializes the messages')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TwistWithCovarianceStamped, WrenchStamped
from mcap.stream_reader import StreamReader
from mcap.writer import Writer
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader
from std_msgs.msg import Bool, Float64

from ros_pad.bags import BagReader, BagWriter, annotate
from ros_pad.bags.codec import definition_of
from ros_pad.bags.wire import Wire
from ros_pad.errors import BagError, InvalidInput
from ros_pad.records import ESTIMATE, PRESSURE, SAMPLE, Block

QOS = """
- history: keep_last
  depth: 10
  reliability: reliable
  durability: volatile
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: automatic
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""

MESSAGES = [
    WrenchStamped,
    TwistWithCovarianceStamped,
    Float64,
    Bool,
    DiagnosticArray,
]


def type_name(message_class):
    return f'{message_class.__module__.split(".")[0]}/msg/{message_class.__name__}'


def example(message_class, number, chance):
    message = message_class()
    if hasattr(message, 'header'):
        message.header.stamp.sec = number
        message.header.stamp.nanosec = 999_999_999 - number
        message.header.frame_id = f'leg_{number}' * (number % 3)  # strings of several lengths
    match message:
        case WrenchStamped():
            message.wrench.force.z = chance.gauss(3.0, 1.0)
            message.wrench.torque.x = chance.gauss(0.0, 1e-9)
        case TwistWithCovarianceStamped():
            message.twist.twist.linear.x = chance.gauss(0.0, 1.0)
            message.twist.covariance = [chance.gauss(0.0, 1.0) for _ in range(36)]
        case Float64():
            message.data = chance.random()
        case Bool():
            message.data = bool(number % 2)
        case DiagnosticArray():
            values = [KeyValue(key='κ', value=str(number))] * (number % 4)
            message.status = [DiagnosticStatus(level=b'\x01', name='bus', values=values)]
    return message


def plain(value):
    """Return a message of any library as nested dicts, lists, numbers and text."""
    if hasattr(value, 'get_fields_and_field_types'):  # rclpy
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if dataclasses.is_dataclass(value):  # rosbags
        names = [field.name for field in dataclasses.fields(value)]
        # All fields of ROS messages are in lower case; the rest are constants and the type.
        return {n: plain(getattr(value, n)) for n in names if n.islower() and n[:2] != '__'}
    if isinstance(value, bytes):  # some libraries read a byte as a number
        return value[0] if len(value) == 1 else list(value)
    if isinstance(value, (str, bool, int, float)):
        return value
    return [plain(element) for element in value]


@pytest.fixture
def recorded(tmp_path, monkeypatch):
    """Return a bag of many chunks and what was written into it: (topic, message, time)."""
    monkeypatch.setattr('ros_pad.bags.writer.CHUNK_SIZE', 4096)
    chance = random.Random(7)
    written = []
    with BagWriter(tmp_path / 'trial', {'scene': 'hexapod_patches', 'seed': '0'}) as writer:
        for message_class in MESSAGES:
            writer.add_topic(f'/{message_class.__name__}', type_name(message_class), QOS)
        for number in range(200):
            for message_class in MESSAGES:
                message = example(message_class, number, chance)
                log_time = 10**18 + number * 4_000_000
                writer.write(f'/{message_class.__name__}', serialize_message(message), log_time)
                written.append((f'/{message_class.__name__}', plain(message), log_time))
    return tmp_path / 'trial', written


def one_bag(folder, count=10, **options):
    with BagWriter(folder, **options) as writer:
        writer.add_topic('/data', 'std_msgs/msg/Float64', QOS)
        for number in range(count):
            writer.write('/data', serialize_message(Float64(data=float(number))), number)
    return folder


def test_our_reader_gives_back_what_was_written(recorded):
    folder, written = recorded
    for path in (folder, folder / 'trial_0.mcap'):
        reader = BagReader(path)
        assert [(t, plain(m), at) for t, m, at in reader.messages()] == written
        assert reader.topics == {f'/{m.__name__}': type_name(m) for m in MESSAGES}
        assert reader.counts == dict.fromkeys(reader.topics, 200)
        assert reader.message_count == 200 * len(MESSAGES)
        assert (reader.start, reader.end) == (10**18, 10**18 + 199 * 4_000_000)
        assert reader.problem is None
    assert BagReader(folder).custom_data == {'scene': 'hexapod_patches', 'seed': '0'}


def test_rosbags_reads_the_same(recorded):
    folder, written = recorded
    with AnyReader([folder]) as reader:
        assert reader.message_count == len(written)
        assert {c.topic: c.msgcount for c in reader.connections} == {
            f'/{m.__name__}': 200 for m in MESSAGES
        }
        assert {c.topic: c.digest for c in reader.connections}['/Float64'] == (
            definition_of('std_msgs/msg/Float64')[1]
        )
        profile = reader.connections[0].ext.offered_qos_profiles[0]
        assert (profile.reliability.name, profile.depth) == ('RELIABLE', 10)
        read = [
            (connection.topic, plain(reader.deserialize(data, connection.msgtype)), at)
            for connection, at, data in reader.messages()
        ]
    order = sorted(read, key=lambda entry: (entry[2], entry[0]))
    assert order == sorted(written, key=lambda entry: (entry[2], entry[0]))


def test_metadata_is_what_rosbag2_of_jazzy_writes(tmp_path):
    folder = one_bag(tmp_path / 'test', custom_data={'seed': '0'})
    text = (folder / 'metadata.yaml').read_text()
    assert '&' not in text and '*' not in text  # no YAML anchors
    # Keys, their order and the form of each value are those of `ros2 bag record -s mcap`.
    start, duration = {'nanoseconds_since_epoch': 0}, {'nanoseconds': 9}
    topic = {
        'name': '/data',
        'type': 'std_msgs/msg/Float64',
        'serialization_format': 'cdr',
        'offered_qos_profiles': yaml.safe_load(QOS),
        'type_description_hash': 'RIHS01_705ba9c3d1a09df43737eb67095534de'
        '36fd426c0587779bda2bc51fe790182a',
    }
    part = {'path': 'test_0.mcap', 'starting_time': start, 'duration': duration}
    expected = {
        'version': 9,
        'storage_identifier': 'mcap',
        'duration': duration,
        'starting_time': start,
        'message_count': 10,
        'topics_with_message_count': [{'topic_metadata': topic, 'message_count': 10}],
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': ['test_0.mcap'],
        'files': [part | {'message_count': 10}],
        'custom_data': {'seed': '0'},
        'ros_distro': 'jazzy',
    }
    said = yaml.safe_load(text)['rosbag2_bagfile_information']
    assert said == expected and list(said) == list(expected)
    assert sorted(os.listdir(folder)) == ['metadata.yaml', 'test_0.mcap']


def test_hashes_and_definitions_are_those_of_ros():
    # These are the hashes in bags that were recorded with ROS 2 Jazzy.
    assert definition_of('std_msgs/msg/String')[1] == (
        'RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18'
    )
    parts = definition_of('diagnostic_msgs/msg/DiagnosticArray')[0].split('=' * 80 + '\n')
    assert {part.splitlines()[0] for part in parts[1:]} == {
        'MSG: diagnostic_msgs/DiagnosticStatus',
        'MSG: diagnostic_msgs/KeyValue',
        'MSG: std_msgs/Header',
        'MSG: builtin_interfaces/Time',
    }


def test_never_overwrites(tmp_path):
    folder = one_bag(tmp_path / 'trial')
    before = (folder / 'trial_0.mcap').read_bytes()
    with pytest.raises(BagError, match=f'{folder}: exists'):
        BagWriter(folder)
    assert (folder / 'trial_0.mcap').read_bytes() == before
    (tmp_path / 'empty').mkdir()
    with pytest.raises(BagError, match='exists'):
        BagWriter(tmp_path / 'empty')
    (tmp_path / 'file').touch()
    with pytest.raises(BagError, match='cannot be created'):
        BagWriter(tmp_path / 'file' / 'trial')


def test_misuse_is_refused(tmp_path):
    writer = BagWriter(tmp_path / 'trial')
    writer.add_topic('/data', 'std_msgs/msg/Float64')
    with pytest.raises(BagError, match='has topic /data already'):
        writer.add_topic('/data', 'std_msgs/msg/Float64')
    with pytest.raises(BagError, match='/other: this topic was not added'):
        writer.write('/other', b'', 0)
    with pytest.raises(InvalidInput, match='-1 ns is not allowed: at least 0 ns'):
        writer.write('/data', b'', -1)
    with pytest.raises(InvalidInput, match=r"custom_data\['seed'\] = 0 .* text is needed"):
        writer.describe({'seed': 0})
    writer.describe({'outcome': 'done'})
    writer.close()
    writer.close()
    for data in ({'x': 1}, {1: 'x'}, ['x']):
        with pytest.raises(InvalidInput, match=r'custom_data.* is needed'):
            annotate(tmp_path / 'trial', data)
        with pytest.raises(InvalidInput, match=r'custom_data.* is needed'):
            BagWriter(tmp_path / 'other', data)
    assert BagReader(tmp_path / 'trial').custom_data == {'outcome': 'done'}
    for call in (
        lambda: writer.write('/data', b'', 0),
        lambda: writer.add_topic('/more', 'std_msgs/msg/Float64'),
        writer.flush,
    ):
        with pytest.raises(BagError, match='closed'):
            call()


def test_a_full_disk_reports_how_much_is_saved(tmp_path):
    writer = BagWriter(tmp_path / 'trial')
    writer.add_topic('/data', 'std_msgs/msg/Float64')
    chance = random.Random(1)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, hard))
    try:
        with pytest.raises(BagError, match=r'[1-9][0-9]* messages are saved') as caught:
            for number in range(100_000):
                message = Float64(data=chance.random())
                writer.write('/data', serialize_message(message), number)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    with (tmp_path / 'trial' / 'trial_0.mcap').open('rb') as stream:
        saved = 0
        with contextlib.suppress(Exception):
            for record in StreamReader(stream).records:
                saved += type(record).__name__ == 'Message'
    assert f' {saved} messages are saved' in str(caught.value)
    with pytest.raises(BagError, match='the bag is closed'):
        writer.write('/data', b'', 0)
    writer.close()
    with pytest.warns(UserWarning, match=f'{saved} messages can still be read'):
        assert len(list(BagReader(tmp_path / 'trial').messages())) == saved


def test_a_full_disk_leaves_no_half_of_its_metadata(tmp_path, monkeypatch):
    BagWriter(tmp_path / 'trial', {'a': '1'}).close()
    before = (tmp_path / 'trial' / 'metadata.yaml').read_bytes()

    def fsync(number):
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(os, 'fsync', fsync)
    with pytest.raises(BagError, match='No space left'):
        annotate(tmp_path / 'trial', {'b': '2'})
    assert sorted(each.name for each in (tmp_path / 'trial').iterdir()) == [
        'metadata.yaml',
        'trial_0.mcap',
    ]
    assert (tmp_path / 'trial' / 'metadata.yaml').read_bytes() == before


def test_a_bag_cut_anywhere_gives_its_beginning_or_an_error(recorded, tmp_path):
    folder, written = recorded
    whole = (folder / 'trial_0.mcap').read_bytes()
    lengths = []
    for size in [*range(0, 60, 7), *range(100, len(whole) - 1, len(whole) // 40), len(whole) - 1]:
        cut = tmp_path / 'cut.mcap'
        cut.write_bytes(whole[:size])
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            try:
                reader = BagReader(cut)
            except BagError as error:
                assert '0 messages can still be read' in str(error)
                continue
        read = [(t, plain(m), at) for t, m, at in reader.messages()]
        assert len(read) == reader.message_count
        assert read == written[: len(read)]
        lengths.append(len(read))
    assert lengths[-1] == len(written) and len(set(lengths)) > 2


def test_bags_of_other_writers(tmp_path):
    """A bag may have several files, and files without chunks, as `ros2 bag record` can write."""
    folder = one_bag(tmp_path / 'trial')
    with (folder / 'trial_1.mcap').open('wb') as stream:
        writer = Writer(stream, use_chunking=False)
        writer.start('ros2')
        schema = writer.register_schema('std_msgs/msg/Float64', 'ros2msg', b'float64 data')
        writer.register_channel('/first', 'cdr', schema)
        channel = writer.register_channel('/data', 'cdr', schema)
        for number in range(10, 15):
            data = serialize_message(Float64(data=float(number)))
            writer.add_message(channel, number, data, number)
        writer.finish()
    metadata = yaml.safe_load((folder / 'metadata.yaml').read_text())
    files = metadata['rosbag2_bagfile_information']['relative_file_paths']
    files.append('trial_1.mcap')
    (folder / 'metadata.yaml').write_text(yaml.safe_dump(metadata))
    reader = BagReader(folder)
    assert [message.data for _, message, _ in reader.messages()] == [float(n) for n in range(15)]
    assert reader.counts == {'/data': 15, '/first': 0}
    assert (reader.start, reader.end) == (0, 14)


def test_log_times_of_each_topic(recorded):
    folder, written = recorded
    times = BagReader(folder).log_times()
    assert {topic: each.tolist() for topic, each in times.items()} == {
        f'/{kind.__name__}': [at for topic, _, at in written if topic == f'/{kind.__name__}']
        for kind in MESSAGES
    }


PATHS = {
    '/WrenchStamped': ('wrench.force.z', 'header.stamp.sec', 'wrench.torque.x'),
    '/TwistWithCovarianceStamped': ('twist.covariance[7]',),
    '/Bool': ('data',),
    '/DiagnosticArray': ('header.stamp.sec',),  # has lists
    '/Float64': (),
    '/absent': ('data',),
}


def expected_values(written):
    """Return topic, values and time of the messages on the topics of PATHS."""
    return [
        (topic, tuple(value_of(message, path) for path in PATHS[topic]), at)
        for topic, message, at in written
        if topic in PATHS
    ]


def value_of(message, path):
    for name in path.replace(']', '').replace('[', '.').split('.'):
        message = message[int(name) if name.isdigit() else name]
    return message


def test_tables_are_those_of_the_messages(recorded):
    folder, written = recorded
    shares = []
    _, tables = BagReader(folder).read({}, PATHS, shares.append)
    assert shares == sorted(shares) and shares[-1] == 1.0 and len(shares) > 10
    expected = expected_values(written)
    for topic, (times, values) in tables.items():
        assert times.tolist() == [at for name, _, at in expected if name == topic]
        rows = [list(row) for name, row, _ in expected if name == topic]
        assert values.shape == (len(rows), len(PATHS[topic]))
        assert values.tolist() == rows
        assert values.dtype == float


@pytest.mark.parametrize('several', [1, 3])
def test_records_are_those_written_in_their_order(tmp_path, several):
    """Estimates of legs 3 and 1 and pressures in turn, one or several in a message."""
    kinds = {f'/feet/{kind.name}': kind for kind in (ESTIMATE, PRESSURE)}
    written = dict.fromkeys(kinds, b'')
    with BagWriter(tmp_path / 'trial') as writer:
        for topic in kinds:
            writer.add_topic(topic, 'sensor_msgs/msg/JointState')
        for number in range(0, 60, several):
            for topic, kind in kinds.items():
                rows = kind.rows(several, 2)
                rows['detail'] = number
                block = Block(10**9 + number + np.arange(several), rows)
                writer.write(topic, Wire(kind, (3, 1)).encode(block), 20_000_000 * number)
                written[topic] += rows.tobytes()
    found = BagReader(tmp_path / 'trial').records(kinds | {'/feet/sample': SAMPLE})
    assert set(found) == set(kinds)
    for topic, (legs, times, block) in found.items():
        assert legs == (3, 1)
        assert times.tolist() == [20_000_000 * (n - n % several) for n in range(60)]
        assert block.stamps.tolist() == [10**9 + number for number in range(60)]
        assert block.rows.tobytes() == written[topic]


@pytest.mark.parametrize('kind', ['short', 'big_endian_xml', 'field', 'text'])
def test_values_that_cannot_be_read_are_an_error(tmp_path, kind):
    good = serialize_message(WrenchStamped())
    bad = {'short': good[:-9], 'big_endian_xml': b'\0\2' + good[2:], 'field': good, 'text': good}[
        kind
    ]
    with BagWriter(tmp_path / 'trial') as writer:
        writer.add_topic('/wrench', 'geometry_msgs/msg/WrenchStamped')
        for time_ns, data in enumerate((good, good, bad, bad)):
            writer.write('/wrench', data, time_ns)
    path = {'field': 'wrench.force.w', 'text': 'header.frame_id'}.get(kind, 'wrench.torque.z')
    field = kind in ('field', 'text')
    words = 'message on /wrench: ' if field else '/wrench at 2 ns cannot be decoded'
    reader = BagReader(tmp_path / 'trial')
    with pytest.raises(BagError, match=words):
        reader.tables({'/wrench': (path,)})


def test_what_is_no_bag_is_refused(tmp_path):
    with pytest.raises(BagError, match='absent: no such bag'):
        BagReader(tmp_path / 'absent')
    with pytest.raises(
        BagError, match=r'is not a bag, or an incomplete one: it has no metadata\.yaml'
    ):
        BagReader(tmp_path)
    (tmp_path / 'notes.txt').write_text('pressures in kPa')
    with pytest.raises(BagError, match=r'notes\.txt: is not an MCAP file'):
        BagReader(tmp_path / 'notes.txt')

    folder = one_bag(tmp_path / 'trial')
    text = (folder / 'metadata.yaml').read_text()

    def refused(metadata, match):
        (folder / 'metadata.yaml').write_text(metadata)
        with pytest.raises(BagError, match=match):
            BagReader(folder)

    refused('- : {', 'metadata.yaml: is not the metadata of a bag')
    refused('[]', 'metadata.yaml: is not the metadata of a bag')
    refused('other: 1', 'metadata.yaml: is not the metadata of a bag')
    refused(text.replace('identifier: mcap', 'identifier: sqlite3'), "storage 'sqlite3'")
    refused(text.replace("compression_mode: ''", 'compression_mode: FILE'), "mode 'FILE'")
    refused(text.replace('trial_0', 'trial_7'), 'its file trial_7.mcap is missing')
    shutil.copy(folder / 'trial_0.mcap', tmp_path / 'alone.mcap')
    assert BagReader(tmp_path / 'alone.mcap').message_count == 10
