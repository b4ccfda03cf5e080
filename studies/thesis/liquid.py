# SPDX-License-Identifier: Apache-2.0
"""Draw figures 26 to 31 of the thesis, liquid on meshes of pads, with the exact surfaces."""

from __future__ import annotations

import functools
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
from studies.thesis.explained import Explained, claim, explained

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
    makers = (_figure_26, _figure_27, _figure_28, _figure_29, _figure_30, _figure_31)
    with matplotlib.rc_context(PAPER_STYLE):
        return [make() for number, make in zip(NUMBERS, makers, strict=True) if number in numbers]


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
    return bath_meniscus(Wall.dome(*dome()), liquid_at(tension, degrees))


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
    cone = (
        Mesh.cone(*_CONE, rings=24, sectors=48),
        Wall.cone(_CONE[0], math.radians(100), _CONE[2]),
    )
    walls = {
        'dome': (Mesh.dome(*dome(), 1.3 * dome()[0], rings=24, sectors=48), Wall.dome(*dome())),
        'truncated cone': cone,
    }
    found = {
        name: Found(mesh, _by_balance(mesh), bath_meniscus(wall, _HALF).height, 0.0)
        for name, (mesh, wall) in walls.items()
    }
    line = lobed_surface().line[:, 2]
    general = Found(lobed(), _by_balance(lobed()), float(line.mean()), float(np.ptp(line)))
    return found | {'general shape': general}


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
        box = (k / 3.0, 0.0, 1.0 / 3.0, 1.0)
        ax: Any = figure.add_axes(box, projection='3d', computed_zorder=False)
        _solid(ax, each.mesh, each.layers['energy'], 1.27)
        energy, thesis = (1e3 * each.layers[name].mean_height for name in ('energy', 'thesis'))
        text = f'energy {energy:.2f}, thesis {thesis:.2f}, exact {1e3 * each.height:.2f} mm'
        figure.text(k / 3.0 + 0.015, 0.93, f'({"abc"[k]}) {name}')
        figure.text(k / 3.0 + 0.015, 0.04, text, fontsize=7.0)
    off = {
        balance: [each.layers[balance].mean_height / each.height - 1.0 for each in found.values()]
        for balance in _BALANCES
    }
    general = found['general shape']
    layers, exact = 1e6 * general.layers['energy'].height_spread, 1e6 * general.spread
    climbs = min(off['thesis']) > -1.0
    claims = (
        claim('simulated liquid agrees with', (*off['thesis'], *off['energy']), climbs, **off),
        claim('round a general shape', (layers, exact), exact > 0.02e6 * general.height,
              layers=layers, exact=exact),
    )  # fmt: skip
    return explained(26, figure, claims)


def _figure_27() -> Explained:
    figure = Figure(figsize=(WIDE, 2.6), layout='constrained')
    left, right = figure.subplots(1, 2)
    found = bodies()['general shape'].layers['energy']
    turns = np.linspace(0.0, 360.0, 73)
    radians = np.radians(turns)
    left.plot(turns, [1e6 * found.section(a) for a in radians], color=BLUE)
    twin = left.twinx()
    pulls = [1e6 * found.force(a) for a in radians]
    twin.plot(turns, pulls, color=VERMILION, ls=(0, (4, 2)))
    twin.spines['right'].set_visible(True)
    twin.set_ylim(None, 0.0)
    left.set(xticks=range(0, 361, 90), xlabel='direction of motion / °', ylim=(0.0, None))
    left.set_ylabel('projected section / mm²', color=BLUE)
    twin.set_ylabel('pressure × section / µN', color=VERMILION)
    left.set_title('(a) general shape')

    # Equations 4.17 and 4.18 on the dome as printed, with the sign mended, and exact: forces on
    # one half, µN, and pressures, Pa
    ring = wet(Mesh.dome(*dome()), _HALF, axis=(0.0, 0.0))
    true = bath_meniscus(Wall.dome(*dome()), _HALF)
    curvature, radius = float(ring.curvature_radius[0]), float(ring.ring_radii[0])
    printed = _HALF.surface_tension * (1.0 / curvature + 1.0 / radius)
    pressures = printed, -_HALF.density * GRAVITY * true.height, float(ring.pressure[0])
    forces = (
        1e6 * printed * ring.section(0.0),
        1e6 * ring.force(0.0),
        -1e6 * one_sided(true, _HALF),
    )
    names = ('4.18 with 4.17 as printed', '4.18, sign mended', 'exact, one half', 'exact, whole')
    right.barh(range(4), (*forces, 0.0), color=(VERMILION, BLUE, GREEN, GREEN), height=0.6)
    right.plot(0.0, 3, 'o', color=GREEN)
    right.set_yticks(range(4), names)
    right.invert_yaxis()
    right.axvline(0.0, color=BLACK, lw=0.7)
    right.set_xlabel('force along the motion / µN')
    right.set_title('(b) dome')
    net = 1e6 * float(np.hypot(*lobed_surface().force[:2]))
    general = 1e6 * abs(found.force(0.0))
    claims = (
        claim('the capillary force along', (general, net, *forces), net >= 0.5 * general,
              general=general, net=net, printed=forces[0], mended=forces[1], exact=forces[2]),
        claim('the pressure is 1', pressures, printed < 0.0, printed=printed, exact=pressures[1],
              mended=pressures[2]),
    )  # fmt: skip
    return explained(27, figure, claims)


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
    rising = _rising(climbed(tension, 'energy')[1]) and _rising(truths)
    claims = (
        claim('the level rises as', (*layers, *truths), rising, layers=layers, exact=truths),
        claim('only these tensions wet', truths[0], True, rise=truths[0]),
    )
    return explained(28, figure, claims)


def _over(ax: Any, column: int, at: Callable[[float, float], tuple[float, float]]) -> None:
    """Draw two columns of :func:`climbed` against each other, and exact points, mm and mN/m."""
    for tension, colour in zip(TENSIONS, _COLOURS, strict=True):
        for balance, style in _BALANCES.items():
            x, y = climbed(tension, balance)[column : column + 2]
            ax.plot(1e3 * x, 1e3 * y, color=colour, ls=style)
        for degrees in _ANGLES:
            ax.plot(*(1e3 * np.array(at(tension, degrees))), 'o', color=colour)
    ax.set(xlim=(0.0, None), ylim=(0.0, None))


def _figure_29() -> Explained:
    figure = Figure(figsize=(COLUMN, 2.9), layout='constrained')
    ax = figure.subplots()
    _over(ax, 0, lambda t, angle: (liquid_at(t, angle).solid_tension, exact(t, angle).height))
    ax.set(xlabel='tension of the solid / (mN/m)', ylabel='wetted height / mm')
    legend(figure, _handles(), 3)
    energy = [climbed(tension, 'energy')[1] for tension in TENSIONS]
    truths = [[1e3 * exact(t, degrees).height for degrees in _ANGLES] for t in TENSIONS]
    middle = [row[1] for row in truths]
    low, high = truths[-1][0], truths[-1][-1]
    claims = (
        claim('the height rises with', (1e-3 * low, 1e-3 * high),
              all(map(_rising, (*energy, *truths))), low=low, high=high),
        claim('at the same contact', middle, _rising(middle), heights=middle),
        claim('the height converges to', truths[-1], None, heights=truths[-1]),
    )  # fmt: skip
    return explained(29, figure, claims)


def _figure_30() -> Explained:
    figure = Figure(figsize=(COLUMN, 2.9), layout='constrained')
    ax = figure.subplots()

    def true(tension: float, degrees: float) -> tuple[float, float]:
        found = exact(tension, degrees)
        return found.height, exact_curvature(found, liquid_at(tension, degrees))

    _over(ax, 1, true)
    ax.set(xlabel='wetted height / mm', ylabel='radius of curvature / mm')
    legend(figure, _handles(), 3)
    _, height, curvature = climbed(TENSIONS[-1], 'energy')
    shares = curvature / height
    _, height, curvature = climbed(TENSIONS[-1], 'thesis')
    printed = (curvature / height)[np.isfinite(height)]
    cone = Mesh.cone(*_CONE, rings=24, sectors=48)
    on_cone = [wet(cone, liquid_at(tension, 45.0), slices=3) for tension in TENSIONS]
    same = [float(each.curvature_radius[0]) / each.mean_height for each in on_cone]
    claims = [
        claim('the radius of the', (shares[0], shares[-1], *same), None, first=shares[0],
              last=shares[-1], first_of_thesis=printed[0], last_of_thesis=printed[-1], same=same)
    ]  # fmt: skip
    return explained(30, figure, claims)


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
    alone = bath_meniscus(Wall.dome(sphere, rest), WATER).height
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
    closest = filled(PITCHES[0], 'energy')
    ours, thesis = (
        [filled(p, name).height / height - 1.0 for p, height in zip(PITCHES, true, strict=True)]
        for name in ('energy', 'thesis')
    )
    off = [each for each in thesis if math.isfinite(each)]
    good = len(off) == len(PITCHES) and max(map(abs, off)) <= _ALIGNED
    claims = (
        claim('the narrower the space', (true[-1], true[0], limit),
              _rising(true[::-1]) and true[0] < limit, low=1e3 * true[-1], high=1e3 * true[0],
              limit=1e3 * limit, count=len(true)),
        claim('the balance of all', (*off, *ours), good, off=off, ours=ours, count=len(off),
              all=len(PITCHES)),
        claim('a layer of liquid', closest.volume, False, volume=1e9 * closest.volume),
    )  # fmt: skip
    return explained(31, figure, claims)


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


def _rising(values: Any) -> bool:
    return bool(np.all(np.diff(values) > 0.0))
