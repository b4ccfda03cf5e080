# SPDX-License-Identifier: Apache-2.0
"""Records as messages: what is written is read, and what is no record is refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from ros_pad.bags.wire import TYPE, Wire, legs_of
from ros_pad.errors import BadMessage
from ros_pad.records import COMMAND, KINDS, SAMPLE, Block

STORE = get_typestore(Stores.ROS2_JAZZY)
LEGS = (1, 4)
LIMIT = 2**31 * 10**9
NUMBERS = st.floats(allow_nan=True, width=64)


def block_of(kind, legs=2, records=1, first_ns=1_700_000_000_123_456_789, seed=0):
    rng = np.random.default_rng(seed)
    rows = kind.rows(records, legs)
    rows.view('f8')[...] = rng.normal(size=rows.view('f8').shape)
    rows[0, 0] = kind.rows(1)[0]  # a leg without values
    return Block(first_ns + 4_000_000 * np.arange(records), rows)


def same(one, other):
    return one.stamps.tolist() == other.stamps.tolist() and (
        one.rows.tobytes() == other.rows.tobytes() and one.rows.shape == other.rows.shape
    )


def message_of(data, order='<'):
    """Return a message as another library has it."""
    return STORE.deserialize_cdr(data, TYPE)


@pytest.mark.parametrize('kind', KINDS, ids=lambda kind: kind.name)
@pytest.mark.parametrize('records', [1, 5])
def test_what_is_written_is_read(kind, records):
    wire, block = Wire(kind, LEGS), block_of(kind, records=records)
    data = wire.encode(block)
    assert same(wire.decode(data), block)
    assert legs_of(data) == LEGS
    message = message_of(data)
    assert message.name == ['time', *kind.names(LEGS)]
    stamp = message.header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec == block.stamps[0]
    values = message.position.reshape(records, -1)
    assert values[:, 0] == pytest.approx(4e-3 * np.arange(records), abs=1e-12)
    assert np.array_equal(values[:, 1:].ravel(), block.rows.view('f8').ravel(), equal_nan=True)
    assert not len(message.velocity) and not len(message.effort)


@settings(max_examples=300)
@given(
    st.integers(-LIMIT, LIMIT - 1), st.lists(st.integers(1, 10**9), max_size=4),
    st.integers(1, 8), st.randoms(),
)  # fmt: skip
def test_any_stamps_and_legs_are_read(first_ns, steps, count, random):
    legs = random.sample(range(1, 9), count)
    stamps = first_ns + np.cumsum([0, *steps])
    rows = COMMAND.rows(len(stamps), count)
    rows['setpoint'] = np.arange(count)
    wire = Wire(COMMAND, legs)
    assert same(wire.decode(wire.encode(Block(stamps, rows))), Block(stamps, rows))


def test_a_block_is_split_into_its_records():
    wire, block = Wire(SAMPLE, LEGS), block_of(SAMPLE, records=3)
    pieces = wire.split(wire.encode(block))
    assert [stamp for stamp, _ in pieces] == block.stamps.tolist()
    for place, (_, data) in enumerate(pieces):
        cut = slice(place, place + 1)
        assert same(wire.decode(data), Block(block.stamps[cut], block.rows[cut]))
    (alone,) = wire.split(pieces[1][1])
    assert alone == pieces[1]


def others(names, values, sec=7, nanosec=9, big=False):
    """Return a message of another library: JointState with these names and values."""
    types = STORE.types
    message = types[TYPE](
        header=types['std_msgs/msg/Header'](
            stamp=types['builtin_interfaces/msg/Time'](sec=sec, nanosec=nanosec), frame_id=''
        ),
        name=names,
        position=np.array(values, float),
        velocity=np.array([]),
        effort=np.array([]),
    )
    return bytes(STORE.serialize_cdr(message, TYPE, little_endian=not big))


@pytest.mark.parametrize('big', [False, True], ids=['little', 'big'])
def test_names_in_another_order_and_missing_ones_are_read(big):
    wire = Wire(COMMAND, LEGS)
    data = others(['leg_4/setpoint', 'leg_1/dome'], [3e4, 1.0], big=big)
    block = wire.decode(data)
    assert block.stamps.tolist() == [7 * 10**9 + 9]
    assert block.rows['setpoint'].tolist() == [[pytest.approx(np.nan, nan_ok=True), 3e4]]
    assert block.rows['dome'].tolist() == [[1.0, pytest.approx(np.nan, nan_ok=True)]]
    assert legs_of(data) == (4, 1)
    several = others(['leg_1/dome', 'time'], [1.0, 0.0, 0.0, 0.5], big=big)
    assert wire.decode(several).stamps.tolist() == [7 * 10**9 + 9, 7_500_000_009]


def test_a_message_that_rclpy_serialises_is_read():
    pytest.importorskip('rclpy')
    from rclpy.serialization import deserialize_message, serialize_message
    from sensor_msgs.msg import JointState

    wire, block = Wire(SAMPLE, LEGS), block_of(SAMPLE)
    message = deserialize_message(wire.encode(block), JointState)
    assert list(message.name)[:2] == ['time', 'leg_1/force_x']
    assert same(wire.decode(serialize_message(message)), block)
    assert same(wire.decode(serialize_message(message) + b'\0\0\0'), block)  # DDS may pad


HEAD = ('time', *COMMAND.names(LEGS))
REFUSED = {
    'joints': (['knee', 'hip'], [1.0, 2.0], 'unknown names hip, knee: names such as leg_1/dome'),
    'another leg': (['leg_2/dome'], [1.0], r'unknown names leg_2/dome: .* of the legs 1, 4 are'),
    'another kind': (['leg_1/load'], [1.0], 'unknown names leg_1/load'),
    'no names': ([], [], 'no names, or two'),
    'twice': (['leg_1/dome', 'leg_1/dome'], [1.0, 2.0], 'no names, or two'),
    'too few values': (['leg_1/dome', 'leg_4/dome'], [1.0], '1 values for 2 names'),
    'no values': (['leg_1/dome'], [], 'do not advance from 0'),
    'two without time': (['leg_1/dome'], [1.0, 2.0], 'do not advance from 0'),
    'later first': (['leg_1/dome', 'time'], [1.0, 0.5], 'do not advance from 0'),
    'backwards': (['leg_1/dome', 'time'], [1.0, 0.0, 1.0, 0.0], 'do not advance from 0'),
    'no time': (['leg_1/dome', 'time'], [1.0, np.nan], 'do not advance from 0'),
    'for ever': (['leg_1/dome', 'time'], [1.0, 0.0, 1.0, np.inf], 'are too many'),
    'too long': (['leg_1/dome', 'time'], [1.0, 0.0, 1.0, 1e5], 'up to 100000 s are too many'),
    'our names, backwards': (HEAD, [0.0, 1, 2, 3, 4, -1.0, 1, 2, 3, 4], 'do not advance from 0'),
    'our names, too few': (HEAD, [0.0, 1, 2, 3], 'no records of 5 numbers'),
    'our names, none': (HEAD, [], 'do not advance from 0'),
}


@pytest.mark.parametrize('case', REFUSED)
def test_what_is_no_record_is_refused_with_the_reason(case):
    names, values, reason = REFUSED[case]
    with pytest.raises(BadMessage, match=reason):
        Wire(COMMAND, LEGS).decode(others(list(names), values))


@settings(max_examples=500)
@given(st.data())
def test_any_bytes_are_a_record_or_refused(data):
    """Cut, changed and random ones: nothing but BadMessage is raised."""
    wire = Wire(COMMAND, LEGS)
    whole = bytearray(
        data.draw(
            st.sampled_from(
                [
                    wire.encode(block_of(COMMAND, records=2)),
                    others(['leg_1/dome', 'time'], [1.0, 0.0], big=True),
                ]
            )
        )
    )
    for _ in range(data.draw(st.integers(0, 3))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    cut = bytes(whole[: data.draw(st.integers(0, len(whole)))])
    given_bytes = data.draw(st.sampled_from([cut, data.draw(st.binary(max_size=80))]))
    for function in (wire.decode, wire.split, legs_of):
        try:
            function(given_bytes)
        except BadMessage:
            pass
        else:
            assert function is legs_of or len(wire.decode(given_bytes).rows) > 0
