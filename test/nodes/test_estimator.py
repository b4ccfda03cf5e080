# SPDX-License-Identifier: Apache-2.0
"""The estimator node: sample records in, estimate records out."""

import math

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticStatus
from helpers import LOAD, MS, SECOND, overrides, sample

from ros_pad.bags import topics
from ros_pad.errors import ConfigError
from ros_pad.estimation.doubt import text
from ros_pad.estimation.scales import GRID, Felt
from ros_pad.nodes.estimator import EstimatorNode
from ros_pad.records import SAMPLE, Block

ERROR, OK, WARN = DiagnosticStatus.ERROR, DiagnosticStatus.OK, DiagnosticStatus.WARN
HIDDEN = (math.nan, math.nan, math.nan)


class Robot:
    """An estimator node on a bench, and samples for it, one every 4 ms."""

    def __init__(self, bench):
        self.bench = bench
        self.now_ns = 0

    def start(self, **parameters):
        self.node = self.bench.start(EstimatorNode, **({'publish_rate': 1000.0} | parameters))
        return self.node

    def sample(self, **fields):
        """Send a sample, 4 ms after the last one."""
        self.now_ns += 4 * MS
        self.bench.give(topics.SAMPLE, sample(self.now_ns, **fields))

    def stance(self, ratio, speed, seconds=1.0, **more):
        """Let both feet stand under LOAD with T/N = ``ratio``, sliding at ``speed``, m/s."""
        for number in range(1, round(seconds / 0.004) + 1):
            jitter = 1e-9 * math.sin(number)  # exactly equal readings would be faulty
            force = (-ratio * LOAD + jitter, 0.0, LOAD + jitter)
            self.sample(force=force, position=(speed * 0.004 * number + jitter, 0, 0), **more)

    def heard(self, field, leg=1):
        """Return a field of a leg in all estimates."""
        return np.array([each.rows[-1][field][leg - 1] for each in self.estimates])

    @property
    def estimates(self):
        return self.bench.heard(topics.ESTIMATE)

    def doubts(self, leg=1):
        """Return the kinds of doubt of a leg, each where it begins."""
        codes = zip(self.heard('doubt', leg), self.heard('detail', leg), strict=True)
        kinds = [text(code, *detail).partition(':')[0] for code, detail in codes]
        return [kind for place, kind in enumerate(kinds) if kinds[place - 1 : place] != [kind]]

    def health(self, leg=1):
        """Return level and text of the last status of the sensors of a leg."""
        _, status = self.bench.statuses(f'leg {leg} sensing')[-1]
        return status.level, status.message


@pytest.fixture
def robot(bench):
    return Robot(bench)


def test_an_estimate_has_the_largest_load_and_the_last_position_since_the_last_one(robot):
    robot.start(publish_rate=50.0)
    loads = (1.0, 9.0, 4.0, 2.0, 3.0, 5.0, 8.0, 7.0, 6.0, 0.5, 0.0)
    robot.now_ns = 16 * MS
    for number, load in enumerate(loads):
        robot.sample(force=(0.0, 0.0, load), position=(0.1 * number, -0.2 * number, 9.0))
    # The estimates are at 0.02, 0.04 and 0.06 s, with samples 0, 1 to 5, and 6 to 10.
    assert robot.heard('load').tolist() == [1.0, 9.0, 8.0]
    assert robot.heard('position').tolist() == [[0.0, 0.0], [0.5, -1.0], [1.0, -2.0]]
    assert [each.last_ns for each in robot.estimates] == [20 * MS, 40 * MS, 60 * MS]


def test_a_block_of_samples_gives_what_its_records_give(robot, bench):
    """As the simulator publishes one every 20 ms."""
    rng = np.random.default_rng(5)
    rows = SAMPLE.rows(100, 2)
    rows['force'] = rng.normal((0.5, 0.0, LOAD), 0.03, (100, 2, 3))
    rows['position'] = rng.normal(0.0, 1e-4, (100, 2, 3))
    stamps = 4 * MS * np.arange(1, 101)
    found = []
    for size in (1, 5):
        robot.start(publish_rate=50.0)
        for place in range(0, 100, size):
            cut = slice(place, place + size)
            bench.give(topics.SAMPLE, Block(stamps[cut], rows[cut]))
        found.append(list(bench.sent['/feet/estimate']))
        bench.stop()
        bench.sent.clear()
    assert len(found[0]) == 21
    assert found[0] == found[1]


BAD = {
    'missing': (math.nan, math.nan, math.nan),
    'tangential': (math.nan, 0.0, LOAD),
    'load': (0.0, 0.0, math.nan),
    'infinite': (0.0, 0.0, math.inf),
    'huge': (0.0, 0.0, 1e300),
}


@pytest.mark.parametrize('case', BAD)
def test_a_row_that_is_no_sample_concerns_its_leg_only(robot, case):
    node = robot.start()
    robot.sample()
    for _ in range(5):
        robot.sample(force=[BAD[case], (0.0, 0.0, LOAD)])
    assert node.stage.used == [1, 6]
    robot.sample()
    assert node.stage.used == [2, 7]
    for leg in (1, 2):
        for field in ('wetness', 'friction', 'margin', 'slip_speed'):
            assert np.isfinite(robot.heard(field, leg)).all()
    assert np.nanmax(robot.heard('load')) == LOAD


# --- doubts -------------------------------------------------------------------------------------


def test_a_force_sensor_that_stands_still_is_an_error_at_once(robot):
    robot.start()
    robot.stance(0.1, 0.0, 0.2)
    for number in range(60):
        jitter = 1e-9 * math.sin(number)
        position, force = (jitter, 0.0, 0.0), [(0.0, 0.0, LOAD), (jitter, 0.0, LOAD + jitter)]
        robot.sample(force=force, position=position)
    level, message = robot.health()
    assert level == ERROR and message.startswith('force stands still: 6.83 N')
    assert robot.health(2)[0] == OK
    assert robot.doubts()[-1] == 'force stands still'
    robot.stance(0.1, 0.0, 0.2)
    assert robot.health()[0] == OK
    assert math.isfinite(robot.heard('margin')[-1])


def test_feet_without_samples_are_errors_within_a_second(robot):
    robot.start()
    robot.stance(0.1, 0.0, 0.1)
    assert robot.health()[0] == OK
    robot.bench.now_ns = robot.now_ns
    robot.bench.tick(1.0)
    level, message = robot.health()
    assert level == ERROR and message.startswith('no wrench: for ')
    assert robot.doubts()[-1] == 'no wrench'  # the controller knows, too
    robot.now_ns = robot.bench.now_ns
    robot.stance(0.1, 0.0, 0.2)
    assert robot.health()[0] == OK


def test_rate_and_age_of_the_samples_are_reported(bench, monkeypatch):
    """The times are given, so that the machine does not matter."""
    ticks = []
    monkeypatch.setattr(EstimatorNode, 'on_tick', lambda self, call: ticks.append(call))
    node = bench.start(EstimatorNode, use_sim_time=False)
    (tick,) = ticks
    start_ns = node.get_clock().now().nanoseconds // SECOND * SECOND + SECOND
    tick(start_ns)

    def second(number, age_ns):
        """Give 50 samples in a second, with stamps of an age, and return the status."""
        for place in range(50):
            now_ns = start_ns + (number - 1) * SECOND + (place + 1) * 20 * MS
            bench.give(topics.SAMPLE, sample(now_ns - age_ns, (0.001 * place, 0.0, LOAD)))
        tick(start_ns + number * SECOND)
        return bench.statuses('estimator: rate')[-1][1]

    good = second(1, 5 * MS)
    assert (good.level, good.message) == (OK, '50 samples a second')
    assert [each.value for each in good.values] == ['50.0', '0.005']
    late = second(2, 150 * MS)
    assert (late.level, late.message) == (
        WARN, 'too slow, or clocks differ: samples are 0.15 s old',
    )  # fmt: skip
    early = second(3, -300 * MS)  # the other clock is ahead
    assert (early.level, early.values[1].value) == (WARN, '-0.300')


def test_what_is_learnt_is_kept_and_reported(context, tmp_path):
    """A file gives parameters at the start, before any other source, and is written at the end."""
    path = tmp_path / 'learnt.yaml'
    given = (
        'flat_dry: {scale: 0.7, sd: 0.05}\nflat_wet: {scale: 1.0, sd: 0.3}\n'
        'dome: {scale: 1.0, sd: 0.4}\n'
    )
    path.write_text('foot: large37\n' + given)

    def made(**more):
        values = {'legs': [1], 'scale.flat_dry': 2.0, 'learnt': str(path), **more}
        return EstimatorNode(context=context, parameter_overrides=overrides(values))

    node = made()
    assert node.get_parameter('scale.flat_dry').value == 0.7
    assert node.get_parameter('scale_sd.flat_wet').value == pytest.approx(math.hypot(0.3, 0.1))
    status = node._learnt_status()
    values = {each.key: each.value for each in status.values}
    assert values['flat_dry'] == '0.70 (0.56 to 0.87)'  # 0.7 exp(±1.96 × √(0.05² + 0.1²))
    node.destroy_node()
    assert path.read_text() == 'foot: large37\n' + given  # nothing was learnt
    node = made()
    slips = -0.5 * (np.log(GRID / 0.6) / 0.05) ** 2
    shared = node.stage.model.shared
    for step in range(9):
        shared.add(Felt(step, 0, False, 1e-6, np.array([slips, slips]), 1.0))
    shared.expected(10.0)
    path.unlink()
    node.destroy_node()
    kept = yaml.safe_load(path.read_text())
    assert kept['foot'] == 'large37'
    assert kept['flat_dry']['scale'] == pytest.approx(0.75, abs=0.05)  # 0.6 over 0.8 of large37
    assert kept['flat_dry']['sd'] < 0.06
    assert kept['dome']['sd'] == pytest.approx(0.4, abs=0.01)
    path.write_text('foot: small19\n' + given)
    with pytest.raises(ConfigError, match="foot = 'small19' is not allowed"):
        made()
