# SPDX-License-Identifier: Apache-2.0
"""Find inputs at which simulations of a walking robot fail, with plain methods and with ours.

In each of seven cases, plain methods and those of ros_pad get the same inputs. A number measures
the failure, and a law predicts at which inputs and by how much a plain method must fail.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import random
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.pad import Array
from ros_pad.pace import Progress
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.planar_robot import PlanarRobot
from ros_pad.simulation.pneumatics import (
    ATMOSPHERE,
    REFERENCE_DENSITY,
    REFERENCE_PRESSURE,
    Hose,
    PneumaticChannel,
    RegulatorModel,
    conductance,
)
from ros_pad.simulation.rail_leg import RailLeg
from ros_pad.simulation.scene import LeggedBody, RailBody, Scene, Tow
from studies.work_precision.friction import Contact, Twist, creeping, elastic, exact_stick

Step = Callable[[Twist, float, float, Sequence[Contact], float, Twist], Twist]

STILL: Twist = (0.0, 0.0, 0.0)
LEGS = (1, 3, 5)  # one tripod
# The hexapod of the shipped scenes, standing on one of its tripods.
_SCENE = Scene.load('hexapod_smooth_dry_flat')
assert isinstance(_SCENE.body, LeggedBody)
BODY: LeggedBody = _SCENE.body
MASS, INERTIA, WEIGHT = BODY.mass, BODY.inertia, BODY.mass * GRAVITY
TRIPOD = tuple(BODY.homes[leg - 1] for leg in LEGS)
STIFFNESS = _SCENE.foot.shear_stiffness


@dataclass(frozen=True)
class Outcome:
    """Result of a method for one input of a case.

    Attributes
    ----------
    case, method : str
    ours : bool
        Whether the method belongs to ros_pad.
    input : str
        Name and unit of the varied quantity.
    at : float
        Value of the varied quantity.
    measure : str
        Name and unit of the measure of failure.
    value : float or None
        Value of the measure; None if the method reports that it has no result.
    law : float or None
        Value predicted by the law of the case; None if the law gives none.
    fails : bool
        Whether the method fails.
    """

    case: str
    method: str
    ours: bool
    input: str
    at: float
    measure: str
    value: float | None
    law: float | None
    fails: bool


@dataclass(frozen=True)
class Case:
    """Common attributes of the outcomes of a case, see :class:`Outcome`."""

    name: str
    input: str
    measure: str

    def of(
        self, method: str, at: float, value: float | None, law: float | None, fails: bool
    ) -> Outcome:
        """Return the outcome of a method at a value of the input."""
        ours = method in OURS or method in (CHANNEL, VERDICT) or method.startswith(RAIL)
        return Outcome(self.name, method, ours, self.input, at, self.measure, value, law, fails)


def measure(progress: Progress) -> list[Outcome]:
    """Return the outcomes of all cases; report progress, 0 to 1, to ``progress``.

    The case of MuJoCo is left out if MuJoCo is not installed.
    """
    outcomes: list[Outcome] = []
    for number, case in enumerate(CASES):
        progress(number / len(CASES))
        try:
            outcomes += case()
        except ModuleNotFoundError as error:
            if error.name != 'mujoco':
                raise
    progress(1.0)
    return outcomes


def figures(outcomes: list[Outcome], progress: Progress | None = None) -> dict[str, Figure]:
    """Return the picture, by name: a panel for each case."""
    from studies.work_precision import stability_chart

    return {'stability': stability_chart.draw(outcomes)}


def table(outcomes: Sequence[Outcome]) -> str:
    """Return the outcomes as text, a block for each case and a line for each method."""
    lines = []
    for name in dict.fromkeys(outcome.case for outcome in outcomes):
        case = [outcome for outcome in outcomes if outcome.case == name]
        methods = list(dict.fromkeys(outcome.method for outcome in case))
        width = max(map(len, methods))
        lines += [
            f'{name} ({case[0].input}: {case[0].measure})',
            f'  {"method":{width}}  inputs  failures  first at  least value  worst value'
            '  off the law by',
        ]
        for method in methods:
            part = [outcome for outcome in case if outcome.method == method]
            failed = [outcome.at for outcome in part if outcome.fails]
            values = [outcome.value for outcome in part if outcome.value is not None]
            misses = [
                abs(outcome.value / outcome.law - 1.0)
                for outcome in part
                if outcome.value is not None and outcome.law
            ]
            least, worst = (
                (f'{min(values):11.3g}', f'{max(values):11.3g}') if values else (f'{"-":>11}',) * 2
            )
            lines.append(
                f'  {method:{width}}  {len(part):6d}  {len(failed):8d}'
                f'  {f"{min(failed):.3g}" if failed else "-":>8}  {least}  {worst}'
                f'  {f"{100.0 * max(misses):.2g} %" if misses else "-":>14}'
            )
        lines.append('')
    if all(outcome.case != CREEP.name for outcome in outcomes):
        lines += [f'{CREEP.name}: {NEEDS_MUJOCO}', '']
    return '\n'.join(lines)


def _exact_stick(
    free: Twist,
    mass: float,
    inertia: float,
    contacts: Sequence[Contact],
    dt: float,
    start: Twist,
) -> Twist:
    return exact_stick(free, mass, inertia, contacts, dt)


OURS: dict[str, Step] = {
    'elastic': elastic,
    'creeping': creeping,
    'exact_stick': _exact_stick,
}


def tripod_feet(
    caps: Sequence[float], stiffness: Sequence[float] = (STIFFNESS,) * len(TRIPOD)
) -> list[Contact]:
    """Return the feet of the tripod on level ground, with caps, N, and stiffnesses, N/m."""
    feet = []
    for lever, cap, spring in zip(TRIPOD, caps, stiffness, strict=True):
        foot = Contact(spring)
        foot.lever_x, foot.lever_y = lever
        foot.cap = cap
        feet.append(foot)
    return feet


# --- a: explicit friction ------------------------------------------------------------------------

EXPLICIT = Case('explicit friction', 'step, s', 'mean speed of the feet, m/s')
STEPS = tuple(float(dt) for dt in np.geomspace(5e-5, 0.02, 27))
FRICTION = 0.1
SOFTENING = 1e-3  # m/s: slip speed below which the friction of the plain methods is linear
KICK = 1e-6  # m/s: speed of a foot at the start, and limit above which its speed is chatter
_COUNT = 400  # steps

# Largest stable product of step and decay rate: there the growth factor R of a linear decay has
# |R| = 1.
STABLE = {'explicit Euler': 2.0, 'RK4': 2.785293563405282}


def step_limits(softening: float = SOFTENING) -> dict[str, float]:
    """Return the longest step of explicit Euler, s: ``sliding``, ``turning``.

    Friction c s/√(s² + v²) has the slope c/v at rest, so that sliding decays at the rate Σc/(m v)
    and turning at Σc r²/(I v). Explicit Euler is stable for steps below 2 over these rates.
    """
    cap = FRICTION * WEIGHT / len(TRIPOD)
    turning = sum(cap * (x * x + y * y) for x, y in TRIPOD)
    return {
        'sliding': 2.0 * MASS * softening / (FRICTION * WEIGHT),
        'turning': 2.0 * INERTIA * softening / turning,
    }


def _friction_rates(twist: Twist, feet: Sequence[Contact]) -> Twist:
    """Return the accelerations under friction c s/√(s² + v²)."""
    fx = fy = moment = 0.0
    for foot in feet:
        sx, sy = foot.slip(twist)
        gain = -foot.cap / math.sqrt(sx * sx + sy * sy + SOFTENING * SOFTENING)
        fx += gain * sx
        fy += gain * sy
        moment += gain * (foot.lever_x * sy - foot.lever_y * sx)
    return fx / MASS, fy / MASS, moment / INERTIA


def _ahead(twist: Twist, rates: Twist, dt: float) -> Twist:
    return (twist[0] + dt * rates[0], twist[1] + dt * rates[1], twist[2] + dt * rates[2])


def explicit_euler(twist: Twist, feet: Sequence[Contact], dt: float) -> Twist:
    """Return the twist after a step with the friction at the start of the step."""
    return _ahead(twist, _friction_rates(twist, feet), dt)


def runge_kutta(twist: Twist, feet: Sequence[Contact], dt: float) -> Twist:
    """Return the twist after a step of the classic Runge-Kutta method of four stages."""
    one = _friction_rates(twist, feet)
    two = _friction_rates(_ahead(twist, one, 0.5 * dt), feet)
    three = _friction_rates(_ahead(twist, two, 0.5 * dt), feet)
    four = _friction_rates(_ahead(twist, three, dt), feet)
    mean = [
        (a + 2.0 * b + 2.0 * c + d) / 6.0 for a, b, c, d in zip(one, two, three, four, strict=True)
    ]
    return _ahead(twist, (mean[0], mean[1], mean[2]), dt)


def explicit_friction() -> list[Outcome]:
    """Turn a standing robot slightly; chatter is the mean speed of its feet 400 steps later."""
    radius = max(math.hypot(*lever) for lever in TRIPOD)
    peers = {'explicit Euler': explicit_euler, 'RK4': runge_kutta}
    outcomes = []
    for name in (*peers, *OURS):
        for dt in STEPS:
            feet = tripod_feet([FRICTION * WEIGHT / len(TRIPOD)] * len(TRIPOD))
            twist: Twist = (0.0, 0.0, KICK / radius)
            speeds = []
            for count in range(_COUNT):
                if name in peers:
                    twist = peers[name](twist, feet, dt)
                else:
                    twist = OURS[name](twist, MASS, INERTIA, feet, dt, twist)
                if count >= _COUNT - 20:
                    speeds += [math.hypot(*foot.slip(twist)) for foot in feet]
            value = sum(speeds) / len(speeds)
            law = None
            if name == 'explicit Euler':
                # Chatter from +s to -s and back has s/v = √((dt/limit)² - 1).
                over = dt / step_limits()['turning']
                law = SOFTENING * math.sqrt(over * over - 1.0) if over > 1.0 else 0.0
            outcomes.append(EXPLICIT.of(name, dt, value, law, value > KICK))
    return outcomes


# --- b: creep in MuJoCo --------------------------------------------------------------------------

CREEP = Case('creep in MuJoCo', 'step, s', 'creep, m/s')
NEEDS_MUJOCO = 'not measured, pip install "ros_pad[mujoco]"'
PUSH = 0.8  # force over the friction limit
CREEP_STEPS = (1e-4, 2.5e-4, 5e-4, 1e-3, 2e-3, 4e-3)
CREEP_LIMIT = 1e-4  # m/s
_TOUCH = 0.8  # coefficient of friction
# Settings by name: cone, impratio, iterations of noslip.
SETTINGS = {
    'pyramidal, impratio 1 (default)': ('pyramidal', 1, 0),
    'elliptic, impratio 1': ('elliptic', 1, 0),
    'elliptic, impratio 10': ('elliptic', 10, 0),
    'elliptic, impratio 100': ('elliptic', 100, 0),
    'elliptic, impratio 10, noslip 5': ('elliptic', 10, 5),
}
_BLOCK = """
<mujoco>
  <option timestep="{dt!r}" cone="{cone}" impratio="{ratio}" noslip_iterations="{noslip}"
    tolerance="1e-12" gravity="0 0 -{gravity}"/>
  <worldbody>
    <geom type="plane" size="9 9 1" friction="{friction} 0 0"/>
    <body pos="0 0 0.02">
      <joint type="slide" axis="1 0 0"/>
      <joint type="slide" axis="0 1 0"/>
      <joint type="slide" axis="0 0 1"/>
      <geom type="sphere" size="0.02" mass="{mass}" friction="{friction} 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""


def creep_law(ratio: float) -> float:
    """Return the creep of a foot with MuJoCo's default softness, elliptic cone, m/s.

    Without acceleration, the creep v of a contact with force f follows from R f - b v = 0, with b
    = 2/(0.95 0.02 s) and R = (1/d - 1)/(m impratio), which do not depend on the step. The
    impedance d is taken at the depth at which the contact carries the weight, (1/d - 1) g = k d
    depth, k = 1/(0.95 0.02 s)².
    """
    time = 0.95 * 0.02

    def impedance(depth: float) -> float:
        share = min(depth / 1e-3, 1.0)
        bend = 2.0 * share * share if share < 0.5 else 1.0 - 2.0 * (1.0 - share) ** 2
        return 0.9 + 0.05 * bend

    def carries(depth: float) -> float:
        d = impedance(depth)
        return (1.0 / d - 1.0) * GRAVITY - d * depth / (time * time)

    d = impedance(brentq(carries, 0.0, 1e-2, xtol=1e-15))
    return (1.0 / d - 1.0) * PUSH * _TOUCH * GRAVITY * time / 2.0 / ratio


def mujoco_creep(dt: float, cone: str, ratio: float, noslip: int) -> float:
    """Return the creep of a block in MuJoCo that is pushed below its friction limit, m/s."""
    import mujoco

    text = _BLOCK.format(
        dt=dt, cone=cone, ratio=ratio, noslip=noslip, gravity=GRAVITY, friction=_TOUCH, mass=MASS
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, round(0.5 / dt))
    data.qfrc_applied[0] = PUSH * _TOUCH * WEIGHT
    mujoco.mj_step(model, data, round(0.5 / dt))
    start = data.qpos[0]
    mujoco.mj_step(model, data, round(0.5 / dt))
    return float((data.qpos[0] - start) / (round(0.5 / dt) * dt))


def planar_creep(step: Step, dt: float) -> float:
    """Return the creep of such a block with a step of ros_pad, m/s.

    The push grows over 1 s, so that the pad hardly oscillates.
    """
    foot = Contact(STIFFNESS)
    foot.cap = _TOUCH * WEIGHT
    twist, x, path = STILL, 0.0, [0.0]
    for count in range(1, round(3.0 / dt) + 1):
        grown = 0.5 - 0.5 * math.cos(math.pi * min(1.0, count * dt))
        push = grown * PUSH * foot.cap
        free = (twist[0] + push / MASS * dt, 0.0, 0.0)
        twist = step(free, MASS, INERTIA, [foot], dt, twist)
        x += twist[0] * dt
        path.append(x)
    # A small oscillation remains; the creep is the slope of the line through the path.
    late = np.array(path[round(1.0 / dt) :])
    return float(np.polyfit(dt * np.arange(len(late)), late, 1)[0])


def creep() -> list[Outcome]:
    """Push a block with 0.8 of its friction limit, in MuJoCo and with the steps of ros_pad."""
    outcomes = []
    for name in (*SETTINGS, *OURS):
        law = None
        if name in SETTINGS:
            cone, ratio, noslip = SETTINGS[name]
            if cone == 'elliptic' and not noslip:
                law = creep_law(ratio)
        for dt in CREEP_STEPS:
            value = abs(
                planar_creep(OURS[name], dt) if name in OURS else mujoco_creep(dt, *SETTINGS[name])
            )
            outcomes.append(CREEP.of(name, dt, value, law, value > CREEP_LIMIT))
    return outcomes


# --- c: three sticking feet ----------------------------------------------------------------------

SPLIT = Case('three sticking feet', 'leg', 'force of a foot along the push, N')
SPLIT_PUSH = 0.3  # N, forward at the centre of mass: a twentieth of the caps
SPLIT_CAPS = (1.0, 2.0, 3.0)  # N
SPLIT_STIFFNESS = (3000.0, 2000.0, 1000.0)  # N/m
GAUSS_SEIDEL = 'Gauss-Seidel'


def balance(levers: Sequence[tuple[float, float]]) -> Array:
    """Return the (3, 2n) matrix that maps the feet's forces to their sum and moment."""
    return np.hstack([[[1.0, 0.0], [0.0, 1.0], [-y, x]] for x, y in levers])


def gauss_seidel(
    free: Twist,
    mass: float,
    inertia: float,
    contacts: Sequence[Contact],
    dt: float,
    sweeps: int = 10000,
) -> Twist:
    """Step with rigid feet: stop one after another, impulses up to c dt, until none changes."""
    vx, vy, omega = free
    impulses = [(0.0, 0.0)] * len(contacts)
    for _ in range(sweeps):
        change = 0.0
        for index, foot in enumerate(contacts):
            rx, ry = foot.lever_x, foot.lever_y
            xx, yy, xy = 1 / mass + ry * ry / inertia, 1 / mass + rx * rx / inertia, -rx * ry
            xy /= inertia
            sx, sy = foot.slip((vx, vy, omega))
            determinant = xx * yy - xy * xy
            px = impulses[index][0] - (yy * sx - xy * sy) / determinant
            py = impulses[index][1] - (xx * sy - xy * sx) / determinant
            size, limit = math.hypot(px, py), foot.cap * dt
            if size > limit:
                px, py = px * limit / size, py * limit / size
            dx, dy = px - impulses[index][0], py - impulses[index][1]
            impulses[index] = (px, py)
            vx += dx / mass
            vy += dy / mass
            omega += (rx * dy - ry * dx) / inertia
            change = max(change, abs(dx), abs(dy))
        if change < 1e-14:
            break
    for foot, (px, py) in zip(contacts, impulses, strict=True):
        foot.force_x, foot.force_y = px / dt, py / dt
    return vx, vy, omega


def split_law(method: str) -> Array:
    """Return the (3, 2) forces with the least Σ|f|²/w, N; w is stiffness, cap, or 1."""
    weights = {'elastic': SPLIT_STIFFNESS, 'creeping': SPLIT_CAPS}.get(method, (1.0, 1.0, 1.0))
    spread = np.repeat(weights, 2)
    matrix = balance(TRIPOD)
    forces = spread * (
        matrix.T @ np.linalg.solve(matrix * spread @ matrix.T, (-SPLIT_PUSH, 0.0, 0.0))
    )
    return np.asarray(forces).reshape(3, 2)


def held(name: str, order: Sequence[int], dt: float = 0.02) -> tuple[Twist, Array]:
    """Return twist and (3, 2) forces of the feet after the push has been held for 4 s."""
    feet = tripod_feet(SPLIT_CAPS, SPLIT_STIFFNESS)
    sorted_feet = [feet[index] for index in order]
    twist = STILL
    for _ in range(200):
        free = (twist[0] + SPLIT_PUSH / MASS * dt, twist[1], twist[2])
        if name == GAUSS_SEIDEL:
            twist = gauss_seidel(free, MASS, INERTIA, sorted_feet, dt)
        else:
            twist = OURS[name](free, MASS, INERTIA, sorted_feet, dt, twist)
    return twist, np.array([(foot.force_x, foot.force_y) for foot in feet])


def sticking_feet() -> list[Outcome]:
    """Push a standing robot; each method gets the three feet in all six orders."""
    outcomes = []
    for name in (GAUSS_SEIDEL, *OURS):
        forces = {order: held(name, order)[1] for order in itertools.permutations(range(3))}
        mean = np.mean(list(forces.values()), axis=0)
        laws = -split_law(name)[:, 0] if name in OURS else (None, None, None)
        for force in forces.values():
            fails = bool(np.abs(force - mean).max() > 0.01 * SPLIT_PUSH)
            outcomes += [
                SPLIT.of(name, leg, float(-along), law, fails)
                for leg, along, law in zip(LEGS, force[:, 0], laws, strict=True)
            ]
    return outcomes


# --- d: all feet slip ----------------------------------------------------------------------------

SLIPPING = Case('all feet slip', 'contraction of the fixed point', 'error of the twist, m/s')
SLIPS = 100  # random steps
SETTLED = 1e-6  # m/s
MOST_ITERATIONS = 100
_CREEP = 1e-6  # m/s: creep speed ε of the friction in Newton's method


@dataclass(frozen=True)
class Slide:
    """A step in which every foot slips.

    Attributes
    ----------
    free : Twist
        Velocity after the step without forces of the feet.
    feet : list of Contact
    dt : float
        Length of the step, s.
    truth : Twist
        Exact velocity after the step.
    start : Twist
        Start value of the iteration, far from the truth.
    contraction : float
        Spectral radius of the fixed-point iteration near the truth.
    """

    free: Twist
    feet: list[Contact]
    dt: float
    truth: Twist
    start: Twist
    contraction: float


def slides(count: int, seed: int = 0) -> list[Slide]:
    """Return random steps in which every foot slips at 3 mm/s or more.

    The pads are so stiff that they reach their caps within a step.
    """
    rng = random.Random(seed)
    found: list[Slide] = []
    while len(found) < count:
        dt, speed = 10.0 ** rng.uniform(-3.5, -1.5), 10.0 ** rng.uniform(-2.0, -0.5)
        caps = [rng.uniform(0.1, 0.8) * WEIGHT / 3.0 for _ in TRIPOD]
        feet = tripod_feet(caps, [1e5 / dt] * 3)
        for foot in feet:
            foot.motion_x, foot.motion_y = speed * rng.uniform(-1, 1), speed * rng.uniform(-1, 1)
        free = (speed * rng.uniform(-1, 1), speed * rng.uniform(-1, 1), rng.uniform(-1.0, 1.0))
        truth = exact_stick(free, MASS, INERTIA, feet, dt)
        if min(math.hypot(*foot.slip(truth)) for foot in feet) < 0.003:
            continue
        start = (rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), rng.uniform(-5.0, 5.0))
        found.append(Slide(free, feet, dt, truth, start, contraction(truth, feet, dt)))
    return found


def contraction(twist: Twist, feet: Sequence[Contact], dt: float) -> float:
    """Return the factor of an error in one fixed-point iteration of the forces; < 1 converges.

    It is the spectral radius of dt M⁻¹ Σ Bᵀ (c/|s|)(1 - ŝŝᵀ) B: the slower a foot slips, the more
    the direction of its force changes.
    """
    turned = np.zeros((3, 3))
    for foot in feet:
        slip = np.array(foot.slip(twist))
        size = float(np.hypot(*slip))
        arm = np.array([[1.0, 0.0, -foot.lever_y], [0.0, 1.0, foot.lever_x]])
        across = np.eye(2) - np.outer(slip, slip) / size**2
        turned += arm.T @ (foot.cap / size * across) @ arm
    return float(np.abs(np.linalg.eigvals(dt * turned / [[MASS], [MASS], [INERTIA]])).max())


def fixed_point(slide: Slide) -> Twist:
    """Return the twist after 100 iterations, each with the forces at the last twist."""
    twist = slide.start
    for _ in range(MOST_ITERATIONS):
        fx = fy = moment = 0.0
        for foot in slide.feet:
            sx, sy = foot.slip(twist)
            gain = -foot.cap / max(math.hypot(sx, sy), 1e-12)
            fx += gain * sx
            fy += gain * sy
            moment += gain * (foot.lever_x * sy - foot.lever_y * sx)
        twist = _ahead(slide.free, (fx / MASS, fy / MASS, moment / INERTIA), slide.dt)
    return twist


def full_newton(slide: Slide) -> Twist:
    """Return the twist after up to 100 full Newton steps with friction c s/√(s² + ε²)."""
    masses = np.diag([MASS, MASS, INERTIA])
    twist, free = np.array(slide.start), np.array(slide.free)
    for _ in range(MOST_ITERATIONS):
        residual, slope = masses @ (twist - free), masses.copy()
        for foot in slide.feet:
            arm = np.array([[1.0, 0.0, -foot.lever_y], [0.0, 1.0, foot.lever_x]])
            slip = arm @ twist + (foot.motion_x, foot.motion_y)
            size = math.sqrt(slip @ slip + _CREEP * _CREEP)
            residual += slide.dt * foot.cap / size * arm.T @ slip
            bent = np.eye(2) - np.outer(slip, slip) / size**2
            slope += slide.dt * foot.cap / size * arm.T @ bent @ arm
        step = np.linalg.solve(slope, residual)
        twist = twist - step
        if not np.abs(twist).max() < 1e6:
            break
    return float(twist[0]), float(twist[1]), float(twist[2])


def miss(one: Twist, other: Twist) -> float:
    """Return the distance of two twists, √(v² + ω² I/m) of their difference, m/s."""
    dx, dy, turn = (a - b for a, b in zip(one, other, strict=True))
    return math.sqrt(dx * dx + dy * dy + turn * turn * INERTIA / MASS)


def slipping_feet() -> list[Outcome]:
    """Solve random steps from a bad start; the truth is rigid friction to 1e-8 m/s."""
    outcomes = []
    for slide in slides(SLIPS):
        for name in ('fixed point', 'Newton, full steps', 'elastic', 'creeping'):
            if name in OURS:
                for foot in slide.feet:
                    foot.shear_x = foot.shear_y = 0.0
                step = elastic if name == 'elastic' else partial(creeping, creep=_CREEP)
                twist = step(slide.free, MASS, INERTIA, slide.feet, slide.dt, slide.start)
            else:
                twist = fixed_point(slide) if name == 'fixed point' else full_newton(slide)
            value = miss(twist, slide.truth)
            known = value if value < math.inf else None
            outcomes.append(SLIPPING.of(name, slide.contraction, known, None, not value < SETTLED))
    return outcomes


# --- e: a foot would have to pull ----------------------------------------------------------------

PULLING = Case(
    'a foot would have to pull',
    'pressure point beyond the edge, m',
    'weight, or moment over its arm, that is made up, shares of the weight',
)
FALLING = Case('top-heavy walk', 'height of the centre of mass, m', 'time of the verdict, s')
VERDICT = 'verdict of PlanarRobot'
OFFSETS = tuple(float(x) for x in np.linspace(-0.06, 0.06, 25))  # m beyond the edge
HEIGHTS = (0.12, 0.6, 0.85, 0.9, 0.95, 1.0)  # height of the centre of mass, m


def least_norm(feet: Sequence[tuple[float, float]], x: float, y: float) -> Array:
    """Return the loads with the least Σ N² that carry a weight of 1 at a point."""
    places = np.array(feet)
    matrix = np.vstack([np.ones(len(places)), places.T])
    return np.asarray(np.linalg.pinv(matrix) @ (1.0, x, y))


def pulling_feet() -> list[Outcome]:
    """Move the pressure point forward across the edge of a tripod, and walk a top-heavy robot."""
    # Feet 1 and 5 make the front edge; foot 3 is the one that would have to pull.
    front, side = np.array(TRIPOD[0]), np.array(TRIPOD[2])
    along = (side - front) / np.linalg.norm(side - front)
    out = np.array([-along[1], along[0]])
    out *= np.sign(out[0])
    middle = 0.5 * (front + side)
    depth = float((middle - np.array(TRIPOD[1])) @ out)
    outcomes = []
    for beyond in OFFSETS:
        loads = least_norm(TRIPOD, *(middle + beyond * out))
        clamped = np.maximum(loads, 0.0)
        scaled = clamped / clamped.sum()
        left = float((middle + beyond * out - scaled @ np.array(TRIPOD)) @ out)
        # The foot that would pull with this share of the weight is left out by the plain methods.
        law = max(beyond, 0.0) / depth
        for name, value in (
            ('clamped', float(clamped.sum()) - 1.0),
            ('clamped, scaled to the weight', left / depth),
        ):
            outcomes.append(PULLING.of(name, beyond, value, law, abs(value) > 1e-9))
    for height in HEIGHTS:
        expected, fell = tip_over_law(height), walk_top_heavy(height)[0]
        fails = (fell is None) != (expected is None)
        outcomes.append(FALLING.of(VERDICT, height, fell, expected, fails))
    return outcomes


def walk_top_heavy(height: float) -> tuple[float | None, str | None]:
    """Walk a gait cycle on dry ground with the centre of mass at a height, m.

    Return time, s, and text of the verdict; None and None without a verdict. The pads are stiff,
    because on soft ones the body lags behind the gait and falls 10 ms later.
    """
    body = dataclasses.replace(BODY, height=height)
    foot = dataclasses.replace(_SCENE.foot, shear_stiffness=1e6)
    scene = dataclasses.replace(_SCENE, body=body, foot=foot, tow=Tow(), settle=0.0)
    robot = PlanarRobot(scene, scene.floor.build(0), 1e-3)
    while robot.time < scene.gait.cycle:
        robot.step([0.0] * len(robot.legs))
        if robot.verdict:
            return robot.time, robot.verdict
    return None, None


def tip_over_law(height: float) -> float | None:
    """Return when the pressure point leaves the feet in a walk without slip, s; None if never.

    The point is behind the centre of mass by height times acceleration over gravity. Only times at
    which just one tripod stands are used.
    """
    gait = _SCENE.gait
    assert isinstance(gait, WalkingGait)
    for count in range(1, 1001):
        time = count * gait.cycle / 1000
        standing = [leg for leg in range(6) if gait.phase(leg, time) < gait.duty]
        if len(standing) > 3:
            continue
        places = []
        for leg in standing:
            since = gait.phase(leg, time) * gait.cycle
            moved = gait.body_advance(time) - gait.body_advance(time - since)
            x, y = BODY.homes[leg]
            places.append((x + gait.reach() - moved, y))
        speed = gait.peak_acceleration * math.sin(4.0 * math.pi * time / gait.cycle)
        if least_norm(places, -height * speed / GRAVITY, 0.0).min() < 0.0:
            return time
    return None


# --- f: a hose near equal pressures --------------------------------------------------------------

HOSE = Case('pad filled through a hose', 'step, s', 'pressure off the set-point, Pa')
FILL = 75e3  # Pa
FILL_STEPS = tuple(float(dt) for dt in np.geomspace(1e-5, 0.02, 12))
_LINE = Hose(4e-3, 1.0)
_VOLUME = _SCENE.foot.air_volume(0.0)
_FILL_TIME = 0.5  # s: the pad is full long before
_QUIET = 1.0  # Pa: larger distances from the set-point count as failures
ISO, ISO_LINEAR = 'explicit Euler, ISO 6358', 'explicit Euler, ISO 6358 with linear range'
CHANNEL = 'PneumaticChannel'
FULL = Case('pad kept full, with error control', 'time simulated, s', 'calls of the flow')
SOLVERS = ('RK45', 'LSODA', 'Radau', 'BDF')
TIMES = (0.1, 0.2, 0.3)  # s
MANY = 1000  # calls
MOST_CALLS = 120_000
_REGULATOR = RegulatorModel(natural_frequency=1000.0, damping=1.0, dead_time=0.0, dead_band=0.0)
_CAPACITY = REFERENCE_DENSITY * (_VOLUME + _LINE.volume) / REFERENCE_PRESSURE  # kg/Pa


def iso_flow(first: float, second: float) -> float:
    """Return the mass flow of ISO 6358 without a linear range, kg/s (absolute Pa)."""
    up, down = max(first, second), min(first, second)
    x = max(0.0, (down / up - _LINE.critical_ratio) / (1.0 - _LINE.critical_ratio))
    flow = _LINE.sonic_conductance * REFERENCE_DENSITY * up * math.sqrt(max(0.0, 1.0 - x * x))
    return math.copysign(flow, first - second)


def linear_flow(first: float, second: float) -> float:
    """Return the mass flow of ISO 6358 with its linear range, kg/s (absolute Pa).

    The flow of :class:`Hose` is smaller near equal pressures, where it is limited to Poiseuille's
    flow.
    """
    sonic, critical = _LINE.sonic_conductance, _LINE.critical_ratio
    return conductance(sonic, critical, first, second) * (first - second)


def _flow_slope() -> float:
    """Return A of dp/dt = A √|Δp| near equal pressures, √Pa/s."""
    up = FILL + ATMOSPHERE
    return (
        _LINE.sonic_conductance * REFERENCE_DENSITY * up / _CAPACITY
        * math.sqrt(2.0 / ((1.0 - _LINE.critical_ratio) * up))
    )  # fmt: skip


def linear_limit() -> float:
    """Return the longest stable step of explicit Euler with ISO's linear range, s: 2/rate."""
    supply = FILL + ATMOSPHERE
    rate = conductance(_LINE.sonic_conductance, _LINE.critical_ratio, supply, supply) / _CAPACITY
    return 2.0 / rate


def fill_law(dt: float) -> float:
    """Return the chatter of explicit Euler without linear range, Pa: (A dt/2)², never zero.

    Where dp/dt = A √|Δp|, a step takes Δp to -Δp when A dt √Δp = 2 Δp.
    """
    return (0.5 * _flow_slope() * dt) ** 2


def filled(flow: Callable[[float, float], float], dt: float) -> float:
    """Return the largest distance from the supply's pressure in the last steps, Pa."""
    supply = FILL + ATMOSPHERE
    pressure, count = ATMOSPHERE, round(_FILL_TIME / dt)
    worst = 0.0
    for step in range(count):
        pressure = max(1.0, pressure + dt * flow(supply, pressure) / _CAPACITY)
        if step >= count - 10:
            worst = max(worst, abs(pressure - supply))
    return worst


def filled_by_channel(dt: float) -> float:
    """Return the largest distance from the set-point in the last steps of our channel, Pa.

    Its regulator has a negligible lag.
    """
    channel = PneumaticChannel(_REGULATOR, _LINE, _VOLUME)
    count = round(_FILL_TIME / dt)
    pressures = [channel.step(FILL, dt) for _ in range(count)]
    return max(abs(pressure - FILL) for pressure in pressures[-10:])


class _CountingHose(Hose):
    """A hose that counts the calls of its conductance."""

    calls = 0

    def conductance(self, first: float, second: float) -> float:
        type(self).calls += 1
        return super().conductance(first, second)


def channel_calls(duration: float) -> int:
    """Return how often our channel calls the conductance of its hose in a time, s."""
    _CountingHose.calls = 0
    channel = PneumaticChannel(_REGULATOR, _CountingHose(4e-3, 1.0), _VOLUME)
    channel.step(FILL, duration)
    return _CountingHose.calls


def adaptive_calls(method: str, duration: float) -> int | None:
    """Return how often solve_ivp, to 1e-6, calls the flow in a time, s.

    None for more than :data:`MOST_CALLS`, when it is stopped.
    """
    supply = FILL + ATMOSPHERE
    calls = 0

    def rates(_: float, pressure: Array) -> list[float]:
        nonlocal calls
        calls += 1
        if calls > MOST_CALLS:
            raise TimeoutError
        return [iso_flow(supply, float(pressure[0])) / _CAPACITY]

    with suppress(TimeoutError):
        solve_ivp(rates, (0.0, duration), [ATMOSPHERE], method, rtol=1e-6, atol=0.1)
    return calls if calls <= MOST_CALLS else None


def filling() -> list[Outcome]:
    """Fill a pad to 75 kPa; chatter is the distance of the full pad from this pressure."""
    methods: dict[str, Callable[[float], float]] = {
        ISO: partial(filled, iso_flow),
        ISO_LINEAR: partial(filled, linear_flow),
        CHANNEL: filled_by_channel,
    }
    outcomes = []
    for name, method in methods.items():
        for dt in FILL_STEPS:
            value = method(dt)
            # The law holds for small differences of pressure.
            law = fill_law(dt) if name == ISO and fill_law(dt) < 0.1 * FILL else None
            outcomes.append(HOSE.of(name, dt, value, law, value > _QUIET))
    for name in (*SOLVERS, CHANNEL):
        for time in TIMES:
            calls = channel_calls(time) if name == CHANNEL else adaptive_calls(name, time)
            label = name if name == CHANNEL else f'solve_ivp ({name})'
            outcomes.append(FULL.of(label, time, calls, None, calls is None or calls > MANY))
    return outcomes


# --- g: the threshold of the rail leg ------------------------------------------------------------

THRESHOLD = Case(
    'threshold of the rail leg',
    'cap over drag',
    'change of the distance for one per cent of friction, %',
)
RAIL = 'RailLeg'
RATIOS = (1.03, 1.06, 1.1, 1.17, 1.3, 1.47, 2.0, 3.0, 5.0)  # cap over drag
RAIL_STEPS = (4e-3, 1e-3)
_RAIL_CYCLES = 4
ILL = 3.0  # change of the distance for one per cent of friction, %


def rail_distance(ratio: float, dt: float) -> float:
    """Return the distance of a rail leg of 1 kg with a given ratio of cap to drag, m."""
    scene = Scene.load('leg_dry_flat')
    assert isinstance(scene.body, RailBody)
    body = dataclasses.replace(scene.body, mass=1.0, rolling_drag=0.23)
    foot = dataclasses.replace(
        scene.foot, friction=ratio * body.rolling_drag / body.load, shear_strength=0.0
    )
    scene = dataclasses.replace(scene, body=body, foot=foot, settle=0.0)
    leg = RailLeg(scene, scene.floor.build(0), dt)
    for _ in range(round(_RAIL_CYCLES * scene.gait.cycle / dt)):
        leg.step([0.0])
    return leg.body[0]


def condition(ratio: float, dt: float) -> float:
    """Return d ln distance / d ln friction of a rail leg with a ratio of cap to drag."""
    low, high = rail_distance(0.995 * ratio, dt), rail_distance(1.005 * ratio, dt)
    return math.log(high / low) / math.log(1.005 / 0.995)


def threshold() -> list[Outcome]:
    """Change the friction of a rail leg by one per cent; a shorter step has the same effect.

    While the foot slips, the body accelerates in proportion to cap c less drag F, so the law for
    small c - F is c/(c - F).
    """
    outcomes = []
    for dt in RAIL_STEPS:
        for ratio in RATIOS:
            value = condition(ratio, dt)
            law = ratio / (ratio - 1.0) if ratio <= 1.5 else None
            method = f'{RAIL}, step {1e3 * dt:g} ms'
            outcomes.append(THRESHOLD.of(method, ratio, value, law, value > ILL))
    return outcomes


CASES: tuple[Callable[[], list[Outcome]], ...] = (
    explicit_friction,
    creep,
    sticking_feet,
    slipping_feet,
    pulling_feet,
    filling,
    threshold,
)
