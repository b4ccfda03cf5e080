# SPDX-License-Identifier: Apache-2.0
"""Find inputs at which simulations of a walking robot fail, with other methods and with ours.

In each case other methods and those of ros_pad get the same inputs. A number measures the failure,
and a law predicts at which inputs and by how much a method must fail.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.optimize import brentq

from ros_pad.contact.meniscus import GRAVITY
from ros_pad.pace import Progress
from ros_pad.simulation.planar_step import newton
from ros_pad.simulation.rail_leg import RailLeg
from ros_pad.simulation.scene import LeggedBody, RailBody, Scene
from studies import command
from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PALE, PAPER_STYLE, PURPLE, VERMILION

# The hexapod of the shipped scenes.
_SCENE = Scene.load('hexapod_smooth_dry_flat')
assert isinstance(_SCENE.body, LeggedBody)
MASS, STIFFNESS = _SCENE.body.mass, _SCENE.foot.shear_stiffness


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
    for number, case in enumerate((creep, threshold)):
        progress(number / 2)
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
    data.qfrc_applied[0] = PUSH * _TOUCH * MASS * GRAVITY
    mujoco.mj_step(model, data, steps)
    start = data.qpos[0]
    mujoco.mj_step(model, data, steps)
    return float((data.qpos[0] - start) / (steps * dt))


def planar_creep(dt: float) -> float:
    """Return the creep of such a block with the step of ros_pad, m/s.

    The push grows over 1 s, so that the pad hardly oscillates; the creep is the slope of the line
    through the path after it.
    """
    cap, rate = _TOUCH * MASS * GRAVITY, STIFFNESS * dt
    speed, sheared, x, path = 0.0, 0.0, 0.0, [0.0]
    for count in range(1, round(3.0 / dt) + 1):
        push = (0.5 - 0.5 * math.cos(math.pi * min(1.0, count * dt))) * PUSH * cap
        free = (speed + push / MASS * dt, 0.0, 0.0)
        foot = (0.0, 0.0, sheared / dt, 0.0, 0.0, 0.0, cap, rate)
        speed, _, _, settled = newton(free, MASS, 1.0, [foot], dt, (speed, 0.0, 0.0))
        assert settled
        sheared += speed * dt  # it never slips
        x += speed * dt
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


# --- b: the threshold of the rail leg ------------------------------------------------------------

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
    # Case, factors of input and value, least value drawn, limit, and what the axes are called.
    panels = (
        ('creep in MuJoCo', 1e3, 1e3, 1e-5, 1e3 * CREEP_LIMIT,
         {'xlabel': 'step, ms', 'ylabel': 'creep at 0.8 of the limit, mm/s'}),
        ('threshold of the rail leg', 1.0, 1.0, 1e-3, ILL,
         {'xlabel': 'cap over drag', 'ylabel': 'distance for 1 % of friction, %'}),
    )  # fmt: skip
    with matplotlib.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(11.0, 3.9), layout='constrained')
        for letter, panel, (name, across, up, floor, limit, names) in zip(
            'ab', figure.subplots(1, 2), panels, strict=True
        ):
            case = [outcome for outcome in outcomes if outcome.case == name]
            _draw(panel, case, across, up, floor)
            panel.set(xscale='log', yscale='log', title=f'{letter}  {name}', **names)
            panel.axhline(limit, color=PALE, lw=0.9, ls='--', zorder=1)
            panel.legend(fontsize=7.5)
    return {'stability': figure}


def _draw(panel: Axes, case: Sequence[Outcome], across: float, up: float, floor: float) -> None:
    looks = iter(_OTHERS)
    for name, part in _methods(case).items():
        colour, marker = (GREEN, '.') if part[0].ours else next(looks)
        x = [across * row.at for row in part]
        y = [np.nan if row.value is None else max(up * row.value, floor) for row in part]
        panel.plot(x, y, marker, color=colour, ms=4.0, ls='-', lw=0.9, label=name)
        law = [(across * row.at, up * row.law) for row in part if row.law and up * row.law > floor]
        if law:
            panel.plot(*zip(*law, strict=True), **_LAW)
