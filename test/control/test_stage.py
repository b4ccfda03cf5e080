# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest

from ros_pad.contact import Foot
from ros_pad.control import MorphologyController, flat
from ros_pad.control.stage import DecisionStage
from ros_pad.estimation import doubt as doubts
from ros_pad.records import ESTIMATE, PRESSURE, Block

CODES = {row.kind: code for code, row in reversed([*enumerate(doubts.TABLE)])}


class Watched(MorphologyController):
    """A controller that records its inputs."""

    def __init__(self):
        super().__init__(Foot.load('large37'), (1, 2), flat, 6.83, start='dome')
        self.updates, self.observed = [], []

    def update(self, leg, load, wet_probability, position, friction):
        self.updates.append((leg, load, wet_probability, position, friction))
        return super().update(leg, load, wet_probability, position, friction)

    def observe(self, leg, time, pressure, doubt=0.0):
        self.observed.append((leg, round(time, 9), pressure, doubts.kind(doubt)))
        super().observe(leg, time, pressure, doubt)


class Stage(DecisionStage):
    """A stage of two legs, and the inputs of its controller for one of them."""

    def __init__(self):
        super().__init__(Watched(), (1, 2))

    def estimate(self, time, load=5.0, position=None, wetness=0.5, leg=1, friction=0.4, doubt=''):
        """Decide on an estimate of one leg; return its set-point."""
        rows = ESTIMATE.rows(2)
        rows[leg - 1]['load'], rows[leg - 1]['wetness'] = load, wetness
        rows[leg - 1]['friction'] = friction
        rows[leg - 1]['doubt'] = math.nan if doubt is None else CODES[doubt]
        if position:
            rows[leg - 1]['position'] = position
        command = self.decide(Block.of(round(time * 1e9), rows))
        assert command.last_ns == round(time * 1e9)
        assert math.isnan(command.rows[0, 2 - leg]['setpoint'])  # of the other leg
        return command.rows[0, leg - 1]['setpoint'].item()

    def press(self, *pressures):
        rows = PRESSURE.rows(2)
        rows['pressure'] = pressures
        self.pressure(Block.of(0, rows))

    def updates(self, leg=1):
        return [update[1:] for update in self.controller.updates if update[0] == leg]

    def observed(self, leg=1):
        return [each[1:] for each in self.controller.observed if each[0] == leg]


HERE = (0.1, 0.2)


def test_a_decision_has_all_of_its_estimate():
    stage = Stage()
    setpoint = stage.estimate(0.02, 5.0, HERE, 0.25, friction=0.8)
    assert setpoint == stage.controller.setpoint(1) > 60e3
    stage.estimate(0.04, 2.0, (0.3, 0.4), 0.75, leg=2)
    assert stage.controller.updates == [(1, 5.0, 0.25, HERE, 0.8), (2, 2.0, 0.75, (0.3, 0.4), 0.4)]
    assert [time for time, *_ in stage.observed()] == [0.02, 0.04]


def test_each_leg_has_its_own_morphology_and_set_point():
    controller = MorphologyController(
        Foot.load('large37'), (1, 2), flat, 6.83, start={1: 'dome', 2: 'flat'}
    )
    rows = ESTIMATE.rows(2)
    rows['load'], rows['wetness'], rows['position'] = 5.0, 0.5, 0.0
    command = DecisionStage(controller, (1, 2)).decide(Block.of(0, rows)).rows[0]
    assert command['dome'].tolist() == [1.0, 0.0]
    assert command['setpoint'][0] > 5e4 and command['setpoint'][1] == 0.0


def test_a_load_without_a_decision_counts_for_the_next_one():
    """A bounce is not a step: the largest load since the last decision counts."""
    stage = Stage()
    stage.estimate(0.02, 9.0)
    stage.estimate(0.04, 2.0, HERE)
    stage.estimate(0.06, 1.0, HERE)
    assert [load for load, *_ in stage.updates()] == [9.0, 1.0]


def test_no_setpoint_follows_from_what_is_old_or_not_finite():
    stage = Stage()
    assert math.isnan(stage.estimate(0.02))  # no position yet
    assert stage.estimate(0.04, position=HERE) > 0.0
    assert stage.estimate(0.23) > 0.0
    assert math.isnan(stage.estimate(0.25))  # 0.21 s old
    assert math.isnan(stage.estimate(0.26, position=(math.inf, 0.0)))
    for bad in (math.nan, math.inf, -math.inf):
        assert math.isnan(stage.estimate(0.27, bad, HERE))
        assert math.isnan(stage.estimate(0.27, position=HERE, wetness=bad))
    assert len(stage.updates()) == 2


def test_an_impossible_probability_gives_no_setpoint_for_its_leg_only():
    stage = Stage()
    rows = ESTIMATE.rows(2)
    rows['load'], rows['position'], rows['wetness'] = 5.0, 0.0, (1.5, 0.5)
    setpoints = stage.decide(Block.of(20_000_000, rows)).rows[0]['setpoint']
    assert np.isnan(setpoints).tolist() == [True, False]
    assert not stage.updates(1) and stage.updates(2)


def test_each_pressure_counts_once_and_a_fault_of_sensors_until_it_ends():
    stage = Stage()
    stage.press(50e3, 10e3)
    stage.press(60e3, math.nan)
    stage.estimate(0.02, doubt='domed')
    stage.estimate(0.04, doubt='force stands still')
    stage.press(math.nan, math.nan)
    stage.estimate(0.06, doubt=None)
    stage.estimate(0.08)
    assert stage.observed() == [
        (0.02, 60e3, ''), (0.04, None, 'force stands still'), (0.06, None, 'force stands still'),
        (0.08, None, ''),
    ]  # fmt: skip
    assert stage.observed(2)[0] == (0.02, 10e3, '')


def test_legs_without_estimates_are_observed_and_their_new_morphology_is_told():
    stage = Stage()
    for now_ms in range(1000, 1100, 10):
        assert stage.tick(now_ms * 1_000_000) is None
    assert not stage.observed()
    first = stage.tick(1_200_000_000)
    assert first.rows[0]['dome'].tolist() == [1.0, 1.0]
    assert [time for time, *_ in stage.observed()] == [1.2]
    assert stage.tick(1_250_000_000) is None
    told = [stage.tick(round(1e9 * now)) for now in np.arange(1.4, 2.4, 0.15)]
    (record,) = filter(None, told)
    assert record.rows[0]['dome'].tolist() == [0.0, 0.0]  # the regulators have vented
    assert np.isnan(record.rows[0]['setpoint']).all()
    assert 'no load, position or estimate' in stage.controller.fault(1)


@pytest.mark.parametrize('leg', [1, 2])
def test_a_leg_without_estimates_does_not_stop_the_other_one(leg):
    stage = Stage()
    for step in range(60):
        setpoint = stage.estimate(0.02 * step, position=HERE, leg=leg)
    assert setpoint > 60e3
    assert [stage.controller.morphology(each) for each in (leg, 3 - leg)] == ['dome', 'flat']
