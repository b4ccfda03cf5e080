# SPDX-License-Identifier: Apache-2.0
"""Find inputs at which simulations of a walking robot fail, with other methods and with ours.

In each of four cases, other methods and those of ros_pad get the same inputs. A number measures
the failure, and a law predicts at which inputs and by how much a method must fail.
"""

from __future__ import annotations

import dataclasses
import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.optimize import brentq

from ros_pad.contact.meniscus import GRAVITY
from ros_pad.pace import Progress
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
from ros_pad.simulation.scene import LeggedBody, RailBody, Scene
from studies import command
from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PALE, PAPER_STYLE, PURPLE, VERMILION
from studies.work_precision.friction import Contact, Twist, elastic, exact_stick

# The hexapod of the shipped scenes, standing on one of its tripods.
_SCENE = Scene.load('hexapod_smooth_dry_flat')
assert isinstance(_SCENE.body, LeggedBody)
BODY: LeggedBody = _SCENE.body
MASS, INERTIA, WEIGHT = BODY.mass, BODY.inertia, BODY.mass * GRAVITY
MASSES = np.diag([MASS, MASS, INERTIA])
TRIPOD = tuple(BODY.homes[leg - 1] for leg in (1, 3, 5))
STIFFNESS = _SCENE.foot.shear_stiffness


@dataclass(frozen=True)
class Outcome:
    """Result of a method for one input of a case.

    Attributes
    ----------
    case, method : str
    ours : bool
        Whether the method belongs to ros_pad.
    input, measure : str
        Name and unit of the varied quantity, and of the measure of failure.
    at : float
        Value of the varied quantity.
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


def measure(progress: Progress) -> list[Outcome]:
    """Return the outcomes of all cases; report progress, 0 to 1, to ``progress``."""
    outcomes: list[Outcome] = []
    for number, case in enumerate((creep, slipping_feet, filling, threshold)):
        progress(number / 4)
        outcomes += case()
    progress(1.0)
    return outcomes


def table(outcomes: Sequence[Outcome]) -> str:
    """Return the outcomes as text, a line for each case and method."""
    rows = []
    for name in dict.fromkeys(outcome.case for outcome in outcomes):
        for method, part in _methods([row for row in outcomes if row.case == name]).items():
            rows.append({
                'case': f'{name}, {part[0].input}: {part[0].measure}',
                'method': method,
                'inputs': len(part),
                'failures': sum(row.fails for row in part),
                'first at': min((row.at for row in part if row.fails), default=None),
                'worst value': max((row.value or 0.0 for row in part), default=None),
            })  # fmt: skip
    return command.listed(rows)


def _methods(case: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    return {
        name: [outcome for outcome in case if outcome.method == name]
        for name in dict.fromkeys(outcome.method for outcome in case)
    }


def tripod_feet(caps: Sequence[float], stiffness: float) -> list[Contact]:
    """Return the feet of the tripod on level ground, with caps, N, and a stiffness, N/m."""
    return [
        Contact(stiffness, cap=cap, lever_x=x, lever_y=y)
        for (x, y), cap in zip(TRIPOD, caps, strict=True)
    ]


# --- a: creep in MuJoCo --------------------------------------------------------------------------

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
    steps = round(0.5 / dt)
    mujoco.mj_step(model, data, steps)
    data.qfrc_applied[0] = PUSH * _TOUCH * WEIGHT
    mujoco.mj_step(model, data, steps)
    start = data.qpos[0]
    mujoco.mj_step(model, data, steps)
    return float((data.qpos[0] - start) / (steps * dt))


def planar_creep(dt: float) -> float:
    """Return the creep of such a block with the step of ros_pad, m/s.

    The push grows over 1 s, so that the pad hardly oscillates; the creep is the slope of the line
    through the path after it.
    """
    foot = Contact(STIFFNESS, cap=_TOUCH * WEIGHT)
    twist, x, path = (0.0, 0.0, 0.0), 0.0, [0.0]
    for count in range(1, round(3.0 / dt) + 1):
        push = (0.5 - 0.5 * math.cos(math.pi * min(1.0, count * dt))) * PUSH * foot.cap
        free = (twist[0] + push / MASS * dt, 0.0, 0.0)
        twist = elastic(free, MASS, INERTIA, [foot], dt, twist)
        x += twist[0] * dt
        path.append(x)
    late = np.array(path[round(1.0 / dt) :])
    return float(np.polyfit(dt * np.arange(len(late)), late, 1)[0])


def creep() -> list[Outcome]:
    """Push a block with 0.8 of its friction limit, in MuJoCo and with the step of ros_pad."""
    outcomes = []
    for name in (*SETTINGS, 'elastic'):
        cone, ratio, noslip = SETTINGS.get(name, ('', 0, 0))
        law = creep_law(ratio) if cone == 'elliptic' and not noslip else None
        for dt in CREEP_STEPS:
            value = abs(mujoco_creep(dt, cone, ratio, noslip) if cone else planar_creep(dt))
            fails = value > CREEP_LIMIT
            outcomes.append(
                Outcome('creep in MuJoCo', name, not cone, 'step, s', dt, 'creep, m/s', value, law,
                        fails)
            )  # fmt: skip
    return outcomes


# --- b: all feet slip ----------------------------------------------------------------------------

SETTLED = 1e-6  # m/s
MOST_ITERATIONS = 100


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
        feet = tripod_feet(caps, 1e5 / dt)
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
        slip, arm = np.array(foot.slip(twist)), foot.arm()[:2]
        size = float(np.hypot(*slip))
        turned += arm.T @ (foot.cap / size * (np.eye(2) - np.outer(slip, slip) / size**2)) @ arm
    return float(np.abs(np.linalg.eigvals(np.linalg.solve(MASSES, dt * turned))).max())


def fixed_point(slide: Slide) -> Twist:
    """Return the twist after 100 iterations, each with the forces at the last twist."""
    twist = np.array(slide.start)
    for _ in range(MOST_ITERATIONS):
        wrench = np.zeros(3)
        for foot in slide.feet:
            slip = np.array(foot.slip((twist[0], twist[1], twist[2])))
            wrench -= foot.cap / max(math.hypot(*slip), 1e-12) * slip @ foot.arm()[:2]
        twist = slide.free + slide.dt * np.linalg.solve(MASSES, wrench)
    return float(twist[0]), float(twist[1]), float(twist[2])


def full_newton(slide: Slide, creep: float = 1e-6) -> Twist:
    """Return the twist after up to 100 full Newton steps with friction c s/√(s² + creep²)."""
    twist, free = np.array(slide.start), np.array(slide.free)
    for _ in range(MOST_ITERATIONS):
        residual, slope = MASSES @ (twist - free), MASSES.copy()
        for foot in slide.feet:
            arm = foot.arm()[:2]
            slip = arm @ twist + (foot.motion_x, foot.motion_y)
            size = math.sqrt(slip @ slip + creep * creep)
            residual += slide.dt * foot.cap / size * arm.T @ slip
            bent = np.eye(2) - np.outer(slip, slip) / size**2
            slope += slide.dt * foot.cap / size * arm.T @ bent @ arm
        twist = twist - np.linalg.solve(slope, residual)
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
    for slide in slides(100):
        twists = {
            'fixed point': fixed_point(slide),
            'Newton, full steps': full_newton(slide),
            'elastic': elastic(slide.free, MASS, INERTIA, slide.feet, slide.dt, slide.start),
        }
        for name, twist in twists.items():
            value = miss(twist, slide.truth)
            outcomes.append(
                Outcome('all feet slip', name, name == 'elastic',
                        'contraction of the fixed point', slide.contraction,
                        'error of the twist, m/s', value if value < math.inf else None, None,
                        not value < SETTLED)
            )  # fmt: skip
    return outcomes


# --- c: a hose near equal pressures --------------------------------------------------------------

FILL = 75e3  # Pa
FILL_STEPS = tuple(float(dt) for dt in np.geomspace(1e-5, 0.02, 12))
_LINE = Hose(4e-3, 1.0)
_VOLUME = _SCENE.foot.air_volume(0.0)
_FILL_TIME = 0.5  # s: the pad is full long before
_QUIET = 1.0  # Pa: larger distances from the set-point count as failures
ISO, ISO_LINEAR = 'explicit Euler, ISO 6358', 'explicit Euler, ISO 6358 with linear range'
CHANNEL = 'PneumaticChannel'
_REGULATOR = RegulatorModel(natural_frequency=1000.0, damping=1.0, dead_time=0.0, dead_band=0.0)
_CAPACITY = REFERENCE_DENSITY * (_VOLUME + _LINE.volume) / REFERENCE_PRESSURE  # kg/Pa
_SUPPLY = FILL + ATMOSPHERE


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


def fill_law(dt: float) -> float:
    """Return the chatter of explicit Euler without linear range, Pa: (A dt/2)², never zero.

    Where dp/dt = A √|Δp|, a step takes Δp to -Δp when A dt √Δp = 2 Δp.
    """
    bend = math.sqrt(2.0 / ((1.0 - _LINE.critical_ratio) * _SUPPLY))
    slope = _LINE.sonic_conductance * REFERENCE_DENSITY * _SUPPLY / _CAPACITY * bend
    return (0.5 * slope * dt) ** 2


def filled(flow: Callable[[float, float], float], dt: float) -> float:
    """Return the largest distance from the supply's pressure in the last steps, Pa."""
    pressure, path = ATMOSPHERE, []
    for _ in range(round(_FILL_TIME / dt)):
        pressure = max(1.0, pressure + dt * flow(_SUPPLY, pressure) / _CAPACITY)
        path.append(abs(pressure - _SUPPLY))
    return max(path[-10:])


def filled_by_channel(dt: float) -> float:
    """Return the same of our channel, whose regulator has a negligible lag."""
    channel = PneumaticChannel(_REGULATOR, _LINE, _VOLUME)
    return max([abs(channel.step(FILL, dt) - FILL) for _ in range(round(_FILL_TIME / dt))][-10:])


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
            outcomes.append(
                Outcome('pad filled through a hose', name, name == CHANNEL, 'step, s', dt,
                        'pressure off the set-point, Pa', value, law, value > _QUIET)
            )  # fmt: skip
    return outcomes


# --- d: the threshold of the rail leg ------------------------------------------------------------

RATIOS = (1.03, 1.06, 1.1, 1.17, 1.3, 1.47, 2.0, 3.0, 5.0)  # cap over drag
RAIL_STEPS = (4e-3, 1e-3)
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
    for _ in range(round(4 * scene.gait.cycle / dt)):
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
            outcomes.append(
                Outcome('threshold of the rail leg', f'RailLeg, step {1e3 * dt:g} ms', True,
                        'cap over drag', ratio,
                        'change of the distance for one per cent of friction, %', value, law,
                        value > ILL)
            )  # fmt: skip
    return outcomes


# --- picture -------------------------------------------------------------------------------------

_OTHERS = ((VERMILION, 'o'), (ORANGE, 's'), (PURPLE, 'D'), (BLUE, '^'), (PALE, 'v'))
_LAW: dict[str, Any] = {'color': BLACK, 'lw': 0.9, 'zorder': 1.5}


def figures(outcomes: list[Outcome], progress: Progress | None = None) -> dict[str, Figure]:
    """Return the picture, by name: a panel for each case; green is ours, black the law."""
    # Case, factors of input and value, least value drawn, and what the axes are called.
    panels: tuple[tuple[str, float, float, float, dict[str, Any]], ...] = (
        ('creep in MuJoCo', 1e3, 1e3, 1e-5,
         {'xlabel': 'step, ms', 'ylabel': 'creep at 0.8 of the limit, mm/s'}),
        ('all feet slip', 1.0, 1.0, 1e-11,
         {'xlabel': 'growth of an error by the fixed point', 'ylabel': 'error of the twist, m/s',
          'ylim': (1e-11, 3.0)}),
        ('pad filled through a hose', 1e3, 1.0, 1e-3,
         {'xlabel': 'step, ms', 'ylabel': 'chatter of the pressure, Pa'}),
        ('threshold of the rail leg', 1.0, 1.0, 1e-3,
         {'xlabel': 'cap over drag', 'ylabel': 'distance for 1 % of friction, %'}),
    )  # fmt: skip
    limits = {'creep in MuJoCo': 1e3 * CREEP_LIMIT, 'threshold of the rail leg': ILL}
    with matplotlib.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(11.0, 7.5), layout='constrained')
        for letter, panel, (name, across, up, floor, names) in zip(
            'abcd', figure.subplots(2, 2).ravel(), panels, strict=True
        ):
            case = [outcome for outcome in outcomes if outcome.case == name]
            _draw(panel, case, across, up, floor, lines='slip' not in name)
            panel.set(xscale='log', yscale='log', title=f'{letter}  {name}', **names)
            if name in limits:
                panel.axhline(limits[name], color=PALE, lw=0.9, ls='--', zorder=1)
            panel.legend(fontsize=7.5)
    return {'stability': figure}


def _draw(
    panel: Axes, case: Sequence[Outcome], across: float, up: float, floor: float, lines: bool
) -> None:
    looks = iter(_OTHERS)
    for name, part in _methods(case).items():
        colour, marker = (GREEN, '.') if part[0].ours else next(looks)
        x = [across * row.at for row in part]
        y = [np.nan if row.value is None else max(up * row.value, floor) for row in part]
        panel.plot(x, y, marker, color=colour, ms=4.0, ls='-' if lines else '', lw=0.9, label=name)
        law = [(across * row.at, up * row.law) for row in part if row.law and up * row.law > floor]
        if law:
            panel.plot(*zip(*law, strict=True), **_LAW)
