# SPDX-License-Identifier: Apache-2.0
"""Fields are read and written as rclpy and rosbags do it; anything else is refused."""

import dataclasses
import functools
import importlib
import math
import operator
import pickle
import random
import struct
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from ros_pad.bags import topics
from ros_pad.bags.codec import MessageType
from ros_pad.bags.fields import FieldReader, FieldWriter, field_of
from ros_pad.bags.topics import FRAME, STAMP, Topic
from ros_pad.errors import BadMessage, UnknownEncoding

BOOL = 'std_msgs/msg/Bool'
JOINT_STATE = 'sensor_msgs/msg/JointState'
POINT = 'geometry_msgs/msg/PointStamped'
STRING = 'std_msgs/msg/String'
WITH_LISTS = {
    JOINT_STATE,
    'diagnostic_msgs/msg/DiagnosticArray',
    'nav_msgs/msg/Odometry',  # two texts
    'visualization_msgs/msg/MarkerArray',
}
STORE = get_typestore(Stores.ROS2_JAZZY)
TOPICS = [each for each in vars(topics).values() if isinstance(each, Topic)]
FIXED = sorted({topic.type_name for topic in TOPICS} - WITH_LISTS)
LITTLE, BIG = True, False
quick = settings(max_examples=30, deadline=None)


@functools.cache
def of_type(name):
    return MessageType(name, STORE.generate_msgdef(name, ros_version=2)[0])


def leaves(message, path=''):
    """Return the paths of all numbers and texts of a message without lists."""
    if isinstance(message, np.ndarray):
        return [f'{path}[{place}]' for place in range(len(message))]
    if not dataclasses.is_dataclass(message):
        return [path]
    names = [each.name for each in dataclasses.fields(message) if each.name[:2] != '__']
    return [
        leaf
        for name in names
        for leaf in leaves(getattr(message, name), f'{path}.{name}'.lstrip('.'))
    ]


TYPES = {name: of_type(name) for name in FIXED}
LEAVES = {name: leaves(TYPES[name].blank()) for name in FIXED}


def is_text(name, path):
    return path == FRAME or name == STRING


NUMBERS = {name: [path for path in LEAVES[name] if not is_text(name, path)] for name in FIXED}
# Of each type all fields, and those of each topic: stamp and frame, if it has them, and values.
PATHS = {
    name: [
        LEAVES[name],
        *(
            [path for path in (*STAMP, FRAME, *topic.values) if path in LEAVES[name]]
            for topic in TOPICS
            if topic.type_name == name
        ),
    ]
    for name in FIXED
}
READERS = {name: [FieldReader(TYPES[name], paths) for paths in PATHS[name]] for name in FIXED}

every_type = pytest.mark.parametrize('name', FIXED)
floats = st.floats() | st.sampled_from(
    [math.nan, -math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, sys.float_info.max]
)
texts = st.text(st.characters(exclude_categories=['Cs'], exclude_characters='\0'), max_size=40)


def value(name, path):
    """Return the strategy of a field."""
    if is_text(name, path):
        return texts
    return {
        'sec': st.integers(-(2**31), 2**31 - 1) | st.sampled_from([-(2**31), 2**31 - 1]),
        'nanosec': st.integers(0, 2**32 - 1) | st.just(2**32 - 1),
    }.get(path.rpartition('.')[2], st.booleans() if name == BOOL else floats)


CONTENTS = {
    name: st.fixed_dictionaries({path: value(name, path) for path in LEAVES[name]})
    for name in FIXED
}


def put(message, content):
    """Put values into a message of rclpy or rosbags; return it."""
    for path, each in content.items():
        field, _, place = path.rstrip(']').partition('[')
        owner, _, attribute = field.rpartition('.')
        target = operator.attrgetter(owner)(message) if owner else message
        if place:
            getattr(target, attribute)[int(place)] = each
        else:
            setattr(target, attribute, each)
    return message


def encoded(name, content, little_endian=LITTLE):
    """Return the bytes of a message as rosbags makes them."""
    message = put(TYPES[name].blank(), content)
    return bytes(STORE.serialize_cdr(message, name, little_endian=little_endian))


def some(name, text='leg_1_sole', first=0.5):
    """Return values of which no two numbers of a message are the same."""
    content = {path: first + place for place, path in enumerate(LEAVES[name])}
    for path in content:
        if is_text(name, path):
            content[path] = text
        elif path.endswith('sec'):
            content[path] = int(content[path])
        elif name == BOOL:
            content[path] = True
    return content


def bits(values):
    """Return types and values; NaN equals NaN of the same bits, and 0.0 does not equal -0.0."""
    return [
        (type(each), struct.pack('<d', each) if type(each) is float else each) for each in values
    ]


def chosen(content, paths):
    return bits(content[path] for path in paths)


def check(name, content, data):
    for reader in READERS[name]:
        assert bits(reader(data)) == chosen(content, reader.paths)


def ros_class(name):
    package, _, of_ros = name.split('/')
    return getattr(importlib.import_module(f'{package}.msg'), of_ros)


def test_the_types_with_all_their_fields_and_topics_are_tested():
    assert {len(LEAVES[name]) for name in FIXED} == {1, 2, 5, 6, 9, 10, 40, 45}
    assert {LEAVES[POINT][0], *LEAVES[POINT][-3:]} == {STAMP[0], 'point.x', 'point.y', 'point.z'}
    there = [topic for topic in TOPICS if topic.type_name not in WITH_LISTS]
    assert sum(len(paths) - 1 for paths in PATHS.values()) == len(there)


@every_type
@given(data=st.data())
@quick
def test_fields_are_read_as_rclpy_wrote_them(name, data):
    serialization = pytest.importorskip('rclpy.serialization')
    content = data.draw(CONTENTS[name])
    check(name, content, serialization.serialize_message(put(ros_class(name)(), content)))


@every_type
@given(data=st.data())
@quick
def test_fields_are_read_in_both_byte_orders(name, data):
    content = data.draw(CONTENTS[name])
    for order in (LITTLE, BIG):
        check(name, content, encoded(name, content, order))


@every_type
@pytest.mark.parametrize('order', [LITTLE, BIG])
def test_texts_of_all_lengths_are_read(name, order):
    for letter in ('a', 'κ', '🦎'):
        for length in range(41):
            content = some(name, letter * length)
            check(name, content, encoded(name, content, order))


@given(data=st.data())
@quick
def test_fields_are_read_in_the_order_of_the_paths(data):
    name = data.draw(st.sampled_from(FIXED))
    paths = data.draw(st.lists(st.sampled_from(LEAVES[name]), unique=True))
    content = some(name)
    reader = FieldReader(TYPES[name], paths)
    for order in (LITTLE, BIG):
        assert bits(reader(encoded(name, content, order))) == chosen(content, paths)


def test_bytes_behind_a_message_are_not_read():
    content = some(POINT)
    check(POINT, content, encoded(POINT, content) + b'\xff' * 9)


@every_type
@given(data=st.data())
@quick
def test_messages_are_written_as_rosbags_writes_them(name, data):
    content = data.draw(CONTENTS[name])
    paths = data.draw(st.permutations(NUMBERS[name]))
    constants = {path: content[path] for path in LEAVES[name] if path not in paths}
    write = FieldWriter(TYPES[name], paths, constants)
    written = write(*(content[path] for path in paths))
    assert written == encoded(name, content)
    check(name, content, written)


def unread(message_type, data):
    """Return the places of the bytes that mean nothing."""

    def changes(place, mask):
        other = bytearray(data)
        other[place] ^= mask
        try:
            return message_type.encode(message_type.decode(bytes(other))) != data
        except Exception:  # rosbags raises any
            return True

    return {n for n in range(len(data)) if not (changes(n, 0x01) or changes(n, 0x80))}


def same_but_for_padding(message_type, ours, theirs):
    """Compare bytes with those of rclpy, which leaves anything in padding, also at the end."""
    ignored = unread(message_type, ours)
    return all(n in ignored or ours[n] == theirs[n] for n in range(len(ours)))


@every_type
@given(data=st.data())
@settings(max_examples=10, deadline=None)
def test_messages_are_written_as_rclpy_writes_them(name, data):
    serialization = pytest.importorskip('rclpy.serialization')
    content = data.draw(CONTENTS[name])
    constants = {path: content[path] for path in LEAVES[name] if path not in NUMBERS[name]}
    write = FieldWriter(TYPES[name], NUMBERS[name], constants)
    ours = write(*(content[path] for path in NUMBERS[name]))
    theirs = serialization.serialize_message(put(ros_class(name)(), content))
    assert same_but_for_padding(TYPES[name], ours, theirs)
    read = serialization.deserialize_message(ours, ros_class(name))
    values = [plain(field_of(read, path)) for path in LEAVES[name]]
    assert bits(values) == chosen(content, LEAVES[name])


def plain(value):
    """Return a number of Python in place of one of NumPy."""
    return value.item() if isinstance(value, np.generic) else value


def test_few_bytes_are_taken_for_padding():
    data = encoded(POINT, some(POINT, 'abc'))
    assert unread(TYPES[POINT], data) == {2, 3}  # the options, which CDR does not use
    data = encoded(POINT, some(POINT, 'abcd'))
    assert unread(TYPES[POINT], data) == {2, 3, *range(21, 28)}


lists = st.lists(floats, max_size=8)
joint_states = st.fixed_dictionaries(
    {
        **{path: value(POINT, path) for path in (*STAMP, FRAME)},
        **{'name': st.lists(texts, max_size=8), 'position': lists},
        **{'velocity': lists, 'effort': lists},
    }
)
empty_lists = {'name': ['a'], 'position': [], 'velocity': [1.0], 'effort': []}
empty_lists |= {STAMP[0]: 1, STAMP[1]: 2, FRAME: ''}


def joint_state(content):
    """Return the bytes of a JointState, of which only stamp and positions may differ."""
    count = len(content['position'])
    write = FieldWriter(
        of_type(JOINT_STATE),
        [*(f'position[{place}]' for place in reversed(range(count))), *STAMP],
        {path: content[path] for path in (FRAME, 'name', 'velocity', 'effort')}
        | {'position': [0.0] * count},
    )
    return write(*reversed(content['position']), content[STAMP[0]], content[STAMP[1]])


@given(content=joint_states)
@example(content=empty_lists)
@quick
def test_lists_of_constant_length_are_written_as_rosbags_writes_them(content):
    message_type = of_type(JOINT_STATE)
    arrays = {path: np.array(content[path]) for path in ('position', 'velocity', 'effort')}
    message = put(message_type.blank(), content | arrays)
    assert joint_state(content) == message_type.encode(message)


@given(content=joint_states)
@example(content=empty_lists)
@settings(max_examples=10, deadline=None)
def test_lists_of_constant_length_are_written_as_rclpy_writes_them(content):
    serialization = pytest.importorskip('rclpy.serialization')
    message = put(ros_class(JOINT_STATE)(), content)
    ours, theirs = joint_state(content), serialization.serialize_message(message)
    assert same_but_for_padding(of_type(JOINT_STATE), ours, theirs)
    read = serialization.deserialize_message(ours, ros_class(JOINT_STATE))
    assert (read.header, read.name) == (message.header, content['name'])
    for path in ('position', 'velocity', 'effort'):
        assert bits(getattr(read, path)) == bits(content[path])


def test_a_writer_refuses_what_the_type_has_not():
    for path in ('point.w', 'point', FRAME):
        with pytest.raises(ValueError, match=path):
            FieldWriter(TYPES[POINT], [path])
    with pytest.raises(ValueError, match='twice'):
        FieldWriter(TYPES[POINT], ['point.x', 'point.y', 'point.x'])
    with pytest.raises(ValueError, match='position'):
        FieldWriter(of_type(JOINT_STATE), ['position[1]'], {'position': [0.0]})
    with pytest.raises(AttributeError, match='frame'):
        FieldWriter(TYPES[POINT], ['point.x'], {'header.frame': 'world'})


@pytest.mark.parametrize('values', [(2**31, 0.0), (0.5, 0.0), (0, 'a'), (0, None), (0, 0.0, 0.0)])
def test_a_writer_refuses_values_that_do_not_fit(values):
    write = FieldWriter(TYPES[POINT], [STAMP[0], 'point.x'])
    assert len(write(2**31 - 1, 0.0)) == 4 + 16 + 24
    with pytest.raises(struct.error):
        write(*values)


@every_type
@pytest.mark.parametrize('order', [LITTLE, BIG])
def test_every_truncation_is_refused(name, order):
    for text in ('', 'κleg', 'x' * 9):
        data = encoded(name, some(name, text), order)
        readers = [*READERS[name], FieldReader(TYPES[name], LEAVES[name][:1])]
        numbers = FieldReader(TYPES[name], NUMBERS[name])
        for size in range(len(data)):
            torn = data[:size]
            for read in (*readers, numbers):
                with pytest.raises(BadMessage) as raised:
                    read(torn)
                assert raised.type is BadMessage
            for messages in ([torn], [torn] * 2, [data, torn]):
                with pytest.raises(BadMessage):
                    numbers.table(messages)


ENCAPSULATIONS = [b'\0\2', b'\0\3', b'\0\7', b'\0\x81', b'\1\0', b'\1\1', b'\xff\xff']


@every_type
@pytest.mark.parametrize('encapsulation', ENCAPSULATIONS)
def test_what_is_not_plain_cdr_is_refused(name, encapsulation):
    right = encoded(name, some(name))
    wrong = encapsulation + right[2:]
    for reader in READERS[name]:
        with pytest.raises(UnknownEncoding, match=encapsulation.hex()):
            reader(wrong)
    for messages in ([wrong], [right, wrong]):
        with pytest.raises(UnknownEncoding, match=encapsulation.hex()):
            FieldReader(TYPES[name], NUMBERS[name]).table(messages)


def with_text(text, order='<'):
    """Return a point with bytes in place of its text."""
    padding = bytes(-(12 + len(text)) % 8)
    head = b'\0\1\0\0' if order == '<' else bytes(4)
    size = len(text)
    return head + struct.pack(f'{order}iII', 1, 2, size) + text + padding + (
        struct.pack(order + '3d', 0.1, 0.2, 0.3)
    )  # fmt: skip


@pytest.mark.parametrize('order', '<>')
@pytest.mark.parametrize(
    'text', [b'\xff\0', b'a\x80b\0', b'\xc0\x80\0', b'\xed\xa0\x80\0', b'\xce']
)
def test_a_text_that_is_not_utf_8_is_refused_where_it_is_read(text, order):
    data = with_text(text, order)
    with pytest.raises(BadMessage, match='UTF-8') as raised:
        FieldReader(TYPES[POINT], ['point.x', FRAME])(data)
    assert raised.type is BadMessage
    assert FieldReader(TYPES[POINT], ['point.x'])(data) == (0.1,)


@pytest.mark.parametrize(
    ('data', 'text'),
    [
        (b'', ''),  # rclpy, too, reads these three
        (b'\0', ''),
        (b'abc', 'abc'),
        (b'a\0b\0', 'a\0b'),  # rosbags reads these two so; for rclpy they end at the first zero
        (b'ab\0\0', 'ab\0'),
    ],
)
def test_texts_that_no_node_writes_are_read(data, text):
    for order in '<>':
        read = FieldReader(TYPES[POINT], [FRAME, 'point.y'])
        assert read(with_text(data, order)) == (text, 0.2)


@pytest.mark.parametrize('size', [2**32 - 1, 2**32 - 12, 2**31, 2**31 - 1, 2**16, 24, 9])
def test_a_size_beyond_the_message_is_refused_and_not_remembered(size):
    reader = FieldReader(TYPES[POINT], ['point.x'])
    for order in '<>':
        data = bytearray(with_text(b'abc\0', order))
        data[12:16] = struct.pack(order + 'I', size)
        with pytest.raises(BadMessage, match='too few') as raised:
            reader(bytes(data))
        assert raised.type is BadMessage
    assert reader._plan is None


def test_texts_of_many_sizes_are_read_one_after_another():
    reader = FieldReader(TYPES[POINT], ['point.x', FRAME])
    for size in range(100, 1100):
        assert reader(with_text(b'a' * size)) == (0.1, 'a' * size)
    usual = with_text(b'leg_1_sole\0')
    reader(usual)
    plan = reader._plan
    assert reader(usual) == (0.1, 'leg_1_sole') and reader._plan is plan


def damaged(name, chance):
    """Return random bytes, or a message with some random bytes in it, cut or prolonged."""
    if chance.random() < 0.1:
        return chance.randbytes(chance.randrange(80))
    text = 'leg_1_sole'[: chance.randrange(11)]
    data = bytearray(encoded(name, some(name, text), chance.choice([LITTLE, BIG])))
    if chance.random() < 0.3:
        data += bytes(chance.randrange(8))
    usual = [0, 1, 2, 3, 6, 7, 0x41, 0x7F, 0x80, 0xFF]
    for _ in range(chance.randrange(4)):
        place = chance.randrange(min(len(data), 32))  # where text and its size are
        data[place] = chance.choice([*usual, chance.randrange(256)])
    return bytes(data[: chance.randrange(len(data) + 1)] if chance.random() < 0.2 else data)


def result(read, data):
    """Return the values of a message, or the kind of its error; other errors are raised."""
    try:
        return read(data)
    except BadMessage as error:
        return type(error)


def rosbags_reads(name, data):
    """Return numbers as rosbags reads them, None if it does not."""
    try:
        message = TYPES[name].decode(data)
    except Exception:  # rosbags raises any
        return None
    return [plain(field_of(message, path)) for path in NUMBERS[name]]


@every_type
@given(
    data=st.one_of(
        st.binary(max_size=100),
        st.builds(
            bytes.__add__, st.sampled_from([bytes(4), b'\0\1\0\0']), st.binary(max_size=400)
        ),
        st.integers(0, 2**64).map(random.Random),
    )
)
@settings(max_examples=100, deadline=None)
def test_random_bytes_are_read_as_rosbags_reads_them_or_refused(name, data):
    if isinstance(data, random.Random):
        data = damaged(name, data)
    for reader in READERS[name]:
        result(reader, data)  # raises any other error
    ours = result(FieldReader(TYPES[name], NUMBERS[name]), data)
    theirs = rosbags_reads(name, data)
    if theirs is not None:
        # For rosbags, bytes that end within the text are enough.
        assert isinstance(ours, tuple) or (name == STRING and ours is BadMessage)
        assert not isinstance(ours, tuple) or bits(ours) == bits(theirs)


RCLPY = """
import importlib, pickle, sys
from rclpy.serialization import deserialize_message
from ros_pad.bags.fields import field_of
answers = []
for name, paths, inputs in pickle.load(sys.stdin.buffer):
    package, _, of_ros = name.split('/')
    of_ros = getattr(importlib.import_module(package + '.msg'), of_ros)
    results = []
    for data in inputs:
        try:
            message = deserialize_message(data, of_ros)
            values = [field_of(message, path) for path in paths]
            results.append([v.item() if hasattr(v, 'item') else v for v in values])
        except Exception as error:
            assert type(error).__name__ == 'RMWError', error
            results.append(None)
    answers.append(results)
pickle.dump(answers, sys.stdout.buffer)
"""


def test_damaged_messages_are_read_as_rclpy_reads_them_or_refused():
    pytest.importorskip('rclpy.serialization')
    chance = random.Random(1)
    inputs = {name: [damaged(name, chance) for _ in range(500)] for name in FIXED}
    asked = [(name, LEAVES[name], inputs[name]) for name in FIXED]
    # In a process of its own, which such bytes might end.
    child = subprocess.run(
        [sys.executable, '-c', RCLPY], input=pickle.dumps(asked), capture_output=True, check=True
    )
    kinds = set()
    for name, answers in zip(FIXED, pickle.loads(child.stdout), strict=True):
        for data, theirs in zip(inputs[name], answers, strict=True):
            ours = result(READERS[name][0], data)
            kinds.add((ours if isinstance(ours, type) else tuple, theirs is None))
            if isinstance(ours, tuple):
                # For rclpy, but not for rosbags, a text ends at its first zero.
                assert theirs is not None
                assert bits(map(until_zero, ours)) == bits(theirs)
            elif theirs is not None:
                # The only messages that rclpy reads and the reader does not.
                plain_cdr = data[:2] in (b'\0\0', b'\0\1')
                assert ours is (BadMessage if plain_cdr else UnknownEncoding)
                assert not plain_cdr or not_utf_8(name, data)
    assert kinds == {
        *((tuple, False), (BadMessage, False), (UnknownEncoding, False)),
        *((BadMessage, True), (UnknownEncoding, True)),
    }


def until_zero(value):
    return value.partition('\0')[0] if isinstance(value, str) else value


def not_utf_8(name, data):
    """Return whether the text of a message is not UTF-8."""
    size_at = 4 if name == STRING else 12
    (size,) = struct.unpack_from('>I' if data[1] == 0 else '<I', data, size_at)
    try:
        data[size_at + 4 : size_at + 4 + size].decode()
    except UnicodeDecodeError:
        return True
    return False


# Sets of messages by text and byte order: all the same, and mixed.
SETS = {
    'one': [('leg_1_sole', LITTLE)],
    'same, little-endian': [('leg_1_sole', LITTLE)] * 5,
    'same, big-endian': [('leg_1_sole', BIG)] * 5,
    'empty texts': [('', LITTLE)] * 5,
    'other texts of one size': [('leg_1', LITTLE), ('leg_2', LITTLE)],
    'sizes that give the same length': [('a' * 4, LITTLE), ('a' * 6, LITTLE)],
    'sizes': [('a' * size, LITTLE) for size in range(20)],
    'orders': [('leg_1_sole', order) for order in (LITTLE, BIG, BIG, LITTLE)],
    'orders and sizes': [('a' * size, size % 3 == 0) for size in range(20)],
}


@every_type
@pytest.mark.parametrize('kinds', SETS.values(), ids=SETS)
def test_a_table_has_the_values_of_each_message(name, kinds):
    contents = [some(name, text, first) for first, (text, _) in enumerate(kinds)]
    if name == BOOL:
        contents = [{'data': bool(place % 2)} for place in range(len(kinds))]
    for content in contents[:2]:
        for path, special in zip(NUMBERS[name][-2:], (math.nan, -0.0), strict=False):
            if isinstance(content[path], float):
                content[path] = special
    messages = [
        encoded(name, content, order) for content, (_, order) in zip(contents, kinds, strict=True)
    ]
    for paths in (NUMBERS[name], NUMBERS[name][::-1], NUMBERS[name][-1:], []):
        table = FieldReader(TYPES[name], paths).table(messages)
        assert (table.dtype, table.shape) == (np.float64, (len(messages), len(paths)))
        for row, content in zip(table, contents, strict=True):
            assert bits(row.tolist()) == bits(float(content[path]) for path in paths)


@given(data=st.data())
@quick
def test_a_table_equals_the_calls_row_by_row(data):
    name = data.draw(st.sampled_from(FIXED))
    paths = data.draw(st.permutations(NUMBERS[name]))
    contents = data.draw(st.lists(CONTENTS[name], max_size=4))
    reader = FieldReader(TYPES[name], paths)
    messages = [encoded(name, content, data.draw(st.booleans())) for content in contents]
    table = reader.table(messages)
    assert table.shape == (len(messages), len(paths))
    for row, message in zip(table, messages, strict=True):
        assert bits(row.tolist()) == bits(map(float, reader(message)))


def test_a_table_reads_messages_with_more_bytes_behind_them():
    data = encoded(POINT, some(POINT))
    table = FieldReader(TYPES[POINT], ['point.z', 'point.x']).table([data, data + b'\xff' * 8])
    assert table.tolist() == [[5.5, 3.5]] * 2
    # Two messages of one size whose numbers are at other places.
    short, long = encoded(POINT, some(POINT, 'a')) + bytes(8), encoded(POINT, some(POINT, 'a' * 9))
    assert len(short) == len(long)
    table = FieldReader(TYPES[POINT], ['point.z', 'point.x']).table([short, long])
    assert table.tolist() == [[5.5, 3.5]] * 2
    read = FieldReader(TYPES[BOOL], ['data'])
    assert read.table([b'\0\1\0\0\2']).tolist() == [[1.0]] == [list(read(b'\0\1\0\0\2'))]


@every_type
def test_a_table_of_no_messages_has_no_rows(name):
    assert FieldReader(TYPES[name], NUMBERS[name]).table([]).shape == (0, len(NUMBERS[name]))


@pytest.mark.parametrize('texts', [[], ['12'], ['12', '12'], ['12', '345'], ['a', 'b']])
def test_a_table_has_no_texts(texts):
    messages = [encoded(POINT, some(POINT, text)) for text in texts]
    with pytest.raises(ValueError, match=FRAME):
        FieldReader(TYPES[POINT], ['point.x', FRAME]).table(messages)


@pytest.mark.parametrize(
    ('paths', 'words'),
    [
        (['point.w'], 'point.w'),
        (['point'], 'point'),
        ([''], "''"),
        (['point.x', 'point.x'], 'twice'),
        (['point.x[0]'], r'point.x\[0\]'),
    ],
)
def test_a_path_that_is_unknown_or_given_twice_is_an_error(paths, words):
    with pytest.raises(ValueError, match=words):
        FieldReader(TYPES[POINT], paths)


def test_fields_beside_lists_and_texts_are_read():
    message_type = of_type('nav_msgs/msg/Odometry')
    reader = FieldReader(message_type, [STAMP[0], 'child_frame_id', 'pose.pose.position.z'])
    message = message_type.blank()
    for frame, child in (('', ''), ('odom', 'base'), ('odometry', 'κ')):
        message.header.frame_id, message.child_frame_id = frame, child
        message.header.stamp.sec, message.pose.pose.position.z = 3, 0.25
        assert reader(message_type.encode(message)) == (3, child, 0.25)
    message_type = of_type(JOINT_STATE)
    reader, message = FieldReader(message_type, STAMP), message_type.blank()
    for names in ([], ['knee'], ['hip', 'a long name']):
        message.name, message.position = names, np.arange(float(len(names)))
        message.header.stamp.nanosec = len(names)
        data = message_type.encode(message)
        assert reader(data) == (0, len(names))
        for size in range(len(data)):
            with pytest.raises(BadMessage):
                FieldReader(message_type, STAMP)(data[:size])
        assert reader.table([data, data]).tolist() == [[0.0, len(names)]] * 2
    with pytest.raises(ValueError, match='position'):
        FieldReader(message_type, ['position[0]'])


def test_numbers_of_every_kind_are_at_multiples_of_their_size():
    kinds = {
        'bool': True, 'byte': 127, 'int16': -(2**15), 'char': 200, 'int8': -128,
        'int32': -(2**31), 'uint8': 200, 'int64': -(2**63), 'float32': 0.1, 'uint64': 2**64 - 1,
        'uint16': 2**16 - 1, 'uint32': 2**32 - 1, 'float64': 0.1,
    }  # fmt: skip
    definition = ''.join(f'{kind} of_{kind}\n' for kind in kinds) + 'string text\nint8[3] last'
    message_type = MessageType('test_msgs/msg/Kinds', definition)
    content = {f'of_{kind}': value for kind, value in kinds.items()}
    content |= {'text': 'κ'} | {f'last[{place}]': -place for place in range(3)}
    message = put(message_type.blank(), content)
    expected = content | {'of_float32': struct.unpack('f', struct.pack('f', 0.1))[0]}
    for order in (LITTLE, BIG):
        data = bytes(
            message_type._store.serialize_cdr(message, message_type.name, little_endian=order)
        )
        read = FieldReader(message_type, list(content))
        assert bits(read(data)) == bits(expected.values())
        numbers = [path for path in content if path != 'text']
        (row,) = FieldReader(message_type, numbers).table([data]).tolist()
        assert row == [float(expected[path]) for path in numbers]
    write = FieldWriter(message_type, numbers, {'text': 'κ'})
    assert write(*(content[path] for path in numbers)) == message_type.encode(message)
