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
from hypothesis import given, settings
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


@given(data=st.data())
@quick
def test_fields_are_read_in_the_order_of_the_paths(data):
    name = data.draw(st.sampled_from(FIXED))
    paths = data.draw(st.lists(st.sampled_from(LEAVES[name]), unique=True))
    content = some(name)
    reader = FieldReader(TYPES[name], paths)
    for order in (LITTLE, BIG):
        assert bits(reader(encoded(name, content, order))) == chosen(content, paths)


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


def plain(value):
    """Return a number of Python in place of one of NumPy."""
    return value.item() if isinstance(value, np.generic) else value


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
