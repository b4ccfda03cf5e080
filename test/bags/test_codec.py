# SPDX-License-Identifier: Apache-2.0
import math
import struct

import numpy as np
import pytest

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


@pytest.mark.parametrize(
    'definition',
    ['no/Such thing', 'string data\nint32[<=', 'string[99999999] names', 'float64 a\nfloat64 a'],
)
def test_a_definition_that_makes_no_sense_is_an_error(definition):
    with pytest.raises(Exception, match=r'.'):  # of any type
        codec.MessageType('test_msgs/msg/Wrong', definition)


def test_fields_are_put_and_read_by_their_paths():
    message_type = codec.message_type('geometry_msgs/msg/TwistWithCovarianceStamped')
    values = {
        'header.frame_id': 'odom', 'twist.covariance': range(36), 'twist.covariance[7]': 0.5,
        'twist.twist.linear.y': -2.0,
    }  # fmt: skip
    message = message_type.blank()
    for path, value in values.items():
        codec.put_field(message, path, value)
    read = message_type.decode(message_type.encode(message))
    paths = ('twist.covariance[7]', 'header.frame_id', 'twist.twist.linear.y')
    assert codec.field_getter(paths)(read) == (0.5, 'odom', -2.0)
    assert read.twist.covariance[35] == 35.0
