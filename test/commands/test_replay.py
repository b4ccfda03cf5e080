# SPDX-License-Identifier: Apache-2.0
"""``pad replay`` as a user types it."""

import importlib.util
import json
import shutil

import pytest
from mcap.reader import make_reader

from ros_pad import cli, configuration
from ros_pad.bags import BagReader

SAMPLE = configuration.shared_folder().parent / 'bags' / 'hexapod_patches' / 'bag'


@pytest.mark.slow
def test_the_sample_is_replayed_and_reported_in_one_command_each(tmp_path, capsys):
    assert cli.main(['replay', str(SAMPLE)]) == 0
    said = capsys.readouterr().out
    # The six legs have the same result and share a line.
    assert said.count('leg_*/') == 14 and 'leg_1/' not in said
    assert 'equal to the bit' in said or 'equal except for rounding' in said
    page = tmp_path / 'report.html'
    assert cli.main(['report', str(SAMPLE), '--out', str(page)]) == 0
    assert page.stat().st_size > 10_000


# Writing a bag needs the installed message types.
writes_a_bag = pytest.mark.skipif(
    importlib.util.find_spec('std_msgs') is None, reason='the messages of ROS 2 are not installed'
)


@writes_a_bag
def test_other_parameters_picture_and_bag(tmp_path, capsys):
    figure, out = tmp_path / 'prior.png', tmp_path / 'bag'
    arguments = ['replay', str(SAMPLE), '--set', 'wet_prior=0.2', '--json']
    arguments += ['--figure', str(figure), '--out', str(out)]
    assert cli.main(arguments) == 1
    said = json.loads(capsys.readouterr().out)
    assert said['verdict'] == 'different'
    assert said['settings']['wet_prior'] == 0.2
    assert said['settings']['foot'] == 'large37' and said['settings']['policy'] == 'adaptive'
    assert (said['figure'], said['out']) == (str(figure), str(out))
    found = {(each['leg'], each['quantity']): each for each in said['comparisons']}
    assert len(found) == len(said['comparisons']) == 6 * 14
    wetness = found[1, 'wetness']
    assert wetness['topic'] == '/feet/estimate' and wetness['unit'] == ''
    assert wetness['verdict'] == 'different' and wetness['compared'] == 301
    assert 0.1 < wetness['largest_difference'] < 1.0
    assert wetness['first_difference_s'] < 0.1
    assert found[1, 'slip']['verdict'] in ('equal', 'rounding')
    assert [each['leg'] for each in said['outcomes']] == [1, 2, 3, 4, 5, 6]
    assert all(each['stance_ends'] == 5 for each in said['outcomes'])
    assert figure.read_bytes().startswith(b'\x89PNG') and figure.stat().st_size > 20_000
    # The command refuses to overwrite a file before it does anything else.
    before = figure.stat().st_mtime_ns
    assert cli.main(arguments) == 2
    assert 'exists already' in capsys.readouterr().err
    assert figure.stat().st_mtime_ns == before


@writes_a_bag
def test_the_replayed_bag_is_a_bag_for_others(tmp_path):
    """rosbags reads the same messages as in the sample, exactly or except for rounding."""
    highlevel = pytest.importorskip('rosbags.highlevel', reason='pip install ros_pad[test]')
    out = tmp_path / 'bag'
    assert cli.main(['replay', str(SAMPLE), '--out', str(out), '--namespace', '/']) == 0
    topics = ['/feet/estimate', '/feet/command']

    def messages(bag):
        found = {topic: [] for topic in topics}
        with highlevel.AnyReader([bag]) as reader:
            for connection, time, data in reader.messages():
                if connection.topic in topics:
                    message = reader.deserialize(data, connection.msgtype)
                    found[connection.topic].append((time, message))
        return found

    recorded, replayed = messages(SAMPLE), messages(out)
    for topic in topics:
        assert len(recorded[topic]) == len(replayed[topic]) == 301
        for (time, one), (other_time, other) in zip(recorded[topic], replayed[topic], strict=True):
            assert (time, one.name) == (other_time, other.name)
            assert str(one.header) == str(other.header)
            assert one.position == pytest.approx(other.position, rel=0.0, abs=1e-9, nan_ok=True)
    about = json.loads(BagReader(out).custom_data['ros_pad'])
    assert about['settings']['replay_of'] == str(SAMPLE)


def test_a_bag_that_cannot_be_read_is_bad_input(tmp_path, capsys):
    lone = tmp_path / 'lone.mcap'
    shutil.copy(SAMPLE / 'bag_0.mcap', lone)
    with lone.open('r+b') as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[5]
        stream.seek(chunk.chunk_start_offset + chunk.chunk_length - 100)
        stream.write(bytes(50))
    assert cli.main(['replay', str(lone)]) == 2
    assert 'damaged' in capsys.readouterr().err
