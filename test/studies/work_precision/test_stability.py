# SPDX-License-Identifier: Apache-2.0
"""The naive methods fail as documented, and those of ros_pad do not."""

import math
import sys

import numpy as np
import pytest
from scipy.optimize import nnls

from ros_pad.simulation.pneumatics import Hose, PneumaticChannel, RegulatorModel
from studies.work_precision import stability
from studies.work_precision.friction import Contact, creeping, elastic

pytestmark = pytest.mark.slow

MASS, INERTIA = stability.MASS, stability.INERTIA
MASSES = np.diag([MASS, MASS, INERTIA])
OURS = ('elastic', 'creeping', 'exact_stick')


def by_method(outcomes, case=None):
    found = {}
    for outcome in outcomes:
        if case in (None, outcome.case):
            found.setdefault(outcome.method, []).append(outcome)
    return found


def arm(foot):
    return np.array([[1.0, 0.0, -foot.lever_y], [0.0, 1.0, foot.lever_x]])


def jacobian(function, at, small):
    """Return the (3, 3) matrix of derivatives of a map of twists, by finite differences."""
    columns = []
    for axis in range(3):
        step = small * np.eye(3)[axis]
        ahead, behind = (np.array(function(tuple(at + sign * step))) for sign in (1, -1))
        columns.append((ahead - behind) / (2.0 * small))
    return np.array(columns).T


# --- a: explicit friction ------------------------------------------------------------------------


def test_step_limits_by_hand():
    """Limits are 2 m v/Σc = 2 v/(μ g) = 2.04 ms, and 2 I v/Σ c r² with feet at 0.2234 m."""
    limits = stability.step_limits(1e-3)
    assert limits['sliding'] == pytest.approx(2e-3 / (0.1 * 9.81), rel=1e-12)
    assert limits['turning'] == pytest.approx(
        2e-3 * 0.03 / (0.1 * 2.09 * 9.81 * 0.2234**2), rel=2e-3
    )


@pytest.mark.parametrize('mode', ['sliding', 'turning'])
def test_limit_is_where_the_map_of_a_step_grows(mode):
    """At the limit the eigenvalue of a step, by finite differences, exceeds 1 in magnitude."""
    limit = stability.step_limits()[mode]
    for share, grows in ((0.99, False), (1.01, True)):
        feet = stability.tripod_feet([0.1 * stability.WEIGHT / 3.0] * 3)
        slopes = jacobian(
            lambda twist, feet=feet, dt=share * limit: stability.explicit_euler(twist, feet, dt),
            np.zeros(3),
            1e-8,
        )
        growth = abs(slopes[2, 2]) if mode == 'turning' else abs(slopes[0, 0])
        assert (growth > 1.0) == grows
        assert growth == pytest.approx(abs(1.0 - 2.0 * share), rel=1e-4)


def test_explicit_friction_chatters_beyond_its_limit_and_ours_never():
    found = by_method(stability.explicit_friction())
    limit = stability.step_limits()['turning']
    euler, fourth = found['explicit Euler'], found['RK4']
    for outcome in euler:
        assert outcome.fails == (outcome.at > limit)
        if outcome.fails:
            assert outcome.value == pytest.approx(outcome.law, rel=2e-3)
    assert sum(outcome.fails for outcome in euler) > 10
    # RK4 allows steps that are 39 % longer, but no more.
    for outcome in fourth:
        assert outcome.fails == (outcome.at > 2.7853 / 2.0 * limit)
    assert fourth[-1].value > 5e-3
    for name in OURS:
        assert found[name][-1].at == 0.02
        assert not any(outcome.fails for outcome in found[name])


# --- b: creep in MuJoCo --------------------------------------------------------------------------


def test_creep_of_mujoco_does_not_shrink_with_the_step():
    pytest.importorskip('mujoco')
    found = by_method(stability.creep())
    speeds = {name: np.array([outcome.value for outcome in found[name]]) for name in found}
    for name in stability.SETTINGS:
        if 'noslip' not in name:
            assert np.ptp(speeds[name]) < 1e-6 * speeds[name].max()  # steps of 0.1 to 4 ms
    plain = speeds['elliptic, impratio 1']
    assert speeds['pyramidal, impratio 1 (default)'].min() > 3.0 * plain.max()
    assert plain == pytest.approx(5.65e-3, rel=2e-3)
    for ratio in (1, 10, 100):
        name = f'elliptic, impratio {ratio}'
        assert speeds[name] == pytest.approx(plain / ratio, rel=1e-4)
        assert speeds[name] == pytest.approx(stability.creep_law(ratio), rel=1e-6)
        assert all(outcome.fails for outcome in found[name]) == (ratio < 100)
    assert speeds['elliptic, impratio 10, noslip 5'].max() < 1e-9


def test_ours_does_not_creep_or_by_a_known_speed():
    for dt in (1e-3, 4e-3):
        assert abs(stability.planar_creep(elastic, dt)) < 2e-7
        assert abs(stability.planar_creep(stability.OURS['exact_stick'], dt)) < 1e-9
        # s/√(s² + ε²) = 0.8 at s = 4/3 ε.
        assert stability.planar_creep(creeping, dt) == pytest.approx(4e-5 / 3.0, rel=1e-3)


# --- c: three sticking feet ----------------------------------------------------------------------


def test_six_forces_three_equations():
    matrix = stability.balance(stability.TRIPOD)
    assert matrix.shape == (3, 6)
    assert np.linalg.matrix_rank(matrix) == 3
    # Two feet that pull apart along their line have no total force and no moment.
    (x0, y0), (x1, y1), _ = stability.TRIPOD
    apart = np.array([x1 - x0, y1 - y0, x0 - x1, y0 - y1, 0.0, 0.0])
    assert matrix @ apart == pytest.approx(np.zeros(3), abs=1e-15)


def test_gauss_seidel_splits_forces_by_the_order_of_the_feet():
    push = np.array([stability.SPLIT_PUSH, 0.0, 0.0])
    matrix = stability.balance(stability.TRIPOD)
    forces = []
    for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        twist, force = stability.held('Gauss-Seidel', order)
        # With each order the robot rests, and push and moment are balanced.
        assert stability.miss(twist, stability.STILL) < 1e-9
        assert matrix @ force.ravel() + push == pytest.approx(np.zeros(3), abs=1e-7)
        forces.append(force)
    assert np.ptp(forces, axis=0).max() > 0.5 * stability.SPLIT_PUSH


@pytest.mark.parametrize('name', OURS)
def test_our_splits_follow_their_law_in_any_order(name):
    """Forces are the constrained minimum of Σ|f|²/w, here from its nine optimality equations."""
    weights = {'elastic': (3.0, 2.0, 1.0), 'creeping': (1.0, 2.0, 3.0)}.get(name, (1.0,) * 3)
    matrix = stability.balance(stability.TRIPOD)
    system = np.block([
        [np.diag(1.0 / np.repeat(weights, 2)), matrix.T],
        [matrix, np.zeros((3, 3))],
    ])  # fmt: skip
    expected = np.linalg.solve(system, [0.0] * 6 + [-stability.SPLIT_PUSH, 0.0, 0.0])[:6]
    for order in ((0, 1, 2), (2, 0, 1), (1, 0, 2)):
        twist, force = stability.held(name, order)
        assert stability.miss(twist, stability.STILL) < 1e-5
        assert force.ravel() == pytest.approx(expected, abs=1e-3 * stability.SPLIT_PUSH)


def test_chart_of_the_splits():
    found = by_method(stability.sticking_feet())
    assert all(outcome.fails for outcome in found['Gauss-Seidel'])
    for name in OURS:
        assert not any(outcome.fails for outcome in found[name])
        assert len(found[name]) == 18


# --- d: all feet slip ----------------------------------------------------------------------------


@pytest.fixture(scope='module')
def slides():
    return stability.slides(60, seed=1)


def test_truth_of_the_slides(slides):
    """The truth satisfies M (q - b) + dt Σ c Bᵀ ŝ = 0, the minimum of a convex function."""
    for slide in slides:
        twist = np.array(slide.truth)
        rest = MASSES @ (twist - slide.free)
        scale = 0.0
        for foot in slide.feet:
            slip = arm(foot) @ twist + (foot.motion_x, foot.motion_y)
            rest += slide.dt * foot.cap * arm(foot).T @ slip / np.linalg.norm(slip)
            scale += slide.dt * foot.cap
        assert np.abs(rest).max() < 1e-4 * scale


def test_fixed_point_fails_where_its_law_predicts(slides):
    fails = [not stability.miss(stability.fixed_point(s), s.truth) < 1e-6 for s in slides]
    assert 10 < sum(fails) < 50
    for slide, failed in zip(slides, fails, strict=True):
        if slide.contraction > 1.0:
            assert failed
        if slide.contraction < 0.8:  # 0.8^100 = 2e-10
            assert not failed


def test_contraction_is_the_slope_of_the_iteration(slides, monkeypatch):
    monkeypatch.setattr(stability, 'MOST_ITERATIONS', 1)
    for slide in slides[:20]:

        def once(start, slide=slide):
            return stability.fixed_point(stability.dataclasses.replace(slide, start=start))

        slopes = jacobian(once, np.array(slide.truth), 1e-7)
        assert np.abs(np.linalg.eigvals(slopes)).max() == pytest.approx(
            slide.contraction, rel=1e-3
        )


def test_full_newton_fails_from_a_bad_start(slides):
    assert sum(not stability.miss(stability.full_newton(s), s.truth) < 1e-6 for s in slides) > 5


@pytest.mark.parametrize('scale', [1.0, 1e3])
def test_ours_settle_from_any_start_with_forces_on_the_cones(slides, scale):
    for slide in slides:
        start = tuple(scale * value for value in slide.start)
        for step in (elastic, creeping):
            for foot in slide.feet:
                foot.shear_x = foot.shear_y = 0.0
            twist = step(slide.free, MASS, INERTIA, slide.feet, slide.dt, start)
            # At 3 mm/s the error of creeping feet with ε = 1e-5 m/s is (ε/s)²/2 = 6e-6.
            assert stability.miss(twist, slide.truth) < 1e-6
            for foot in slide.feet:
                force = math.hypot(foot.force_x, foot.force_y)
                assert force == pytest.approx(foot.cap, rel=1e-5)
                assert foot.slid > 0.0


def test_chart_of_the_slides():
    found = by_method(stability.slipping_feet())
    for name in ('fixed point', 'Newton, full steps'):
        assert any(outcome.fails for outcome in found[name])
    for name in ('elastic', 'creeping'):
        assert not any(outcome.fails for outcome in found[name])


# --- e: a foot would have to pull ----------------------------------------------------------------


def test_clamped_loads_make_up_weight_or_moment():
    found = by_method(stability.pulling_feet())
    for name in ('clamped', 'clamped, scaled to the weight'):
        for outcome in found[name]:
            assert outcome.fails == (outcome.at > 1e-12)
            assert outcome.value == pytest.approx(outcome.law, abs=1e-12)
        # The centre is 60 mm beyond an edge; the third foot is 0.336 m from this edge.
        assert found[name][-1].value == pytest.approx(0.06 / 0.3355, rel=5e-3)


def test_least_norm_on_three_feet_is_the_balance():
    """Loads of three feet are shares of areas, and negative outside the triangle."""
    (x0, y0), (x1, y1), (x2, y2) = stability.TRIPOD
    for x, y in ((0.01, 0.02), (0.2, 0.0), (-0.3, 0.1)):
        whole = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        first = ((x1 - x) * (y2 - y) - (x2 - x) * (y1 - y)) / whole
        assert stability.least_norm(stability.TRIPOD, x, y)[0] == pytest.approx(first, abs=1e-12)


def test_least_norm_on_six_feet_pulls_although_the_robot_stands():
    """By hand, 1/6 = x/4X: from 2/3 of the front feet's distance on, rear feet would pull."""
    homes = np.array(stability.BODY.homes)
    front = homes[:, 0].max()
    assert stability.least_norm(homes, 0.66 * front, 0.0).min() > 0.0
    assert stability.least_norm(homes, 0.67 * front, 0.0).min() < 0.0
    loads, misses = nnls(np.vstack([np.ones(6), homes.T]), [1.0, 0.9 * front, 0.0])
    assert misses < 1e-12 and loads.min() >= 0.0


@pytest.mark.parametrize('height', [0.9, 0.95, 1.0])
def test_verdict_comes_when_the_pressure_point_leaves_the_tripod(height):
    """A rigid robot without slip has its pressure point height a(t)/g behind the centre."""
    fell, verdict = stability.walk_top_heavy(height)
    # The reference uses the tripod 1, 3, 5, which moves back under the body.
    speed, rate = 0.12, 4.0 * math.pi
    for step in range(50, 250):
        time = step * 1e-3
        lean = -height * speed * rate * math.sin(rate * time) / 9.81
        moved = speed * (time - 0.25) - speed / rate * (math.sin(rate * time) - math.sin(math.pi))
        # ``edge`` is where the edge from foot 3 to foot 5 crosses y = 0.
        (x3, y3), (x5, y5) = stability.TRIPOD[1], stability.TRIPOD[2]
        edge = x3 + (x5 - x3) * (0.0 - y3) / (y5 - y3) - moved
        if lean < edge:
            break
    assert fell == pytest.approx(time, abs=2.1e-3)
    assert stability.tip_over_law(height) == pytest.approx(time, abs=1.1e-3)
    assert verdict == f'tip-over at {fell:.3f} s: leg 1 would have to pull'


def test_no_verdict_for_the_shipped_robot():
    assert stability.walk_top_heavy(stability.BODY.height) == (None, None)
    assert stability.tip_over_law(stability.BODY.height) is None


# --- f: a hose near equal pressures --------------------------------------------------------------


def test_printed_flow_law_has_no_stable_step_and_ours_no_chatter(monkeypatch):
    monkeypatch.setattr(stability, 'TIMES', (0.05, 0.1))
    monkeypatch.setattr(stability, 'SOLVERS', ('RK45', 'BDF'))
    # The step limit is 0.438 ms; with laminar flow, as in this hose, it is 0.479 ms.
    monkeypatch.setattr(stability, 'FILL_STEPS', (*stability.FILL_STEPS, 4.3e-4, 4.6e-4))
    outcomes = stability.filling()
    found = by_method(outcomes, stability.HOSE.name)
    # The chatter is (A dt/2)²: a tenth of the step has a hundredth of it, and none has none.
    for outcome in found[stability.ISO]:
        assert outcome.value > 0.05
        if outcome.law is not None:
            assert outcome.value == pytest.approx(outcome.law, rel=0.01)
    for outcome in found[stability.ISO_LINEAR]:
        assert outcome.fails == (outcome.at > stability.linear_limit())
    assert any(outcome.fails for outcome in found[stability.ISO_LINEAR])
    for outcome in found[stability.CHANNEL]:
        assert outcome.value < 0.1

    calls = by_method(outcomes, stability.FULL.name)
    short, long = (outcome.value for outcome in calls['solve_ivp (RK45)'])
    assert long > 1.8 * short > 1.8 * stability.MANY
    # Implicit steps with error control work, too.
    assert not any(outcome.fails for outcome in calls['solve_ivp (BDF)'])
    assert not any(outcome.fails for outcome in calls[stability.CHANNEL])


def test_step_limit_of_the_linear_range_by_hand():
    """A hose of 4 mm x 1 m has C = 1.196e-8 m³/(s Pa) and b = 0.3543.

    Its flow is linear from 0 at equal pressures to C ρ √(1 - x²) p at Δp = p/1000, where
    x = (0.999 - b)/(1 - b) = 0.998451.
    """
    conductance = 1.1958e-8 * 1.185 * math.sqrt(1.0 - 0.998451**2) / 1e-3
    volume = stability._SCENE.foot.chamber_volume + math.pi / 4.0 * 0.004**2
    limit = 2.0 * volume * 1.185 / 100e3 / conductance
    assert stability.linear_limit() == pytest.approx(limit, rel=2e-3)
    supply = 75e3 + 101325.0
    for drop, flow in ((1.0, conductance), (100.0, 100.0 * conductance)):
        assert stability.linear_flow(supply, supply - drop) == pytest.approx(flow, rel=2e-3)
    # At the limit a step multiplies a small error by -1.
    for share, chatters in ((0.99, False), (1.01, True)):
        chatter = stability.filled(stability.linear_flow, share * stability.linear_limit())
        assert (chatter > 1.0) == chatters


def test_radau_gets_stuck(monkeypatch):
    monkeypatch.setattr(stability, 'MOST_CALLS', 20_000)
    assert stability.adaptive_calls('Radau', 0.05) is None


@pytest.mark.parametrize('dt', [1e-4, 5e-3, 0.02, 0.1])
@pytest.mark.parametrize('volume', [1e-9, 2e-6, 1e-3])
def test_channel_never_overshoots_however_stiff(volume, dt):
    regulator = RegulatorModel(natural_frequency=1000.0, damping=1.0, dead_time=0.0)
    channel = PneumaticChannel(regulator, Hose(4e-3, 0.01), volume)
    last = 0.0
    for _ in range(max(20, round(0.05 / dt))):
        pressure = channel.step(75e3, dt)
        assert last <= pressure <= 75e3 * (1.0 + 1e-12)
        last = pressure
    if volume < 1e-5:
        assert last == pytest.approx(75e3, abs=0.1)


# --- g: the threshold of the rail leg ------------------------------------------------------------


def test_no_step_makes_the_threshold_surer():
    for ratio in (1.06, 1.17, 1.47):
        # the law for small c - F
        law = ratio / (ratio - 1.0)
        conditions = [stability.condition(ratio, dt) for dt in (2e-3, 1e-3, 2.5e-4)]
        assert conditions == pytest.approx([law] * 3, rel=0.1)
    found = stability.threshold()
    for outcome in found:
        if outcome.at <= 1.3:
            assert outcome.fails
        if outcome.at >= 2.0:
            assert not outcome.fails


# --- chart ---------------------------------------------------------------------------------------


def test_chart_without_mujoco(monkeypatch, tmp_path):
    """A case that cannot be measured is left out, and reported."""
    monkeypatch.setitem(sys.modules, 'mujoco', None)
    monkeypatch.setattr(stability, 'CASES', (stability.creep, stability.pulling_feet))
    shares = []
    outcomes = stability.measure(shares.append)
    assert shares == [0.0, 0.5, 1.0]
    assert {outcome.case for outcome in outcomes} == {
        stability.PULLING.name,
        stability.FALLING.name,
    }
    text = stability.table(outcomes)
    assert 'creep in MuJoCo: not measured, pip install "ros_pad[mujoco]"' in text
    picture = stability.figures(outcomes)['stability']
    picture.savefig(tmp_path / 'stability.png')
    assert (tmp_path / 'stability.png').stat().st_size > 20_000


def test_table_counts_failures():
    def outcome(at, value, fails):
        return stability.Outcome(
            'case', 'method', False, 'step, s', at, 'size, m', value, 2.0, fails
        )

    text = stability.table([outcome(1.0, 2.0, False), outcome(3.0, 2.2, True)])
    assert 'case (step, s: size, m)' in text
    line = next(
        line for line in text.splitlines() if line.startswith('  method  ') and '3' in line
    )
    assert line.split() == ['method', '2', '1', '3', '2', '2.2', '10', '%']


def test_a_foot_of_the_tripod_is_where_the_scene_has_it():
    feet = stability.tripod_feet([1.0, 2.0, 3.0])
    assert [(f.lever_x, f.lever_y) for f in feet] == [
        (0.193, 0.112), (-0.193, 0.112), (0.0, -0.224)
    ]  # fmt: skip
    assert all(isinstance(foot, Contact) for foot in feet)


def test_every_panel_is_drawn(monkeypatch, tmp_path):
    monkeypatch.setattr(stability, 'STEPS', (1e-4, 1e-3, 1e-2))
    monkeypatch.setattr(stability, 'CREEP_STEPS', (2e-3, 4e-3))
    monkeypatch.setattr(stability, 'SLIPS', 8)
    monkeypatch.setattr(stability, 'FILL_STEPS', (1e-4, 1e-3, 1e-2))
    monkeypatch.setattr(stability, 'SOLVERS', ('BDF',))
    monkeypatch.setattr(stability, 'RATIOS', (1.1, 2.0))
    picture = stability.figures(stability.measure(lambda share: None))['stability']
    picture.savefig(tmp_path / 'stability.png')
    drawn = {panel.get_title(loc='left')[:1]: panel for panel in picture.axes if panel.lines}
    assert set('acdefg') <= set(drawn) <= set('abcdefg')
    for panel in drawn.values():
        assert panel.get_xlabel() and (panel.get_ylabel() or panel.get_yticklabels())
