# SPDX-License-Identifier: Apache-2.0
import math

from ros_pad.contact import Foot
from ros_pad.control import MorphologyController
from ros_pad.control import flat
from ros_pad.control.stage import DecisionStage
from ros_pad.estimation import FootEstimator
from ros_pad.estimation.stage import Emission

ESTIMATE = FootEstimator(Foot.load('large37'), 6.83).update(
    0.0, (0.0, 0.0, 5.0), (0.0, 0.0, 0.0), 0.0
)


class Watched(MorphologyController):
    """A controller that records its inputs."""

    def __init__(self):
        super().__init__(Foot.load('large37'), (1, 2), flat, 6.83)
        self.updates, self.observed, self.faults_of_sensors = [], [], []
        self.frictions = []

    def update(self, leg, load, wet_probability, position, friction):
        self.updates.append((leg, load, wet_probability, position))
        self.frictions.append(friction)
        return super().update(leg, load, wet_probability, position, friction)

    def observe(self, leg, time, pressure, sensor_fault=''):
        self.observed.append((time, pressure))
        self.faults_of_sensors.append(sensor_fault)
        super().observe(leg, time, pressure, sensor_fault)


def staged(reject=None):
    controller = Watched()
    return controller, DecisionStage(controller, 1, reject)


def emission(load, position, wet_probability=0.5, friction=0.4):
    estimate = ESTIMATE._replace(wet_probability=wet_probability, friction_mean=friction)
    return Emission(0, estimate, load, position)


def test_the_largest_load_since_the_last_estimate_counts():
    controller, leg = staged()
    leg.position(0.1, 0.2)
    for load in (5.0, 0.5, math.inf, 1.0):
        leg.load(load)
    assert leg.estimate(0.02, 0.5).setpoint == 0.0
    leg.position(0.1, 0.2)
    assert leg.estimate(0.04, 0.5).setpoint == 0.0  # without a new wrench the last one counts
    leg.load(2.0)
    leg.estimate(0.06, 0.25)
    assert controller.updates == [
        (1, 5.0, 0.5, (0.1, 0.2)),
        (1, 1.0, 0.5, (0.1, 0.2)),
        (1, 2.0, 0.25, (0.1, 0.2)),
    ]


def test_no_setpoint_follows_from_what_is_old_or_not_finite():
    controller, leg = staged()
    leg.load(5.0)
    assert leg.estimate(0.02, 0.5).setpoint is None  # no position yet
    leg.position(0.0, 0.0)
    assert leg.estimate(0.04, 0.5).setpoint is not None
    assert leg.estimate(0.23, 0.5).setpoint is not None
    assert leg.estimate(0.25, 0.5).setpoint is None  # 0.21 s old
    leg.position(math.nan, 0.0)
    assert leg.estimate(0.26, 0.5).setpoint is None
    leg.position(0.0, 0.0)
    leg.load(math.nan)
    assert leg.estimate(0.27, 0.5).setpoint is None
    assert len(controller.updates) == 2


def test_an_impossible_probability_is_rejected():
    rejected = []
    _, leg = staged(rejected.append)
    leg.load(5.0)
    leg.position(0.0, 0.0)
    assert leg.estimate(0.02, 1.5).setpoint is None
    assert 'wet_probability = 1.5' in str(rejected[0])


def test_each_pressure_counts_once_and_a_fault_of_sensors_until_it_ends():
    controller, leg = staged()
    leg.position(0.0, 0.0)
    leg.load(5.0)
    leg.pressure(60e3)
    leg.doubt('domed: wet and dry ground feel alike')
    leg.estimate(0.02, 0.5)
    leg.doubt('force stands still: 6.8 N to the last digit')
    leg.estimate(0.04, 0.5)
    assert controller.observed == [(0.02, 60e3), (0.04, None)]
    assert controller.faults_of_sensors == ['', 'force stands still']


def test_legs_without_estimates_are_observed():
    controller, leg = staged()
    assert leg.tick(1.0) is None
    assert leg.tick(1.09) is None
    assert leg.tick(1.2) is not None
    assert [time for time, _ in controller.observed] == [1.2]
    assert leg.tick(1.25) is None


def test_a_morphology_is_new_once():
    _, leg = staged()
    assert leg.estimate(0.02, 0.5).morphology == 'flat'
    assert leg.estimate(0.04, 0.5).morphology is None


def test_an_emission_has_all_that_a_decision_needs():
    controller, leg = staged()
    decision = leg.take(0.02, emission(5.0, (0.1, 0.2), 0.25, 0.8))
    assert decision == (0.0, 'flat')
    assert leg.take(0.04, emission(2.0, (0.3, 0.4), 0.75, 0.1)) == (0.0, None)
    assert controller.frictions == [0.8, 0.1]
    assert controller.updates == [(1, 5.0, 0.25, (0.1, 0.2)), (1, 2.0, 0.75, (0.3, 0.4))]
    assert [time for time, _ in controller.observed] == [0.02, 0.04]


def test_an_emission_without_a_position_leaves_the_last_one_until_it_is_old():
    controller, leg = staged()
    assert leg.take(0.02, emission(5.0, None)).setpoint is None
    assert leg.take(0.04, emission(5.0, (0.1, 0.2))).setpoint == 0.0
    assert leg.take(0.23, emission(5.0, None)).setpoint == 0.0
    assert leg.take(0.25, emission(5.0, None)).setpoint is None  # 0.21 s old
    assert leg.take(0.26, emission(5.0, (0.1, 0.2))).setpoint == 0.0
    assert [update[3] for update in controller.updates] == [(0.1, 0.2)] * 3


def test_no_setpoint_follows_from_an_emission_that_is_not_finite():
    rejected = []
    controller, leg = staged(rejected.append)
    nan = math.nan
    assert leg.take(0.02, emission(nan, (0.1, 0.2))).setpoint is None
    assert leg.take(0.04, emission(5.0, (nan, nan))).setpoint is None
    assert leg.take(0.06, emission(5.0, None)).setpoint is None  # still hidden
    assert leg.take(0.08, emission(5.0, (0.1, 0.2), nan)).setpoint is None
    assert not controller.updates
    assert leg.take(0.1, emission(5.0, (0.1, 0.2))).setpoint == 0.0
    assert not rejected


def test_a_load_without_a_decision_counts_for_the_next_one():
    controller, leg = staged()
    leg.take(0.02, emission(9.0, None))
    leg.take(0.04, emission(2.0, (0.1, 0.2)))
    leg.take(0.06, emission(2.0, (0.1, 0.2)))
    assert [update[1] for update in controller.updates] == [9.0, 2.0]
