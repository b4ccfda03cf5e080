# SPDX-License-Identifier: Apache-2.0
"""The reference is mcap's own writer: the same bytes."""

import io

from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import CompressionType
from mcap.writer import Writer

from ros_pad.bags.messages_writer import MessagesWriter

times = st.integers(0, 2**64 - 1)
messages = st.lists(
    st.one_of(
        st.tuples(st.integers(0, 2), times, st.binary(max_size=300), times, st.integers(0, 9)),
        st.just('flush'),
    ),
    max_size=40,
)


def file_of(kind, compression, content):
    """Return the bytes of a file with this content, in chunks of 500 bytes."""
    stream = io.BytesIO()
    writer = kind(stream, chunk_size=500, compression=compression)
    writer.start(profile='ros2', library='test')
    schema = writer.register_schema('a', 'ros2msg', b'float64 data')
    channels = [writer.register_channel(name, 'cdr', schema) for name in 'abc']
    for each in content:
        if each == 'flush':
            writer.flush()
        else:
            place, log_time, data, publish_time, sequence = each
            writer.add_message(channels[place], log_time, data, publish_time, sequence)
    writer.finish()
    return stream.getvalue()


@given(st.sampled_from([CompressionType.NONE, CompressionType.ZSTD]), messages)
def test_the_file_is_that_of_mcap(compression, content):
    assert file_of(MessagesWriter, compression, content) == file_of(Writer, compression, content)
