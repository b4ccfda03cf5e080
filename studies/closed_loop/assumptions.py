# SPDX-License-Identifier: Apache-2.0
"""Measure what changes if an assumed number is wrong by a factor of two.

Walks ``hexapod_patches`` with each constant halved and doubled, under the policies adaptive, flat
and dome, and reports how the distance of the adaptive policy changes (mm a cycle), and how much
farther it still walks than the better of the two fixed morphologies. Writes assumptions.json and
.png.

Constants of the world (friction, floor, towed load, noise) change in the simulation alone:
estimator and controller keep the shipped values, as they would if these were wrong. Numbers that a
user can measure or choose (mass, pads, sole, gait, sensor rate) change for simulation, estimator
and controller alike. For probabilities, the odds are halved or doubled; for the pressure margin,
its excess over 1. Counts are rounded down to at least 1. The sole is scaled with its pads, the
body's inertia with its mass.
"""

from __future__ import annotations

import inspect
import math
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Any
from unittest import mock

from matplotlib.figure import Figure

from ros_pad.control import (
    MorphologyController,
    adaptive,
    first_morphologies,
    footprints,
    policy_named,
)
from ros_pad.estimation import Tuning, alarm, ground, track
from ros_pad.estimation.stage import EstimationStage
from ros_pad.pace import CONTROL_PERIOD_NS
from ros_pad.regulators.simulated import SimulatedRegulator
from ros_pad.simulation import Scene, soles
from ros_pad.simulation.scene import LeggedBody
from ros_pad.trials.loop import ClosedLoop
from studies import command
from studies.closed_loop import loops
from studies.machine import machine

SCENE = 'hexapod_patches'
LEVEL = 'L2'
CYCLES = 20
SEEDS = (0, 1, 2, 3)
FIXED = ('flat', 'dome')
SHIPPED = 'as shipped'
CONSTANTS = {
    'LOAD_GATE': track, 'SMOOTHING': alarm, 'SPEED_NOISE': alarm, 'RATIO_NOISE': ground,
    'WET_PRIOR': footprints, 'FADING_LENGTH': footprints, 'KEPT': footprints,
}  # fmt: skip
"""Constants of estimator and controller that are made wrong, with the modules that hold them."""


def defaults(function: Callable[..., Any], *names: str) -> dict[str, Any]:
    """Return the shipped defaults of a function's parameters."""
    parameters = inspect.signature(function).parameters
    return {name: parameters[name].default for name in names}


@dataclass(frozen=True)
class Setup:
    """The scene that is simulated, and the configuration of estimator and controller."""

    world: Scene
    configured: Scene
    tuning: Tuning = field(default_factory=Tuning)
    limit_error: float = 1.0  # factor on the force limit of the simulated pads
    load_error: float = 1.0  # factor on the load that estimator and controller expect
    loss: float = soles.LOSS
    constants: dict[str, float] = field(
        default_factory=lambda: {name: getattr(module, name) for name, module in CONSTANTS.items()}
    )
    controller: dict[str, Any] = field(
        default_factory=lambda: defaults(MorphologyController, 'margin', 'lift_off_share')
    )
    adaptive: dict[str, Any] = field(
        default_factory=lambda: defaults(
            adaptive, 'wet_above', 'dry_below', 'probe_below', 'dwell'
        )
    )
    control_period: float = CONTROL_PERIOD_NS * 1e-9


@dataclass(frozen=True)
class Assumption:
    """An assumed number.

    Attributes
    ----------
    where : str
        File and key that hold the number.
    path : str
        Dotted path in :class:`Setup`; ``both`` is for ``world`` and ``configured``.
    label, unit : str
        For the chart and the table.
    rule : str
        How the number is made wrong, see :func:`scaled`.
    """

    where: str
    path: str
    label: str
    unit: str
    rule: str = 'factor'

    @property
    def only_adaptive(self) -> bool:
        """Whether the number changes walks of the adaptive policy only."""
        return self.path.split('.')[0] in ('tuning', 'constants', 'adaptive', 'control_period')


FOOT = 'feet/large37.yaml: '
ROBOT = 'robots/ch3r.yaml: '
PATCHES = 'scenes/hexapod_patches.yaml: '
MODEL = 'regulators/simulated.py: SimulatedRegulator.'
TUNING = 'estimation/tuning.py: Tuning.'
CONTROL = 'control/morphology.py: MorphologyController.'
POLICY = 'control/policies.py: adaptive.'
PRINTS = 'control/footprints.py: '

# fmt: off
ASSUMPTIONS = (
    Assumption(FOOT + 'pads', 'both.foot.pads', 'pads', '', 'pads'),
    Assumption('contact/limits.py: force_limit', 'limit_error', 'force limit of a pad', ''),
    Assumption(FOOT + 'friction', 'world.foot.friction', 'foot friction', ''),
    Assumption(FOOT + 'shear_strength', 'world.foot.shear_strength', 'shear strength', 'Pa'),
    Assumption(FOOT + 'conforming_pressure',
               'world.foot.conforming_pressure', 'conforming pressure', 'Pa'),
    Assumption(FOOT + 'boundary_friction',
               'world.foot.boundary_friction', 'boundary friction', ''),
    Assumption(FOOT + 'critical_film', 'world.foot.critical_film', 'critical film', 'm'),
    Assumption(FOOT + 'film_exponent', 'world.foot.film_exponent', 'film exponent', ''),
    Assumption(FOOT + 'sole_thickness', 'world.foot.sole_thickness', 'thickness of the sole', 'm'),
    Assumption('simulation/soles.py: LOSS', 'loss', 'loss factor of a foot', ''),
    Assumption(FOOT + 'shear_stiffness', 'world.foot.shear_stiffness', 'shear stiffness', 'N/m'),
    Assumption(FOOT + 'chamber_volume', 'world.foot.chamber_volume', 'chamber volume', 'm3'),
    Assumption(ROBOT + 'mass', 'both.body.mass', 'robot mass', 'kg', 'mass'),
    Assumption(ROBOT + 'height', 'both.body.height', 'height of the mass', 'm'),
    Assumption(PATCHES + 'gait.cycle', 'both.gait.cycle', 'gait cycle', 's'),
    Assumption(PATCHES + 'gait.heading_gain', 'both.heading_gain', 'heading gain', '1/s'),
    Assumption(PATCHES + 'floor.wet_fraction',
               'world.floor.wet_fraction', 'share of wet', '', 'odds'),
    Assumption(PATCHES + 'floor.patch_length',
               'world.floor.patch_length', 'length of patches', 'm'),
    Assumption(PATCHES + 'floor.film_thickness',
               'world.floor.film_thickness', 'depth of liquid', 'm'),
    Assumption(PATCHES + 'floor.viscosity', 'world.floor.viscosity', 'viscosity', 'Pa s'),
    Assumption(PATCHES + 'tow.weight', 'world.tow.weight', 'towed weight', 'N'),
    Assumption(PATCHES + 'tow.friction_dry',
               'world.tow.friction_dry', 'friction of the tow, dry', ''),
    Assumption(PATCHES + 'tow.friction_wet',
               'world.tow.friction_wet', 'friction of the tow, wet', ''),
    Assumption(PATCHES + 'tow.distance', 'world.tow.distance', 'distance of the tow', 'm'),
    Assumption(PATCHES + 'tow.height', 'world.tow.height', 'height of the tow line', 'm'),
    Assumption('simulation/scene.py: Tow.stiffness',
               'world.tow.stiffness', 'stiffness of the tow', 'N/m'),
    Assumption(PATCHES + 'sensors.rate', 'both.sensors.rate', 'sensor rate', 'Hz'),
    Assumption(PATCHES + 'sensors.force_noise', 'world.sensors.force', 'force noise', 'N'),
    Assumption(PATCHES + 'sensors.position_noise',
               'world.sensors.position', 'position noise', 'm'),
    Assumption(PATCHES + 'regulator.hose_diameter',
               'world.regulator.hose_diameter', 'hose bore', 'm'),
    Assumption(PATCHES + 'regulator.hose_length',
               'world.regulator.hose_length', 'hose length', 'm'),
    Assumption(MODEL + 'natural_frequency',
               'world.regulator.natural_frequency', 'regulator frequency', 'rad/s'),
    Assumption(MODEL + 'damping', 'world.regulator.damping', 'regulator damping', ''),
    Assumption(MODEL + 'dead_time', 'world.regulator.dead_time', 'regulator dead time', 's'),
    Assumption(MODEL + 'dead_band', 'world.regulator.dead_band', 'regulator dead band', ''),
    Assumption(MODEL + 'quantum', 'world.regulator.quantum', 'regulator quantum', 'Pa'),
    Assumption('simulation/scene.py: Scene.expected_load', 'load_error', 'expected load', ''),
    Assumption('estimation/track.py: LOAD_GATE', 'constants.LOAD_GATE', 'load gate, estimator',
               ''),
    Assumption('estimation/alarm.py: SMOOTHING', 'constants.SMOOTHING', 'smoothing of speed', 's'),
    Assumption(TUNING + 'filter_period', 'tuning.filter_period', 'filter period', 's'),
    Assumption(TUNING + 'wet_prior', 'tuning.wet_prior', 'wet prior, estimator', '', 'odds'),
    Assumption(TUNING + 'patch_length', 'tuning.patch_length', 'patch length configured', 'm'),
    Assumption('estimation/ground.py: RATIO_NOISE',
               'constants.RATIO_NOISE', 'model error of T/N', ''),
    Assumption('estimation/alarm.py: SPEED_NOISE',
               'constants.SPEED_NOISE', 'model error of slip speed', 'm/s'),
    Assumption(TUNING + 'turning_rate', 'tuning.turning_rate', 'turning rate of feet', 'rad/s'),
    Assumption(CONTROL + 'margin', 'controller.margin', 'pressure margin', '', 'excess'),
    Assumption(CONTROL + 'lift_off_share',
               'controller.lift_off_share', 'load gate, controller', ''),
    Assumption(POLICY + 'wet_above', 'adaptive.wet_above', 'dome above', '', 'odds'),
    Assumption(POLICY + 'dry_below', 'adaptive.dry_below', 'flat below', '', 'odds'),
    Assumption(POLICY + 'probe_below', 'adaptive.probe_below', 'probe below', '', 'odds'),
    Assumption(POLICY + 'dwell', 'adaptive.dwell', 'dwell', 'steps', 'whole'),
    Assumption(PRINTS + 'WET_PRIOR', 'constants.WET_PRIOR', 'wet prior, footprints', '', 'odds'),
    Assumption(PRINTS + 'FADING_LENGTH', 'constants.FADING_LENGTH', 'fading of footprints', 'm'),
    Assumption(PRINTS + 'KEPT', 'constants.KEPT', 'footprints kept', '', 'whole'),
    Assumption('pace.py: CONTROL_PERIOD_NS', 'control_period', 'control period', 's'),
)
# fmt: on


def shipped() -> Setup:
    """Return the shipped scene with fewer gait cycles."""
    scene = replace(Scene.load(SCENE), cycles=CYCLES)
    # Write out options that the scene leaves to the regulator's defaults, so that they can be
    # changed.
    names = ('natural_frequency', 'damping', 'dead_time', 'dead_band', 'quantum')
    options = defaults(SimulatedRegulator, *names)
    scene = replace(scene, regulator=options | scene.regulator)
    return Setup(scene, scene)


def value_at(thing: Any, path: str) -> float:
    """Return the number at a dotted path through dataclasses and dictionaries."""
    for name in path.split('.'):
        thing = thing[name] if isinstance(thing, dict) else getattr(thing, name)
    return thing


def changed(thing: Any, path: str, value: Any) -> Any:
    """Return a copy with another value at a dotted path."""
    name, _, rest = path.partition('.')
    if rest:
        inner = thing[name] if isinstance(thing, dict) else getattr(thing, name)
        value = changed(inner, rest, value)
    return thing | {name: value} if isinstance(thing, dict) else replace(thing, **{name: value})


def scaled(value: float, factor: float, rule: str) -> float:
    """Return a number that is wrong by a factor.

    The factor multiplies the odds of a probability (rule ``odds``), the excess over 1 (``excess``)
    or the number itself (other rules). ``whole`` and ``pads`` are rounded down to at least 1.
    """
    if rule == 'odds':
        odds = factor * value / (1.0 - value)
        return odds / (1.0 + odds)
    if rule == 'excess':
        return 1.0 + factor * (value - 1.0)
    return max(1, int(factor * value)) if rule in ('whole', 'pads') else factor * value


def baseline(setup: Setup, assumption: Assumption) -> float:
    """Return the shipped value of an assumption."""
    return value_at(setup, assumption.path.replace('both.', 'world.'))


def wrong_by(setup: Setup, assumption: Assumption, factor: float) -> Setup:
    """Return a setup with one number wrong by a factor."""
    value = scaled(baseline(setup, assumption), factor, assumption.rule)
    place, _, rest = assumption.path.partition('.')
    part: Any = value
    if assumption.rule == 'pads':  # the area of the sole grows with the number of pads
        foot = setup.world.foot
        radius = foot.sole_radius * math.sqrt(value / foot.pads)
        rest, part = 'foot', replace(foot, pads=round(value), sole_radius=radius)
    if assumption.rule == 'mass':  # the inertia of a body with the same dimensions
        body = setup.world.body
        assert isinstance(body, LeggedBody)
        inertia = body.inertia * value / body.mass
        rest, part = 'body', replace(body, mass=value, inertia=inertia)
    if place == 'both':
        setup = changed(setup, f'configured.{rest}', part)
        return changed(setup, f'world.{rest}', part)
    return changed(setup, assumption.path, part)


def walk(setup: Setup, policy: str, seed: int) -> tuple[float, str | None]:
    """Return the distance a cycle, m, and the verdict, None if the walk is valid."""
    with ExitStack() as changes:
        for name, value in setup.constants.items():
            changes.enter_context(mock.patch.object(CONSTANTS[name], name, value))
        changes.enter_context(mock.patch.object(soles, 'LOSS', setup.loss))
        return _walk(setup, policy, seed)


def _walk(setup: Setup, policy: str, seed: int) -> tuple[float, str | None]:
    world, configured = setup.world, setup.configured
    if setup.limit_error != 1.0:
        # The table of force limits is scaled in a copy of the foot that only the simulation uses.
        foot = replace(world.foot)
        limits = tuple(setup.limit_error * limit for limit in foot.limits)
        object.__setattr__(foot, 'limits', limits)
        world = replace(world, foot=foot)
    loop = ClosedLoop(world, policy, seed, LEVEL)
    load = configured.expected_load * setup.load_error
    tuning = replace(
        setup.tuning,
        position_noise=configured.sensors.position,
        force_noise=configured.sensors.force,
    )
    period_ns = round(setup.control_period * 1e9)
    estimation = EstimationStage(configured.foot, load, tuning, configured.legs, period_ns)
    choose = policy_named(policy, loop.floor.wet)
    if policy == 'adaptive':
        choose = adaptive(**setup.adaptive)
    controller = MorphologyController(
        configured.foot,
        configured.legs,
        choose,
        load,
        start=first_morphologies(policy, configured.legs),
        fixed_pressure=configured.dome_pressure,
        **setup.controller,
    )
    loop.connect(controller, period_ns=period_ns)
    loop.pipeline = loop.pipeline._replace(estimation=estimation)
    loops.walk(loop)
    return loop.robot.body[0] / world.cycles, loop.robot.verdict


def setups() -> dict[str, Setup]:
    """Return every setup that is walked, by name."""
    setup = shipped()
    named = {SHIPPED: setup}
    for assumption in ASSUMPTIONS:
        for factor in (0.5, 2.0):
            named[f'{assumption.where} x {factor}'] = wrong_by(setup, assumption, factor)
    return named


def jobs() -> list[tuple[str, str, int]]:
    """Return setup, policy and seed of all walks.

    Fixed morphologies do not walk again where a number does not affect them.
    """
    wanted: list[tuple[str, tuple[str, ...]]] = [(SHIPPED, ('adaptive', *FIXED, 'oracle'))]
    for assumption in ASSUMPTIONS:
        policies = ('adaptive',) if assumption.only_adaptive else ('adaptive', *FIXED)
        wanted += [(f'{assumption.where} x {factor}', policies) for factor in (0.5, 2.0)]
    return [(name, p, seed) for name, policies in wanted for p in policies for seed in SEEDS]


def measure(processes: int) -> dict[str, Any]:
    """Walk everything and return the document that is saved."""
    started = time.perf_counter()
    todo, named = jobs(), setups()
    walks = [(named[name], policy, seed) for name, policy, seed in todo]
    walked = dict(
        zip(todo, command.in_processes(walk, walks, processes, 'assumptions'), strict=True)
    )

    def figures(name: str, fallback: dict[str, float] | None = None) -> dict[str, Any]:
        result: dict[str, Any] = {}
        verdicts = set()
        for policy in ('adaptive', *FIXED, 'oracle'):
            own = [walked[name, policy, s] for s in SEEDS if (name, policy, s) in walked]
            if own:
                result[f'{policy}_mm'] = round(
                    1e3 * sum(distance for distance, _ in own) / len(own), 2
                )
                verdicts |= {verdict.split(' at ')[0] for _, verdict in own if verdict}
            elif fallback and f'{policy}_mm' in fallback and policy in FIXED:
                result[f'{policy}_mm'] = fallback[f'{policy}_mm']
        best = max(result[f'{policy}_mm'] for policy in FIXED)
        result['gain_mm'] = round(result['adaptive_mm'] - best, 2)
        if verdicts:
            result['verdicts'] = sorted(verdicts)
        return result

    setup = shipped()
    base = figures(SHIPPED)
    rows = []
    for assumption in ASSUMPTIONS:
        value = baseline(setup, assumption)
        row: dict[str, Any] = {
            'where': assumption.where, 'label': assumption.label, 'unit': assumption.unit,
            'rule': assumption.rule, 'value': value,
        }  # fmt: skip
        for word, factor in (('halved', 0.5), ('doubled', 2.0)):
            part = figures(f'{assumption.where} x {factor}', base)
            part['value'] = scaled(value, factor, assumption.rule)
            for key in ('adaptive_mm', 'gain_mm'):
                part[f'{key}_change'] = round(part[key] - base[key], 2)
            row[word] = part
        rows.append(row)
    return {
        'scene': SCENE,
        'cycles': CYCLES,
        'seeds': list(SEEDS),
        'wall_s': round(time.perf_counter() - started, 1),
        'shipped': base,
        'assumptions': rows,
    }


def table(document: dict[str, Any]) -> str:
    """Return the rows as a table for docs/assumptions.md: distance and gain, mm a cycle."""
    lines = ['| number | ½ | 2× |', '|---|---|---|']
    for row in document['assumptions']:
        halves = [cell(row[word]) for word in ('halved', 'doubled')]
        lines.append(f'| `{row["where"]}` | {halves[0]} | {halves[1]} |')
    return '\n'.join(lines)


def cell(part: dict[str, Any]) -> str:
    """Return the changes of distance and gain, mm a cycle, as text."""
    return f'{part["adaptive_mm_change"]:+.1f} / {part["gain_mm_change"]:+.1f}'


def draw(document: dict[str, Any], least: float = 2.0) -> Figure:
    """Return a bar chart of the numbers that change a result by at least ``least`` mm a cycle."""
    keys = ('adaptive_mm_change', 'gain_mm_change')
    words = ('halved', 'doubled')

    def effect(row: dict[str, Any]) -> float:
        return max(abs(row[word][key]) for word in words for key in keys)

    rows = sorted((r for r in document['assumptions'] if effect(r) >= least), key=effect)
    quiet = sum(effect(row) < least for row in document['assumptions'])
    figure = Figure(figsize=(10.0, 1.9 + 0.27 * len(rows)), layout='constrained')
    axes = figure.subplots(1, 2, sharey=True)
    base = document['shipped']
    titles = (
        f'Distance of the adaptive policy\n(shipped: {base["adaptive_mm"]:.0f} mm a cycle)',
        f'Its gain over the better fixed morphology\n(shipped: {base["gain_mm"]:.0f} mm a cycle)',
    )
    styles = {'halved': ('#0072B2', '', 0.19), 'doubled': ('#E69F00', '////', -0.19)}
    places = range(len(rows))
    for axis, key, title in zip(axes, keys, titles, strict=True):
        for word, (colour, hatch, shift) in styles.items():
            axis.barh(
                [place + shift for place in places],
                [row[word][key] for row in rows],
                height=0.36, color=colour, hatch=hatch, edgecolor='black', linewidth=0.4,
                label=word,
            )  # fmt: skip
        axis.axvline(0.0, color='black', linewidth=0.8)
        axis.grid(axis='x', color='0.85', linewidth=0.6)
        axis.set_axisbelow(True)
        axis.set_title(title, fontsize=10)
        axis.set_xlabel('change, mm a cycle')
        axis.spines[['top', 'right']].set_visible(False)
    # At this change the adaptive policy walks no farther than the better fixed morphology.
    axes[1].axvline(-base['gain_mm'], color='#D55E00', linewidth=1.2, linestyle='--')
    axes[1].annotate(
        'no gain left', (-base['gain_mm'], 0.0), xytext=(-4, 0), textcoords='offset points',
        rotation=90, ha='right', va='bottom', fontsize=8, color='#A04000',
    )  # fmt: skip
    axes[0].set_yticks(list(places), [row['label'] for row in rows], fontsize=9)
    axes[0].set_ylim(-0.7, len(rows) - 0.3)
    axes[0].legend(loc='lower left', frameon=False)
    figure.suptitle('What changes if an assumed number is wrong by a factor of two')
    figure.supxlabel(
        f'{document["scene"]}, {document["cycles"]} cycles, mean of {len(document["seeds"])} '
        f'seeds. {quiet} more numbers change less than {least:g} mm.\n'
        f'{document["machine"]["processor"]}, Python {document["machine"]["python"]},'
        f' {document["machine"]["date"]}',
        fontsize=8, color='0.3',
    )  # fmt: skip
    return figure


def main(words: Sequence[str]) -> int:
    """Measure, save, and print a table."""
    parser = command.parser('assumptions', __doc__)
    command.add_processes(parser)
    command.add_out(parser)
    options = parser.parse_args(words)
    document = {'machine': machine(), **measure(options.processes)}
    command.write(options.out, 'assumptions', document, {'assumptions': draw(document)})
    command.show(options, document, table(document))
    return 0
