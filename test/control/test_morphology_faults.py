# SPDX-License-Identifier: Apache-2.0
"""Decisions of the controller for legs whose air or sensors fail."""

import math
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_pad.contact.resistance import Foot
from ros_pad.control import Choice, MorphologyController, dome, flat
from ros_pad.estimation import DOUBTS

FOOT = Foot.load('large37')
LOAD = 6.8  # N
STRIDE = 0.14  # m
PERIOD = 0.02  # s
SWING, STANCE = 20, 30  # periods: 0.4 and 0.6 s
LEGS = (1, 2)


def ideal(leg, setpoint, time):
    return setpoint


class Walk:
    """Legs that step together; ``pads`` gives pressure for leg, set-point and time."""

    def __init__(self, policy=dome, legs=LEGS, pads=ideal, belief=0.5, **options):
        self.controller = MorphologyController(FOOT, legs, policy, LOAD, **options)
        self.legs, self.pads, self.belief = legs, pads, belief
        self.looks = 0
        self.x = 0.0
        self.shapes = []  # morphologies of all legs after each stride
        self.readings = True
        self.sensor_faults = {}  # kinds of doubt by leg
        self.deaf = set()  # legs without estimates
        self.weightless = set()  # legs whose load reads zero

    @property
    def time(self):
        return self.looks * PERIOD

    def look(self, load):
        for leg in self.legs:
            setpoint = self.controller.setpoint(leg)
            reading = self.pads(leg, setpoint, self.time) if self.readings else None
            doubt = DOUBTS.index(self.sensor_faults.get(leg, ''))
            self.controller.observe(leg, self.time, reading, doubt)
            if leg not in self.deaf:
                felt = 0.0 if leg in self.weightless else load
                self.controller.update(leg, felt, self.belief, (self.x, 0.1 * leg))
        self.looks += 1

    def stride(self, count=1):
        for _ in range(count):
            for _ in range(STANCE):
                self.look(LOAD)
            self.x += STRIDE
            for _ in range(SWING):
                self.look(0.0)
            self.shapes.append([self.controller.morphology(leg) for leg in self.legs])
        return self.shapes[-1]

    def asked(self, leg, strides):
        """Walk on, and return for each stride whether the set-point is above zero."""
        return [self.stride() and self.controller.setpoint(leg) > 0.0 for _ in range(strides)]


def stuck(leg, start=0.0, end=math.inf):
    """Return pads of which that of one leg keeps its pressure between two times, s."""
    held = dict.fromkeys(LEGS, 0.0)

    def pads(which, setpoint, time):
        if which != leg or not start <= time < end:
            held[which] = setpoint
        return held[which]

    return pads


def test_sound_pads_change_nothing():
    walk = Walk(start='dome')
    assert walk.stride(12) == ['dome', 'dome']
    assert walk.controller.faults == []
    assert walk.controller.underpressure == {1: 0, 2: 0}
    assert walk.controller.fault(1) == walk.controller.remark(1) == ''


def test_a_foot_that_does_not_fill_goes_flat_and_is_tried_now_and_then():
    walk = Walk(pads=stuck(1))
    asked = walk.asked(1, 60)
    # A dome is commanded once and tried again after 5, 10 and 20 steps; each try is one step.
    tries = [k for k, each in enumerate(asked) if each]
    assert tries == [0, 5, 15, 35]
    # Its real morphology is reported, and the other leg is not affected.
    assert [shape[0] for shape in walk.shapes[1:]] == ['flat'] * 59
    assert [shape[1] for shape in walk.shapes] == ['dome'] * 60
    (fault,) = walk.controller.faults
    assert (fault.leg, fault.end) == (1, None)
    assert fault.start == pytest.approx(1.1, abs=0.1)  # half a second after the first lift-off
    assert fault.reason.startswith('does not fill: 0.0 kPa 0.5 s')
    assert walk.controller.underpressure[1] == 4


def test_a_foot_that_is_mended_comes_back_at_the_next_try():
    """Tries after 5 and 10 steps fail; the pad works again soon, but the next try is 20 later."""
    walk = Walk(pads=stuck(1, end=18.0))
    walk.stride(45)
    (fault,) = walk.controller.faults
    assert 35.0 < fault.end < 38.0
    assert walk.controller.fault(1) == ''
    assert [shape[0] for shape in walk.shapes[37:]] == ['dome'] * 8
    # The next fault waits as short as the first one.
    walk.pads = stuck(1)
    walk.stride(1)
    assert walk.asked(1, 6).index(True) < 5


def test_a_foot_that_does_not_vent_is_a_dome_that_stays():
    """The foot is commanded flat, but reported as a dome, and leaves no footprints."""
    script = iter([Choice('dome')] * 4 + [Choice('flat')] * 100)
    walk = Walk(lambda step: next(script), legs=(1,), pads=stuck(1, start=3.0), belief=0.9)
    walk.stride(12)
    assert walk.shapes[-1] == ['dome']
    assert walk.controller.setpoint(1) == 0.0
    assert 'does not vent: 7' in walk.controller.fault(1)
    assert walk.controller.footprints.wet_probability(walk.x, 0.1) == pytest.approx(0.5, abs=0.2)
    sound = Walk(flat, legs=(1,), belief=0.9)
    sound.stride(12)
    assert sound.controller.footprints.wet_probability(sound.x, 0.1) > 0.8


def test_a_faulty_foot_does_not_probe():
    script = iter([Choice('dome')] + [Choice('flat', probe=True)] * 9)
    probes = []

    def policy(step):
        probes.append(step.probing)
        return next(script)

    walk = Walk(policy, legs=(1,), pads=stuck(1, start=1.5))
    walk.stride(5)
    assert walk.controller.fault(1)
    assert not probes[-1]
    assert Walk(lambda step: Choice('flat', probe=True), legs=(1,)).stride(4) == ['flat']


@pytest.mark.parametrize('offset', [-2000.0, 1500.0, 2500.0])
def test_a_pressure_sensor_that_is_a_little_off_costs_no_footprints(offset):
    """The monitor tolerates small offsets, as when the weather changes an absolute sensor."""
    walk = Walk(flat, legs=(1,), belief=0.9, pads=lambda leg, setpoint, time: setpoint + offset)
    walk.stride(12)
    assert walk.controller.fault(1) == ''
    assert walk.controller.footprints.wet_probability(walk.x, 0.1) > 0.8


@pytest.mark.parametrize('why', ['sound', 'doubt', 'silence'])
def test_footprints_that_are_not_sure_are_not_kept(why):
    walk = Walk(flat, legs=(1,), belief=0.9)
    walk.stride(1)
    walk.x = 20.0  # far from all footprints
    walk.readings = why != 'silence'
    walk.sensor_faults[1] = 'force out of range' if why == 'doubt' else ''
    walk.stride(3)
    known = walk.controller.footprints.wet_probability(walk.x, 0.1)
    assert known == pytest.approx(0.85 if why == 'sound' else 0.5, abs=0.06)


def test_a_silent_regulator_keeps_what_it_has():
    """Set-points are kept: a change could take effect when the regulator answers, in stance."""
    walk = Walk(start='dome')
    walk.stride(3)
    walk.readings = False
    walk.stride(1)
    assert walk.controller.fault(1).startswith('no reading for 0.5 s')
    walk.controller.policy = flat
    assert walk.asked(1, 4) == [True] * 4
    assert walk.shapes[-1][0] == 'dome'
    walk.readings = True
    assert walk.stride(2) == ['flat', 'flat']
    assert walk.controller.fault(1) == ''


def test_a_leg_without_estimates_is_flat_and_the_others_go_on():
    """The regulator vents after 0.5 s without set-points; the controller reports a flat foot."""
    walk = Walk(start='dome')
    walk.stride(3)
    walk.deaf.add(1)
    walk.stride(1)
    assert re.search('estimate for 0.5 s$', walk.controller.fault(1))
    assert walk.controller.setpoint(1) == 0.0
    assert walk.shapes[-1] == ['flat', 'dome']
    walk.deaf.clear()
    walk.stride(2)
    assert walk.shapes[-1] == ['dome', 'dome']
    (fault,) = walk.controller.faults
    assert fault.end - fault.start == pytest.approx(0.5, abs=0.1)


def test_too_little_pressure_at_touch_down_is_counted():
    peak = 1.5 * LOAD - 0.1 * 0.5 * LOAD  # initial peak, faded by one step
    need = 75e3 + (peak / 37 - 0.2833) / 1.25e-5
    set_point = 75e3 + (1.2 * peak / 37 - 0.2833) / 1.25e-5
    for pressure, count in [(need + 50.0, 0), (need - 50.0, 1)]:
        walk = Walk(legs=(1,))
        walk.pads = lambda leg, p, t, pressure=pressure: pressure if p else 0.0
        walk.stride(1)
        assert walk.controller.setpoint(1) == pytest.approx(set_point, abs=10.0)
        assert walk.controller.underpressure == {1: 0}
        walk.look(LOAD)
        assert walk.controller.underpressure == {1: count}
        said = f'{1e-3 * pressure:.1f} kPa at touch-down'
        assert walk.controller.remark(1).startswith(said) is bool(count)


def slow(rate):
    """Return pads whose pressures approach the set-points at a rate, Pa/s."""
    held = {}

    def pads(leg, setpoint, time):
        before = held.get(leg, 0.0)
        held[leg] = min(setpoint, before + rate * PERIOD) if setpoint > before else max(
            setpoint, before - rate * PERIOD
        )  # fmt: skip
        return held[leg]

    return pads


@pytest.mark.parametrize(('rate', 'remark'), [(400e3, False), (40e3, True)])
def test_a_slow_hose_is_no_fault_and_is_remarked_on(rate, remark):
    """A fill takes about 70 kPa/rate; a swing lasts 0.4 s and a step 1 s."""
    seen = []

    def spy(step):
        seen.append(step)
        return Choice('dome' if len(seen) % 10 < 5 else 'flat')

    walk = Walk(spy, legs=(1,), pads=slow(rate))
    walk.stride(30)
    assert walk.controller.faults == []
    filling = walk.controller.monitor(1).fill_time
    assert filling == pytest.approx(70e3 / rate, rel=0.2, abs=0.06)
    assert ('slow hose' in walk.controller.remark(1)) is remark


readings = st.one_of(st.none(), st.just(math.nan), st.floats(-20e3, 120e3))


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(readings, st.booleans()), max_size=200), st.sampled_from([dome, flat]))
def test_whatever_is_read_no_felt_foot_changes_in_stance(stream, policy):
    controller = MorphologyController(FOOT, (1,), policy, LOAD)
    stood, time = False, 0.0
    for pressure, loaded in stream:
        time += 0.1
        before = controller.setpoint(1)
        controller.observe(1, time, pressure)
        assert controller.setpoint(1) == before
        controller.update(1, LOAD if loaded else 0.0, 0.5, (0.0, 0.0))
        if loaded or not stood:
            assert controller.setpoint(1) == before
        stood = loaded
    # The list is in order of start; one fault of the air and one other can be open.
    starts = [fault.start for fault in controller.faults]
    assert starts == sorted(starts)
    assert all(fault.end is None or fault.end >= fault.start for fault in controller.faults)
    assert sum(fault.end is None for fault in controller.faults) <= 2
