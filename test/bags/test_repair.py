# SPDX-License-Identifier: Apache-2.0
import json
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import textwrap
import time
import warnings

import pytest

pytest.importorskip('rclpy', reason='rclpy is needed: it serializes the messages')

import rosbags.highlevel
from mcap.data_stream import ReadDataStream
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.writer import Writer
from rclpy.serialization import serialize_message
from shared import wait_for
from std_msgs.msg import Float64, String

from ros_pad.bags import BagReader, BagWriter, recovery
from ros_pad.cli import main
from ros_pad.errors import BagError
from ros_pad.trials.bag_notes import RECORDED_AT


def data_in(folder, topic):
    return [message.data for _, message, _ in BagReader(folder).messages({topic})]


@pytest.fixture
def trial(tmp_path):
    """Return a closed bag of several chunks: numbers on /number, noise on /noise."""
    chance = random.Random(1)
    folder = tmp_path / 'trial'
    with BagWriter(folder, {'seed': '3'}) as writer:
        writer.add_topic('/number', 'std_msgs/msg/Float64')
        writer.add_topic('/noise', 'std_msgs/msg/Float64')
        for number in range(5000):
            writer.write('/number', serialize_message(Float64(data=float(number))), number, number)
            writer.write('/noise', serialize_message(Float64(data=chance.random())), number)
    return folder


def chunks(path):
    with path.open('rb') as stream:
        return sorted(
            make_reader(stream).get_summary().chunk_indexes,
            key=lambda each: each.chunk_start_offset,
        )


def test_a_recorder_that_is_killed_loses_at_most_a_second(tmp_path):
    """Its clock goes on by a millisecond with each message, whatever the machine does."""
    folder = tmp_path / 'trial'
    program = f"""
        import itertools, types
        from rclpy.serialization import serialize_message
        from std_msgs.msg import Float64
        from ros_pad.bags import BagWriter, writer
        now = 0
        writer.time = types.SimpleNamespace(monotonic=lambda: now * 1e-3)
        bag = BagWriter({str(folder)!r}, {{'seed': '3'}})
        bag.add_topic('/count', 'std_msgs/msg/Float64')
        for now in itertools.count(1):
            bag.write('/count', serialize_message(Float64(data=float(now))), now)
            print(now, flush=True)
    """
    process = subprocess.Popen(
        [sys.executable, '-c', textwrap.dedent(program)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout
    while int(process.stdout.readline()) < 2_600:
        pass
    process.send_signal(signal.SIGKILL)
    last = [2_600, *map(int, process.stdout.read().split('\n')[:-1])][-1]
    process.wait()
    with pytest.warns(UserWarning, match=r'trial_0.mcap was not closed.*; [0-9]+ messages can'):
        torn = BagReader(folder)
    found = recovery.repair(folder, tmp_path / 'whole')
    assert torn.problem and torn.message_count == found.messages
    assert not found.closed
    reader = BagReader(tmp_path / 'whole')
    assert reader.problem is None
    assert reader.custom_data['seed'] == '3'
    assert json.loads(reader.custom_data[recovery.KEY])['messages'] == found.messages
    values = data_in(tmp_path / 'whole', '/count')
    assert values == [float(number) for number in range(1, found.messages + 1)]
    assert last - values[-1] <= 1_000
    # rosbags, an independent reader, opens the repaired bag.
    with rosbags.highlevel.AnyReader([tmp_path / 'whole']) as other:
        assert other.message_count == found.messages


def test_what_is_flushed_is_sent_on_to_the_disk(tmp_path, monkeypatch):
    on_disk = []

    def fsync(number):
        path = pathlib.Path(os.readlink(f'/proc/self/fd/{number}'))
        if path.suffix == '.mcap':  # keep what a power cut would leave now
            shutil.copytree(path.parent, tmp_path / f'cut_{len(on_disk)}')
            on_disk.append(path)

    monkeypatch.setattr(os, 'fsync', fsync)
    with BagWriter(tmp_path / 'trial') as writer:
        writer.add_topic('/number', 'std_msgs/msg/Float64')
        for number in range(10):
            writer.write('/number', serialize_message(Float64(data=float(number))), number)
            if number in (3, 7):
                writer.flush()
            if number in (0, 3, 7):  # the first message is flushed at once
                wait_for(lambda n=number: len(on_disk) >= 1 + (n + 1) // 4)
    assert len(on_disk) == 4  # the first message, two flushes, the end
    for cut, count in enumerate((1, 4, 8)):
        recovery.repair(tmp_path / f'cut_{cut}', tmp_path / f'whole_{cut}')
        assert data_in(tmp_path / f'whole_{cut}', '/number') == [float(n) for n in range(count)]


def test_a_full_disk_is_reported_at_the_next_flush(tmp_path, monkeypatch):
    def fsync(number):
        raise OSError(28, 'No space left on device')

    writer = BagWriter(tmp_path / 'trial')
    writer.add_topic('/number', 'std_msgs/msg/Float64')
    monkeypatch.setattr(os, 'fsync', fsync)
    with pytest.raises(BagError, match=r'No space left on device; \d+ messages are saved'):
        for number in range(1000):
            writer.write('/number', serialize_message(Float64()), number)
            writer.flush()
            time.sleep(0.001)


@pytest.mark.parametrize('share', [0.3, 0.6, 0.99])
def test_a_bag_cut_short_gives_what_is_before_the_cut(trial, tmp_path, share):
    file = trial / 'trial_0.mcap'
    whole = data_in(trial, '/number')
    end = chunks(file)[-1].chunk_start_offset
    os.truncate(file, int(end * share))
    before = {path.name: path.read_bytes() for path in trial.iterdir()}
    found = recovery.repair(trial, tmp_path / 'whole')
    numbers = data_in(tmp_path / 'whole', '/number')
    assert numbers == whole[: len(numbers)]
    # A chunk holds at most 64 KiB of messages, and a message takes at least 43 bytes.
    assert len(numbers) > share * 5000 * 0.7 - 64 * 1024 / 2 / 43
    assert not found.closed
    assert found.unread_bytes > 0
    # The broken bag is not changed.
    assert {path.name: path.read_bytes() for path in trial.iterdir()} == before


def test_a_damaged_chunk_is_left_out(trial, tmp_path):
    file = trial / 'trial_0.mcap'
    index = chunks(file)[1]
    with file.open('rb') as stream:
        stream.seek(index.chunk_start_offset + 9)
        chunk = Chunk.read(ReadDataStream(stream))
    data = bytearray(file.read_bytes())
    middle = index.chunk_start_offset + index.chunk_length // 2
    data[middle] ^= 0xFF
    file.write_bytes(data)
    with pytest.raises(BagError, match='damaged'):
        list(BagReader(trial).messages())
    found = recovery.repair(trial, tmp_path / 'whole')
    assert (found.damaged_chunks, found.closed, found.unread_bytes) == (1, True, 0)
    numbers = data_in(tmp_path / 'whole', '/number')
    missing = sorted(set(range(5000)) - set(map(int, numbers)))
    assert missing
    assert missing == list(range(missing[0], missing[-1] + 1))
    assert missing[0] >= chunk.message_start_time
    assert missing[-1] <= chunk.message_end_time


def test_a_first_chunk_with_the_topics_may_be_damaged(trial, tmp_path):
    file = trial / 'trial_0.mcap'
    index = chunks(file)[0]
    data = bytearray(file.read_bytes())
    data[index.chunk_start_offset + index.chunk_length // 2] ^= 0xFF
    file.write_bytes(data)
    found = recovery.repair(trial, tmp_path / 'whole')
    # A closed file has a copy of its topics at the end.
    assert found.messages > 5000
    assert found.lost_messages == 0
    # A file that was cut has no such copy.
    os.truncate(file, chunks(file)[-1].chunk_start_offset)
    with pytest.raises(BagError, match='none of its messages can be read'):
        recovery.repair(trial, tmp_path / 'other')
    assert not (tmp_path / 'other').exists()
    assert recovery.inspect(trial).lost_messages > 1000


def test_bags_of_ros2_bag_record_that_were_killed(tmp_path):
    # rosbag2 writes metadata.yaml when it ends, so a killed rosbag2 leaves none; it may also
    # have split the bag into several files.
    folder = tmp_path / 'killed'
    folder.mkdir()
    for part in range(12):
        with (folder / f'killed_{part}.mcap').open('wb') as stream:
            writer = Writer(stream, chunk_size=200)
            writer.start('ros2')
            schema = writer.register_schema('lab_msgs/msg/Foot', 'ros2msg', b'float64 data')
            for topic in ('/foot', '/other')[:: 1 if part % 2 else -1]:
                channel = writer.register_channel(topic, 'cdr', schema, {})
                time_ns = part * 10
                for number in range(3):
                    cdr = serialize_message(Float64(data=float(part * 3 + number)))
                    writer.add_message(channel, time_ns + number, cdr, time_ns + number)
            if part < 11:
                writer.finish()
            else:
                writer.flush()
    found = recovery.repair(folder, tmp_path / 'whole')
    assert (found.messages, found.closed) == (72, False)
    reader = BagReader(tmp_path / 'whole')
    assert reader.topics == dict.fromkeys(('/foot', '/other'), 'lab_msgs/msg/Foot')
    assert data_in(tmp_path / 'whole', '/foot') == [float(number) for number in range(36)]


def test_a_topic_with_two_types_is_no_bag(tmp_path):
    folder = tmp_path / 'mixed'
    folder.mkdir()
    for part, kind in enumerate((Float64, String)):
        with (folder / f'mixed_{part}.mcap').open('wb') as stream:
            writer = Writer(stream)
            writer.start('ros2')
            name = f'std_msgs/msg/{kind.__name__}'
            schema = writer.register_schema(name, 'ros2msg', b'')
            channel = writer.register_channel('/data', 'cdr', schema)
            writer.add_message(channel, 0, serialize_message(kind()), 0)
            writer.finish()
    with pytest.raises(BagError, match=r'/data has the message types .*Float64 and .*String'):
        recovery.repair(folder, tmp_path / 'whole')


@pytest.mark.parametrize(
    ('make', 'words'),
    [
        (lambda path: None, 'no such bag'),
        (lambda path: path.mkdir(), 'has no MCAP file'),
        (lambda path: path.write_bytes(b'\0' * 1000), 'none of its messages can be read'),
        (lambda path: path.write_bytes(b''), 'none of its messages can be read'),
    ],
)
def test_what_cannot_be_repaired_is_refused(tmp_path, make, words):
    make(tmp_path / 'it')
    with pytest.raises(BagError, match=words):
        recovery.repair(tmp_path / 'it', tmp_path / 'whole')
    assert not (tmp_path / 'whole').exists()


def test_any_cut_is_read_without_a_fall(trial, tmp_path):
    data = (trial / 'trial_0.mcap').read_bytes()
    chance = random.Random(2)
    for _ in range(60):
        cut = data[: chance.randrange(len(data))]
        at = chance.randrange(len(cut) or 1)
        file = tmp_path / 'cut.mcap'
        file.write_bytes(cut[:at] + bytes(chance.choices(range(256), k=3)) + cut[at + 3 :])
        found = recovery.inspect(file)
        assert 0 <= found.messages <= 10_000


def test_an_error_of_the_callback_is_no_damage(trial, tmp_path):
    def progress(share):
        if 0.1 < share < 0.5:  # while the bag is read, before anything is written
            raise BrokenPipeError

    with pytest.raises(BrokenPipeError):
        recovery.repair(trial, tmp_path / 'repaired', progress)
    assert not (tmp_path / 'repaired').exists()


def test_metadata_that_is_wrong_is_repaired_too(trial, tmp_path, capsys):
    metadata = trial / 'metadata.yaml'
    text = metadata.read_text(encoding='utf-8')
    assert recovery.inspect(trial).sound
    for place, wrong in enumerate(
        (
            text[:200],  # cut short
            text.replace(
                'message_count: 10000', 'message_count: 0'
            ),  # as it is while the bag is being written
            text.replace('trial_0.mcap', 'trial_1.mcap'),
        )
    ):
        assert wrong != text
        metadata.write_text(wrong, encoding='utf-8')
        assert not recovery.inspect(trial).sound
        out = str(tmp_path / f'whole_{place}')
        assert main(['bag', 'repair', str(trial), '--out', out]) == 0
        assert 'metadata.yaml' in capsys.readouterr().out
        assert BagReader(out).message_count == 10_000
        assert recovery.inspect(out).sound


@pytest.mark.parametrize('key', ['ros_pad', 'ros_pad_lost', 'ros_pad_made_with'])
def test_other_peoples_custom_data_are_no_crash(tmp_path, capsys, key):
    for place, said in enumerate(('no JSON', '7', '[1]')):
        folder = tmp_path / f'trial_{place}'
        BagWriter(folder, {key: said}).close()
        assert main(['bag', 'info', str(folder)]) == 2
        assert f"custom data '{key}' is not as" in capsys.readouterr().err
    BagWriter(tmp_path / 'trial', {'ros_pad': '{"scene": "lab"}'}).close()
    assert main(['bag', 'info', str(tmp_path / 'trial')]) == 0
    assert 'scene lab' in capsys.readouterr().out


def test_the_command(trial, tmp_path, capsys):
    assert main(['bag', 'repair', str(trial)]) == 0
    assert '10000 messages' in capsys.readouterr().out
    os.truncate(trial / 'trial_0.mcap', 60_000)
    with warnings.catch_warnings():
        warnings.simplefilter('error')  # the problem is printed once, not also as a warning
        assert main(['bag', 'info', str(trial)]) == 1
    captured = capsys.readouterr()
    assert 'was not closed' in captured.err
    assert 'pad bag repair' in captured.err
    assert main(['bag', 'repair', str(trial)]) == 0
    out = capsys.readouterr().out
    assert f'{trial}_repaired: ' in out
    assert 'bytes at the end' in out
    assert main(['bag', 'info', f'{trial}_repaired']) == 0
    out = capsys.readouterr().out
    assert 'repaired from trial\n' in out
    assert 'bytes at the end' in out
    assert main(['bag', 'repair', str(trial)]) == 2
    assert 'bags are never overwritten' in capsys.readouterr().err
    assert main(['bag', 'repair', str(trial), '--out', str(tmp_path / 'b'), '--json']) == 0
    said = json.loads(capsys.readouterr().out)
    assert said['repaired'] == str(tmp_path / 'b')
    assert said['messages'] == BagReader(tmp_path / 'b').message_count
    assert main(['bag', 'info', str(trial), '--out', 'x']) == 2


def test_the_command_lists_rates_and_gaps(tmp_path, capsys):
    folder = tmp_path / 'walk'
    with BagWriter(folder, {RECORDED_AT: 'publisher'}) as writer:
        for topic in ('/fast', '/once', '/never'):
            writer.add_topic(topic, 'std_msgs/msg/Float64')
        for number in (*range(50), *range(60, 101)):  # 250 Hz with a gap of 11 periods
            writer.write('/fast', bytes(12), 10**18 + number * 4_000_000)
        writer.write('/once', bytes(12), 10**18)
    assert main(['bag', 'info', str(folder)]) == 0
    out = capsys.readouterr().out
    assert 'recorded at the publisher\n' in out
    rows = {line.split()[0]: line.split()[1:] for line in out.splitlines()}
    assert rows['/fast'] == ['std_msgs/msg/Float64', '91', '225', 'Hz', '0.044', 's']
    assert rows['/once'] == ['std_msgs/msg/Float64', '1', '-', '-']
    assert main(['bag', 'info', str(folder), '--json']) == 0
    said = json.loads(capsys.readouterr().out)
    assert said['recorded_at'] == 'publisher'
    assert said['topics']['/fast']['rate_hz'] == pytest.approx(225.0)
    assert said['topics']['/fast']['longest_gap_s'] == pytest.approx(0.044)
    assert said['topics']['/never']['rate_hz'] is None
