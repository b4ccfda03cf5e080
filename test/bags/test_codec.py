# SPDX-License-Identifier: Apache-2.0
import math
import struct

import numpy as np
import pytest
from rosbags.typesys import Stores
from rosbags.typesys import get_typestore

from ros_pad.bags import codec

DEFINITION = """\
# of everything
std_msgs/Header header
bool flag
uint8[2] pair
float64[3] vector
float32[] list
string name "none"
string[2] names
Inner[] inner
int16 LIMIT = -5
uint64 big
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: test_msgs/Inner
int8 small
float64 value
"""
FLOAT = ('std_msgs/msg/Float64', 'float64 data')
WRENCH = 'geometry_msgs/msg/WrenchStamped'
POINT = 'geometry_msgs/msg/PointStamped'


@pytest.mark.parametrize('end_of_line', ['\n', '\r\n'])
def test_a_message_comes_back_from_its_bytes(end_of_line):
    definition = DEFINITION.replace('\n', end_of_line)
    message_type = codec.MessageType('test_msgs/msg/All', definition)
    message = message_type.blank()
    message.header.stamp.sec = -3
    message.header.frame_id = 'κ'
    message.flag = True
    message.pair[1] = 255
    message.vector[:] = [1.0, -0.0, math.inf]
    message.list = np.array([0.5, 2.0], dtype=np.float32)
    message.names[1] = 'second'
    message.big = 2**64 - 1
    read = message_type.decode(message_type.encode(message))
    assert (read.header.stamp.sec, read.header.frame_id) == (-3, 'κ')
    assert (read.flag, read.name, read.names, read.inner) == (True, '', ['', 'second'], [])
    assert (list(read.pair), list(read.list)) == ([0, 255], [0.5, 2.0])
    assert str(list(map(float, read.vector))) == '[1.0, -0.0, inf]'
    assert read.big == 2**64 - 1


def test_both_byte_orders_are_read():
    number = codec.message_type(*FLOAT)
    assert number.decode(b'\0\1\0\0' + struct.pack('<d', 0.1)).data == 0.1
    assert number.decode(b'\0\0\0\0' + struct.pack('>d', 0.1)).data == 0.1


@pytest.mark.parametrize('data', [b'', b'\0\1\0\0', bytes(11), b'\0\3\0\0' + bytes(8)])
def test_bytes_that_are_no_message_are_an_error(data):
    with pytest.raises((ValueError, IndexError, struct.error)):
        codec.message_type(*FLOAT).decode(data)


@pytest.mark.parametrize(
    'definition',
    ['no/Such thing', 'string data\nint32[<=', 'string[99999999] names', 'float64 a\nfloat64 a'],
)
def test_a_definition_that_makes_no_sense_is_an_error(definition):
    with pytest.raises(Exception, match=r'.'):  # of any type
        codec.MessageType('test_msgs/msg/Wrong', definition)


@pytest.mark.parametrize('little_endian', [True, False])
@pytest.mark.parametrize('frame', ['', 'a', 'leg_1_sole', 'κ', 'x' * 100])
def test_the_vector_behind_a_header_is_read_from_the_bytes(frame, little_endian):
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    header = types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](1, 2), frame)
    vector = types['geometry_msgs/msg/Vector3']
    wrench = types['geometry_msgs/msg/Wrench'](vector(0.1, 0.2, 0.3), vector(0.4, 0.5, 0.6))
    point = types['geometry_msgs/msg/Point'](0.1, 0.2, 0.3)

    def serialized(name, content):
        message = types[name](header, content)
        return bytes(store.serialize_cdr(message, name, little_endian=little_endian))

    assert codec.normal_force(serialized(WRENCH, wrench)) == 0.3
    assert codec.horizontal_position(serialized(POINT, point)) == (0.1, 0.2)
    assert math.isnan(codec.normal_force(serialized(POINT, point)[:-1]))


@pytest.mark.parametrize('data', [b'', b'\0', b'\0\1\0\0', bytes(16), b'\0\1\0\0' + b'\xff' * 40])
def test_bytes_that_are_no_message_have_no_force_and_no_position(data):
    assert math.isnan(codec.normal_force(data))
    assert all(map(math.isnan, codec.horizontal_position(data)))


@pytest.mark.parametrize(
    ('data', 'time_ns'),
    [
        (b'\0\1\0\0' + b'\1\0\0\0' + b'\2\0\0\0', 1_000_000_002),
        (b'\0\0\0\0' + b'\0\0\0\1' + b'\0\0\0\2', 1_000_000_002),  # big-endian
        (b'\0\1\0\0' + b'\xff\xff\xff\xff' + b'\0\0\0\0', -1_000_000_000),
        (b'\0\1\0\0' + b'\1\0\0\0', None),
        (b'', None),
    ],
)
def test_the_time_of_a_clock_is_read_from_the_bytes(data, time_ns):
    assert codec.clock_time(data) == time_ns
