# SPDX-License-Identifier: Apache-2.0
"""Draw figures 26 to 31 of the thesis, liquid on meshes of pads, with the exact surfaces."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Collection
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from ros_pad.capillary import (
    BathMeniscus,
    Mesh,
    Wall,
    Wet,
    WetPattern,
    WetSurface,
    bath_meniscus,
    wet,
    wet_pattern,
    wet_surface,
)
from ros_pad.contact.dome import press
from ros_pad.contact.meniscus import GRAVITY, WATER, Liquid
from ros_pad.contact.pad import LARGE_PAD, Array
from ros_pad.reports.style import (
    BLACK,
    BLUE,
    COLUMN,
    GREEN,
    PALE,
    PAPER_STYLE,
    VERMILION,
    WET,
    WIDE,
    legend,
)
from ros_pad.reports.wetted import DRY, WETTED, picture, shaded
from studies.thesis.explained import Claim, Explained, claim, explained

NUMBERS = (26, 27, 28, 29, 30, 31)
TENSIONS = (0.0016, 0.002, 0.004)  # N/m of the liquid, thesis
PRESSURE, FORCE = 75e3, 0.19  # Pa gauge and N on the pad: one of the thesis' pressed domes
PITCHES = (3.2e-3, 3.8e-3, 4.4e-3, 6e-3, 9e-3)  # m
_COLOURS = (VERMILION, BLUE, GREEN)
_ANGLES = (90.0, 60.0, 30.0, 0.0)  # degrees of contact at which there is an exact meniscus
_CURVE = tuple(np.linspace(90.0, 0.0, 31))
_HALF = Liquid(0.004, 0.002)
_BALANCES = {'energy': '-', 'thesis': (0, (4, 2))}
_LEVEL = {'energy': (GREEN, '-'), 'force': (BLUE, (0, (1, 1))), 'thesis': (VERMILION, (0, (4, 2)))}
_ALIGNED = 0.15  # relative error up to which heights count as well aligned
_CONE = (1.6e-3, 1.6e-3 - 2e-3 * math.tan(math.radians(10.0)), 2e-3)


class Found(NamedTuple):
    """Liquid of a pad by the balances of layers, and its exact height, m, with its spread."""

    mesh: Mesh
    layers: dict[str, Wet]
    height: float
    spread: float


def draw(numbers: Collection[int] = NUMBERS) -> list[Explained]:
    """Draw some of the figures 26 to 31; the first call takes about 15 s for all."""
    makers: dict[int, Callable[[], Explained]] = {
        26: _figure_26,
        27: _figure_27,
        28: _figure_28,
        29: _figure_29,
        30: _figure_30,
        31: _figure_31,
    }
    with matplotlib.rc_context(PAPER_STYLE):
        return [make() for number, make in makers.items() if number in numbers]


# --- what is computed ----------------------------------------------------------------------------


@functools.cache
def dome() -> tuple[float, float]:
    """Return radius of the sphere and of the contact, m, of the pressed dome."""
    pressed = press(LARGE_PAD, PRESSURE, FORCE)
    return float(pressed.sphere_radius), float(pressed.contact_radius)


def liquid_at(tension: float, degrees: float) -> Liquid:
    """Return the liquid whose tensions give a contact angle (3.81)."""
    # cos θ = 2 √ratio − 1
    return Liquid(tension, tension * (0.5 + 0.5 * math.cos(math.radians(degrees))) ** 2)


@functools.cache
def exact(tension: float, degrees: float) -> BathMeniscus:
    """Return the exact meniscus round the dome."""
    return bath_meniscus(*dome(), liquid=liquid_at(tension, degrees))


def exact_curvature(found: BathMeniscus, liquid: Liquid) -> float:
    """Return the radius of curvature at the contact line in the plane of the axis, m.

    By Young and Laplace the curvature there is ρ g h / γ plus the curvature around the ring.
    """
    bend = liquid.density * GRAVITY * found.height / liquid.surface_tension
    return 1.0 / (bend + math.sin(found.slope) / found.radius)


@functools.cache
def climbed(tension: float, balance: str) -> tuple[Array, Array, Array]:
    """Return tensions of the solid (N/m), heights and radii of curvature (m) on the dome."""
    mesh = Mesh.dome(*dome(), 1.75 * dome()[0], rings=64, sectors=48)
    liquids = [liquid_at(tension, degrees) for degrees in _CURVE]
    found = [wet(mesh, liquid, balance, slices=3, strict=False) for liquid in liquids]
    return (
        np.array([liquid.solid_tension for liquid in liquids]),
        np.array([each.mean_height for each in found]),
        np.array([each.curvature_radius[0] for each in found]),
    )


@functools.cache
def lobed() -> Mesh:
    """Return a pad of a general shape: the dome, stretched and with three lobes."""
    made = Mesh.dome(*dome(), 1.3 * dome()[0], rings=24, sectors=48)
    points = made.points.copy()
    swell = 1.0 + 0.12 * np.cos(3.0 * np.arctan2(points[:, 1], points[:, 0]))
    points[:, 0] *= 1.15 * swell
    points[:, 1] *= swell / 1.15
    return Mesh(points, made.faces, 'lobed dome')


@functools.cache
def lobed_surface() -> WetSurface:
    """Return the surface of minimum energy around the pad of a general shape."""
    return wet_surface(lobed(), _HALF)


@functools.cache
def bodies() -> dict[str, Found]:
    """Return the three pads of figure 26 with their liquid, by name."""
    round_ = Mesh.dome(*dome(), 1.3 * dome()[0], rings=24, sectors=48)
    found = {}
    walls = {
        'dome': (round_, Wall.dome(*dome())),
        'truncated cone': (
            Mesh.cone(*_CONE, rings=24, sectors=48),
            Wall.cone(_CONE[0], math.radians(100.0), _CONE[2]),
        ),
    }
    for name, (mesh, wall) in walls.items():
        height = bath_meniscus(wall=wall, liquid=_HALF).height
        found[name] = Found(mesh, _by_balance(mesh), height, 0.0)
    surface = lobed_surface()
    line = surface.line[:, 2]
    found['general shape'] = Found(
        lobed(), _by_balance(lobed()), float(line.mean()), float(np.ptp(line))
    )
    return found


def _by_balance(mesh: Mesh) -> dict[str, Wet]:
    return {
        name: wet(mesh, _HALF, name, slices=48, axis=(0.0, 0.0), strict=False)
        for name in _BALANCES
    }


def one_sided(found: BathMeniscus, liquid: Liquid) -> float:
    """Return the exact horizontal force of the liquid on one half of the dome, N, outwards.

    It is the surface tension along the contact line plus the suction of the liquid below it.
    """
    sphere, rest = dome()
    z = np.linspace(0.0, found.height, 401)
    r = np.sqrt(sphere**2 - (z - math.sqrt(sphere**2 - rest**2)) ** 2)
    suction = 2.0 * liquid.density * GRAVITY * z * r
    inner = float(np.sum(0.5 * (suction[1:] + suction[:-1]) * np.diff(z)))
    return 2.0 * found.radius * liquid.surface_tension * math.cos(found.slope) + inner


@functools.cache
def in_pattern(pitch: float) -> float:
    """Return the height of water on one dome of many, m, by the surface of minimum energy."""
    wall = Wall.dome(*dome(), 2.2e-3)
    return wet_surface(wall, WATER, math.sqrt(0.75) * pitch**2).mean_height


def filled(pitch: float, balance: str) -> WetPattern:
    """Return the level water between domes of a hexagonal pattern."""
    cell = math.sqrt(0.75) * pitch**2
    return wet_pattern(_one_of_many(), WATER, cell, balance=balance, strict=False)


@functools.cache
def _one_of_many() -> Mesh:
    return Mesh.dome(*dome(), 2.2e-3, rings=48, sectors=72)


# --- what is drawn -------------------------------------------------------------------------------


def _figure_26() -> Explained:
    figure = Figure(figsize=(WIDE, 2.15))
    found = bodies()
    for k, (name, each) in enumerate(found.items()):
        ax: Any = figure.add_axes(
            (k / 3.0, 0.0, 1.0 / 3.0, 1.0), projection='3d', computed_zorder=False
        )
        _solid(ax, each.mesh, each.layers['energy'], 1.27)
        heights = ', '.join(
            f'{text} {1e3 * value:.2f}'
            for text, value in (
                ('energy', each.layers['energy'].mean_height),
                ('thesis', each.layers['thesis'].mean_height),
                ('exact', each.height),
            )
        )
        figure.text(k / 3.0 + 0.015, 0.93, f'({"abc"[k]}) {name}')
        figure.text(k / 3.0 + 0.015, 0.04, f'{heights} mm', fontsize=7.0)
    return explained(26, figure, _claims_26())


def _claims_26() -> tuple[Claim, ...]:
    found = bodies()
    off = {
        balance: [each.layers[balance].mean_height / each.height - 1.0 for each in found.values()]
        for balance in _BALANCES
    }
    general = found['general shape']
    spreads = [1e6 * general.layers['energy'].height_spread, 1e6 * general.spread]
    return (
        claim(
            'simulated liquid agrees with',
            f'Heights of its balance are off by {_percents(off["thesis"])} on dome, cone and '
            f'general shape; those of the balance of energy by {_percents(off["energy"])}.',
            (*off['thesis'], *off['energy']),
            all(abs(each) <= _ALIGNED for each in off['thesis']),
        ),
        claim(
            'round a general shape',
            f'From slice to slice by {spreads[0]:.0f} µm; that of the exact surface by '
            f'{spreads[1]:.0f} µm.',
            tuple(spreads),
            spreads[1] > 0.02e6 * general.height,
        ),
    )


def _figure_27() -> Explained:
    figure = Figure(figsize=(WIDE, 2.6), layout='constrained')
    left, right = figure.subplots(1, 2)
    found = bodies()['general shape'].layers['energy']
    turns = np.radians(np.linspace(0.0, 360.0, 73))
    left.plot(np.degrees(turns), [1e6 * found.section(a) for a in turns], color=BLUE)
    twin = left.twinx()
    twin.plot(
        np.degrees(turns), [1e6 * found.force(a) for a in turns], color=VERMILION, ls=(0, (4, 2))
    )
    twin.spines['right'].set_visible(True)
    twin.set_ylim(None, 0.0)
    left.set(xticks=range(0, 361, 90), xlabel='direction of motion / °', ylim=(0.0, None))
    left.set_ylabel('projected section / mm²', color=BLUE)
    twin.set_ylabel('pressure × section / µN', color=VERMILION)
    left.set_title('(a) general shape')

    readings = _readings_of_417()
    names = ('4.18 with 4.17 as printed', '4.18, sign mended', 'exact, one half', 'exact, whole')
    right.barh(
        range(4), (*readings.forces, 0.0), color=(VERMILION, BLUE, GREEN, GREEN), height=0.6
    )
    right.plot(0.0, 3, 'o', color=GREEN)
    right.set_yticks(range(4), names)
    right.invert_yaxis()
    right.axvline(0.0, color=BLACK, lw=0.7)
    right.set_xlabel('force along the motion / µN')
    right.set_title('(b) dome')
    return explained(27, figure, _claims_27(readings))


class _Readings(NamedTuple):
    """Equations 4.17 and 4.18 on the dome, and the exact meniscus.

    Forces on one half as printed, with the sign mended, and exact, µN; pressures as printed, with
    the sign mended, and exact at the line, Pa.
    """

    forces: tuple[float, float, float]
    printed: float
    mended: float
    exact: float


def _readings_of_417() -> _Readings:
    ring = wet(Mesh.dome(*dome()), _HALF, axis=(0.0, 0.0))
    true = bath_meniscus(*dome(), liquid=_HALF)
    curvature, radius = float(ring.curvature_radius[0]), float(ring.ring_radii[0])
    printed = _HALF.surface_tension * (1.0 / curvature + 1.0 / radius)
    exact_force = -1e6 * one_sided(true, _HALF)
    forces = 1e6 * printed * ring.section(0.0), 1e6 * ring.force(0.0), exact_force
    pressure = -_HALF.density * GRAVITY * true.height
    return _Readings(forces, printed, float(ring.pressure[0]), pressure)


def _claims_27(readings: _Readings) -> tuple[Claim, ...]:
    forces = readings.forces
    surface = lobed_surface()
    net = 1e6 * float(np.hypot(*surface.force[:2]))
    general = 1e6 * abs(bodies()['general shape'].layers['energy'].force(0.0))
    return (
        claim(
            'the capillary force along',
            f'Round the general shape it is {general:.2f} µN, of the surface of least energy '
            f'{net:.4f}: opposite sides cancel. For one half of the dome 4.18 gives '
            f'{forces[0]:+.1f} µN, {forces[1]:+.2f} with the sign of 4.17 mended; exact is '
            f'{forces[2]:+.1f}, mostly the pull of the contact line, which 4.18 leaves out.',
            (general, net, *forces),
            net >= 0.5 * general,
        ),
        claim(
            'the pressure is 1',
            f'On the dome this gives {readings.printed:+.1f} Pa, but the pressure in raised '
            f'liquid is below that of the air: {readings.exact:+.1f} Pa at the line. Ring and arc '
            f'curve in opposite senses: γ(1/r - 1/R) is {readings.mended:+.1f} Pa.',
            (readings.printed, readings.exact, readings.mended),
            readings.printed < 0.0,
        ),
    )


def _figure_28() -> Explained:
    figure = Figure(figsize=(WIDE, 2.1), layout='constrained')
    panels = figure.subplots(1, 4, sharey=True)
    tension = TENSIONS[-1]
    sphere, rest = dome()
    middle = math.sqrt(sphere**2 - rest**2)
    mesh = Mesh.dome(sphere, rest, 1.75 * sphere, rings=64, sectors=48)
    z = np.linspace(0.0, 1.2 * sphere, 100)
    wall = np.sqrt(sphere**2 - (z - middle) ** 2)
    layers, truths = [], []
    for ax, degrees in zip(panels, _ANGLES, strict=True):
        liquid, true = liquid_at(tension, degrees), exact(tension, degrees)
        found = wet(mesh, liquid, slices=3)
        arc = 1e3 * found.surface(65)[0]
        ax.fill_betweenx(1e3 * z, 0.0, 1e3 * wall, color=DRY, lw=0.0)
        ax.fill_betweenx(arc[:, 2], np.interp(arc[:, 2], 1e3 * z, 1e3 * wall), arc[:, 0],
                         color=WET, lw=0.0)  # fmt: skip
        ax.plot(1e3 * wall, 1e3 * z, color=BLACK, lw=0.9)
        ax.plot(arc[:, 0], arc[:, 2], color=BLUE)
        ax.plot(1e3 * true.radii, 1e3 * true.heights, color=VERMILION, lw=1.0, ls=(0, (4, 2)))
        ax.axhline(0.0, color=BLACK, lw=0.9)
        ax.set_aspect('equal', adjustable='box')
        ax.set(xlim=(0.5, 3.0), ylim=(-0.05, 1.6), xlabel='radius / mm')
        ax.set_title(f'γs = {1e3 * liquid.solid_tension:.2f} mN/m', fontsize=7.5)
        layers.append(1e3 * found.mean_height)
        truths.append(1e3 * true.height)
    panels[0].set_ylabel('height / mm')
    handles = [
        Line2D([], [], color=BLUE, label='layers, energy'),
        Line2D([], [], color=VERMILION, lw=1.0, ls=(0, (4, 2)), label='exact meniscus'),
    ]
    legend(figure, handles)
    curve = climbed(tension, 'energy')[1]
    return explained(28, figure, _claims_28(layers, truths, curve))


def _claims_28(layers: list[float], truths: list[float], curve: Array) -> tuple[Claim, ...]:
    return (
        claim(
            'the level rises as',
            'From panel to panel layers have '
            + ', '.join(f'{each:.2f}' for each in layers)
            + ' mm, the exact meniscus '
            + ', '.join(f'{each:.2f}' for each in truths)
            + ' mm.',
            (*layers, *truths),
            bool(np.all(np.diff(curve) > 0.0)) and _rising(truths),
        ),
        claim(
            'only these tensions wet',
            f'Under a dome liquid rises already at 90°, by {truths[0]:.2f} mm: it climbs where '
            'contact angle and inclination of the wall add up to less than 180°.',
            (truths[0],),
            truths[0] <= 0.0,
        ),
    )


def _figure_29() -> Explained:
    figure = Figure(figsize=(COLUMN, 2.9), layout='constrained')
    ax = figure.subplots()
    for tension, colour in zip(TENSIONS, _COLOURS, strict=True):
        for balance, style in _BALANCES.items():
            solid, height, _ = climbed(tension, balance)
            ax.plot(1e3 * solid, 1e3 * height, color=colour, ls=style)
        for degrees in _ANGLES:
            solid_tension = liquid_at(tension, degrees).solid_tension
            height_there = exact(tension, degrees).height
            ax.plot(1e3 * solid_tension, 1e3 * height_there, 'o', color=colour)
    ax.set_xlim(0.0, None)
    ax.set_ylim(0.0, None)
    ax.set_xlabel('tension of the solid / (mN/m)')
    ax.set_ylabel('wetted height / mm')
    legend(figure, _handles(), 3)
    return explained(29, figure, _claims_29())


def _claims_29() -> tuple[Claim, ...]:
    energy = [climbed(tension, 'energy')[1] for tension in TENSIONS]
    truths = [[exact(tension, degrees).height for degrees in _ANGLES] for tension in TENSIONS]
    middle = [1e3 * row[1] for row in truths]
    last = [_slope_at_end(tension) for tension in TENSIONS]
    return (
        claim(
            'the height rises with',
            'Also with the balance of energy and on the exact meniscus, from '
            f'{1e3 * truths[-1][0]:.2f} to {1e3 * truths[-1][-1]:.2f} mm for 4 mN/m.',
            (truths[-1][0], truths[-1][-1]),
            all(bool(np.all(np.diff(each) > 0.0)) for each in energy)
            and all(_rising(each) for each in truths),
        ),
        claim(
            'at the same contact',
            'At a contact angle of 60° the exact heights are '
            + ', '.join(f'{each:.2f}' for each in middle)
            + ' mm.',
            tuple(middle),
            _rising(middle),
        ),
        claim(
            'the height converges to',
            'The highest point is the end of the range, a contact angle of 0°; over its last '
            'twentieth the curves rise '
            + ', '.join(f'{each:.1f}' for each in last)
            + ' times as steeply as over the whole.',
            tuple(last),
            all(each < 0.1 for each in last),
        ),
    )


def _slope_at_end(tension: float) -> float:
    """Return the mean slope in the last twentieth of the range, over that in the whole range."""
    solid, height, _ = climbed(tension, 'energy')
    before = solid[-1] - 0.05 * (solid[-1] - solid[0])
    rise = height[-1] - float(np.interp(before, solid, height))
    return rise / 0.05 / float(height[-1] - height[0])


def _figure_30() -> Explained:
    figure = Figure(figsize=(COLUMN, 2.9), layout='constrained')
    ax = figure.subplots()
    for tension, colour in zip(TENSIONS, _COLOURS, strict=True):
        for balance, style in _BALANCES.items():
            _, height, curvature = climbed(tension, balance)
            ax.plot(1e3 * height, 1e3 * curvature, color=colour, ls=style)
        for degrees in _ANGLES:
            true = exact(tension, degrees)
            curvature_there = exact_curvature(true, liquid_at(tension, degrees))
            ax.plot(1e3 * true.height, 1e3 * curvature_there, 'o', color=colour)
    ax.set_xlim(0.0, None)
    ax.set_ylim(0.0, None)
    ax.set_xlabel('wetted height / mm')
    ax.set_ylabel('radius of curvature / mm')
    legend(figure, _handles(), 3)
    return explained(30, figure, _claims_30())


def _claims_30() -> tuple[Claim, ...]:
    _, height, curvature = climbed(TENSIONS[-1], 'energy')
    shares = curvature / height
    _, height, curvature = climbed(TENSIONS[-1], 'thesis')
    printed = (curvature / height)[np.isfinite(height)]
    cone = Mesh.cone(*_CONE, rings=24, sectors=48)
    on_cone = [wet(cone, liquid_at(tension, 45.0), slices=3) for tension in TENSIONS]
    same = [float(each.curvature_radius[0]) / each.mean_height for each in on_cone]
    return (
        claim(
            'the radius of the',
            f'On the dome it goes from {shares[0]:.2f} to {shares[-1]:.2f} times the height, with '
            f'the balance of the thesis from {printed[0]:.2f} to {printed[-1]:.2f}; on a cone, at '
            'one contact angle, it is '
            + ', '.join(f'{each:.3f}' for each in same)
            + ' times the height for the three liquids.',
            (float(shares[0]), float(shares[-1]), *same),
            bool(np.ptp(shares) <= 0.1 * np.mean(shares)),
        ),
    )


def _figure_31() -> Explained:
    figure = Figure(figsize=(WIDE, 2.7))
    body: Any = figure.add_axes((0.0, 0.0, 0.5, 0.95), projection='3d', computed_zorder=False)
    drawn_pitch = PITCHES[1]
    many = Mesh.dome_pattern(19, drawn_pitch, *dome(), 2.2e-3, rings=10, sectors=24)
    area = 19.0 * math.sqrt(0.75) * drawn_pitch**2
    _solid(body, many, wet_pattern(many, WATER, area), 1.2)
    figure.text(0.015, 0.94, '(a) nineteen domes, 3.8 mm apart')
    ax = figure.add_axes((0.58, 0.17, 0.40, 0.70))
    figure.text(0.52, 0.94, '(b) height of water over their distance')
    pitches = np.linspace(3.15e-3, 9e-3, 40)
    for balance, (colour, style) in _LEVEL.items():
        heights = [1e3 * filled(float(pitch), balance).height for pitch in pitches]
        ax.plot(1e3 * pitches, heights, color=colour, ls=style, label=f'level, {balance}')
    true = [in_pattern(pitch) for pitch in PITCHES]
    ax.plot(1e3 * np.array(PITCHES), 1e3 * np.array(true), 'o', color=BLACK, label='least energy')
    sphere, rest = dome()
    limit = math.sqrt(sphere**2 - rest**2) + sphere * math.cos(WATER.angle)
    alone = bath_meniscus(sphere, rest, liquid=WATER).height
    for level, words, x, side in (
        (limit, 'θ = slope of the wall', 9.0, 'right'),
        (alone, 'one dome alone', 3.0, 'left'),
    ):
        ax.axhline(1e3 * level, color=PALE, lw=0.8, zorder=0)
        ax.annotate(
            words, (x, 1e3 * level), (0, 2), textcoords='offset points', ha=side, fontsize=7.0
        )
    ax.set(xlabel='distance of neighbours / mm', ylabel='height / mm', ylim=(0.0, 2.2))
    ax.legend(loc='upper right', ncols=2, fontsize=7.0)
    return explained(31, figure, _claims_31(true, limit))


def _claims_31(true: list[float], limit: float) -> tuple[Claim, ...]:
    closest = filled(PITCHES[0], 'energy')
    ours, thesis = (
        [
            filled(pitch, balance).height / height - 1.0
            for pitch, height in zip(PITCHES, true, strict=True)
        ]
        for balance in ('energy', 'thesis')
    )
    off = [each for each in thesis if math.isfinite(each)]
    return (
        claim(
            'the narrower the space',
            'From 9 to 3.2 mm the surface of least energy rises from '
            f'{1e3 * true[-1]:.2f} to {1e3 * true[0]:.2f} mm. The rise has a limit, unlike in a '
            f'tube: where the slope of the wall is the contact angle, {1e3 * limit:.2f} mm.',
            (true[-1], true[0], limit),
            _rising(true[::-1]) and true[0] < limit,
            rule=f'Rises at each of {len(true)} distances. Size and distance of the domes are '
            'assumed; the liquid is water.',
        ),
        claim(
            'the balance of all',
            f"The thesis' balance is off by {_percents(off)} at {len(off)} of {len(PITCHES)} "
            'distances, else over the top of the domes; the balance of energy by '
            f'{_percents(ours)}. A level surface leaves out the meniscus at each dome.',
            (*off, *ours),
            len(off) == len(PITCHES) and all(abs(each) <= _ALIGNED for each in off),
        ),
        claim(
            'a layer of liquid',
            'As printed an area is taken from a volume. With dz in both terms, '
            f'{1e9 * closest.volume:.2f} mm³ of water surround each dome 3.2 mm from its '
            'neighbours.',
            (closest.volume,),
            False,
        ),
    )


def _solid(ax: Any, mesh: Mesh, found: Wet | WetPattern, zoom: float) -> None:
    """Draw pad and liquid in 3-D, as pixels: a vector graphic would have too many faces."""
    drawn = picture(mesh, found)
    parts = ((drawn.dry, DRY, 1.0), (drawn.wet, WETTED, 1.0), (drawn.surface, WET, 0.55))
    fills = np.concatenate([shaded(each, colour, alpha) for each, colour, alpha in parts])
    faces = [face for each, _, _ in parts for face in each]
    ax.add_collection3d(
        Poly3DCollection(faces, facecolors=fills, edgecolors=fills, lw=0.25, rasterized=True)
    )
    points = np.concatenate([each.reshape(-1, 3) for each, _, _ in parts])
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = 0.5 * (low + high), 0.5 * float((high - low)[:2].max())
    ax.set(
        xlim=(middle[0] - half, middle[0] + half),
        ylim=(middle[1] - half, middle[1] + half),
        zlim=(0.0, high[2]),
    )
    ax.set_box_aspect((1.0, 1.0, 0.5 * float(high[2]) / half), zoom=zoom)
    ax.view_init(20.0, -62.0)
    ax.set_axis_off()


def _handles() -> list[Line2D]:
    liquids = [
        Line2D([], [], color=colour, label=f'{1e3 * tension:g} mN/m')
        for tension, colour in zip(TENSIONS, _COLOURS, strict=True)
    ]
    balances = [
        Line2D([], [], color=BLACK, ls=style, label=name) for name, style in _BALANCES.items()
    ]
    return [*liquids, *balances, Line2D([], [], color=BLACK, marker='o', ls='', label='exact')]


def _rising(values: list[float]) -> bool:
    return all(low < high for low, high in itertools.pairwise(values))


def _percents(shares: list[float]) -> str:
    return ', '.join(f'{100.0 * each:+.0f}' for each in shares) + ' %'
