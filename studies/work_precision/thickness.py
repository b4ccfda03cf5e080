# SPDX-License-Identifier: Apache-2.0
"""Solids beside the membrane: free domes of thick sheets, and the error of their correction.

Axisymmetric finite elements (scikit-fem; `pip install scikit-fem`) give pressure, height and
volume of bonded and of clamped sheets. Each path is computed on two meshes, with 2 and 3 elements
over the thickness, and extrapolated: stress at the rim is singular, and the error falls with the
first power of the size. Prints:

- the solids beside the reference rows, test/reference/fe_free.json
- the limit of thin sheets: pressure over the membrane's less 1, which is in proportion to h/r
- the error of the correction in ros_pad, against reference rows and solids outside of the fit

Writes thickness.json and .png. With --fit it computes the solids of the fit (10 min) and prints
the coefficients as they stand in ros_pad/contact/thickness.py.
"""

from __future__ import annotations

import json
import textwrap
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import CubicSpline, PchipInterpolator

from ros_pad.contact import Material, Pad, inflate, thickness
from ros_pad.contact.hyperelastic import pressure_end, shapes
from ros_pad.contact.pad import Array
from studies import command
from studies.drawing import BLACK, BLUE, STYLE, VERMILION

EDGES = {'bonded': BLUE, 'clamped': VERMILION}
REFERENCE = command.ROOT / 'test' / 'reference' / 'fe_free.json'
MESHES = (2, 3)  # elements over the thickness
STEP, FIRST = 0.075, 0.0125  # of the height; the first four
HEIGHTS = np.concatenate([FIRST * np.arange(1, 4), 0.05 * np.arange(1, 31)])
# C2 and C3 over the shear modulus, and thickness over radius.
THIN_LAWS = ((0.0, 0.0), (0.0353, -0.00067), (0.08, 0.0))
FIT_LAWS = (*THIN_LAWS, (0.07, -0.0024))
THIN_RATIOS, FIT_RATIOS = (0.01, 0.02), (0.05, 0.1, 0.2, 0.3, 0.4)
HELD_LAWS = ((0.0047, -1.8e-5), (0.02, -0.0003), (0.0406, -0.00076))
HELD_RATIOS = (0.15, 0.25, 0.35)
THIN = (0.02, 0.01, 0.005)
# Solids of two meshes that differ by more are dropped.
_APART = 0.03


@dataclass(frozen=True)
class Curve:
    """A solid: P = p r/(μ h), and V, over the height of the outer face; lengths in radii.

    ``error`` is the largest relative difference of P and V between this and the finer mesh.
    """

    edge: str
    ratio: float
    law: tuple[float, float]
    height: Array
    pressure: Array
    volume: Array
    error: Array
    seconds: float


def curve(edge: str, ratio: float, law: tuple[float, float]) -> Curve:
    """Compute a solid to the largest height of the correction, also past a maximum pressure."""
    from studies.work_precision.solid import Rubber, Solid

    start = time.perf_counter()
    paths = []
    for cells in MESHES:
        solid = Solid(Rubber(0.5, *law), ratio, edge, cells)
        last = thickness.HIGHEST[edge] + STEP
        states = [*solid.path(FIRST, 4 * FIRST), *solid.path(STEP, last)]
        paths.append(np.array([(s.outer, s.pressure / ratio, s.volume) for s in states]))
    return extrapolated(edge, ratio, law, paths, time.perf_counter() - start)


def extrapolated(
    edge: str, ratio: float, law: tuple[float, float], paths: Sequence[Array], seconds: float
) -> Curve:
    """Return the solid of first order in 1/cells from height, P and V on two meshes."""
    coarse, fine = (_over_height(path, ratio) for path in paths)
    whole = coarse + MESHES[1] / (MESHES[1] - MESHES[0]) * (fine - coarse)
    apart = np.abs(whole / fine - 1.0).max(axis=1)
    keep = (apart < _APART) & (thickness.HIGHEST[edge] + STEP > HEIGHTS)
    height, pressure, volume, apart = np.stack([HEIGHTS, *whole.T, apart])[:, keep]
    return Curve(edge, ratio, law, height, pressure, volume, apart, seconds)


def _over_height(states: Array, ratio: float) -> Array:
    """Return P and V at the heights; NaN above the last state."""
    far = [0]
    for k in range(1, len(states)):
        if states[k, 0] > states[far[-1], 0] + 0.9 * FIRST:
            far.append(k)
    height, rows = states[far, 0], states[far, 1:]

    def scale(h: Array) -> Array:
        return np.stack([14.0 * h**3 / (1.0 + 4.0 * h**3) + 21.0 * ratio**2 * h, h], axis=1)

    share = PchipInterpolator(height, rows / scale(height), extrapolate=False)
    return np.asarray(share(HEIGHTS) * scale(HEIGHTS))


def curves(laws: Any, ratios: Any, text: str) -> list[Curve]:
    cases = [(edge, ratio, law) for edge in EDGES for ratio in ratios for law in laws]
    return [curve(*case) for case in command.each(cases, text, 'solid')]


# --- the fit -------------------------------------------------------------------------------------


def _membrane(law: tuple[float, float]) -> Any:
    """Return P, strain of the apex and V of a membrane, over its height."""
    strain = np.linspace(0.0, 1.5, 97)[1:] ** 2
    states = shapes(('yeoh', (0.5, *law)), strain, np.full_like(strain, 1e-9))
    rows = np.stack([states.pressure, strain, states.volume], axis=1)
    return CubicSpline(np.append(0.0, states.gap), np.vstack([np.zeros(3), rows]))


def fit(solids: Sequence[Curve]) -> tuple[Array, Array]:
    """Return the coefficients of pressure and volume, by least squares of relative errors."""
    known = {solid.law: _membrane(solid.law) for solid in solids}
    rows: list[tuple[Array, ...]] = []
    for solid in solids:
        t = np.full_like(solid.height, solid.ratio)
        height = solid.height
        for _ in range(60):
            strain = known[solid.law](height)[:, 1]
            height = height + solid.height - thickness.outer_height(t, height, strain)
        pressure, _, volume = known[solid.law](height).T
        base = pressure + thickness.BENDING * t**2 * solid.height
        f = thickness.functions(t, solid.height, *(np.full_like(t, c) for c in solid.law))
        rows.append((f, base / solid.pressure, volume / solid.volume))
    f, *shares = (np.concatenate(each) for each in zip(*rows, strict=True))
    pressure, volume = (
        np.linalg.lstsq(f * share[:, None], 1.0 - share, rcond=None)[0] for share in shares
    )
    return pressure, volume


def printed(solids: Sequence[Curve]) -> str:
    """Return the coefficients as lines of Python."""
    found = {edge: fit([each for each in solids if each.edge == edge]) for edge in EDGES}
    lines = []
    for name, part in (('PRESSURE', 0), ('VOLUME', 1)):
        lines.append(f'{name}: dict[str, tuple[float, ...]] = {{')
        for edge, both in found.items():
            numbers = ', '.join(f'{x:.5g}' for x in both[part])
            lines += [f"    '{edge}': (", textwrap.indent(textwrap.fill(numbers, 90), ' ' * 8)]
            lines.append('    ),')
        lines.append('}')
    return '\n'.join(lines)


# --- errors --------------------------------------------------------------------------------------


def pad_of(edge: str, ratio: float, law: tuple[float, float]) -> Pad:
    """Return a pad with radius 1 m and shear modulus 1 kPa, so that P is p/(1 kPa h/r)."""
    return Pad.of(Material('yeoh', (500.0, *(1e3 * c for c in law))), 1.0, ratio, edge=edge)


def errors(solid: Curve) -> dict[str, Any]:
    """Return relative errors of the correction against a solid.

    ``pressure`` is at given height; ``height`` and ``volume`` are at given pressure, up to 95 % of
    the largest one: at a maximum of the pressure they have no bound. ``maximum`` is that of the
    largest pressure, where both balloon.
    """
    pad = pad_of(solid.edge, solid.ratio, solid.law)
    unit = 1e3 * solid.ratio
    end = pressure_end(pad)[0] / unit
    fine = end * np.linspace(0.0, 1.0, 20001) ** 3
    height = inflate(pad, fine * unit).height
    inside = solid.height <= height[-1]
    pressure = np.interp(solid.height[inside], height, fine) / solid.pressure[inside] - 1.0
    top = int(solid.pressure.argmax())
    lower = inside & (solid.pressure < 0.95 * min(end, solid.pressure[top]))
    lower[top:] = False
    balloons = pressure_end(pad)[1] == 'no_inflation' and top < solid.height.size - 1
    dome = inflate(pad, solid.pressure[lower] * unit)
    return {
        'edge': solid.edge,
        'ratio': solid.ratio,
        'law': list(solid.law),
        'heights': solid.height[inside].tolist(),
        'solid': solid.pressure[inside].tolist(),
        'pressure': pressure.tolist(),
        'height': (dome.height / solid.height[lower] - 1.0).tolist(),
        'volume': (dome.volume / solid.volume[lower] - 1.0).tolist(),
        'maximum': end / solid.pressure[top] - 1.0 if balloons else 0.0,
        'of_solid': float(solid.error[inside].max()),
        'seconds': solid.seconds,
    }


def reference() -> list[dict[str, Any]]:
    """Return the reference rows with the height of our solid, and of the correction."""
    from studies.work_precision.solid import NoConvergence, Rubber, Solid

    results = []
    for row in command.each(json.loads(REFERENCE.read_text())['rows'], 'reference', 'row'):
        radius, thick = row['radius_m'], row['thickness_m']
        modulus, ratio = 2.0 * row['C_Pa'][0], thick / radius
        edge = {'bond': 'bonded', 'side': 'clamped'}[row['clamp']]
        solid = Solid(Rubber(*(c / modulus for c in row['C_Pa'])), ratio, edge, MESHES[1])
        path = list(solid.path(STEP, row['height_outer_m'] / radius + STEP))
        aim = row['pressure_Pa'] / modulus
        near = min(path, key=lambda state, aim=aim: abs(state.pressure - aim))  # type: ignore[misc]
        try:
            found: float | None = solid.solve(near, None, aim).outer
        except NoConvergence:
            found = None
        pad = Pad.of(Material('yeoh', row['C_Pa']), radius, thick, edge=edge)
        flat = Pad.of(Material('yeoh', row['C_Pa']), radius, thick)
        inside = row['pressure_Pa'] <= pressure_end(pad)[0]
        height = inflate(pad, row['pressure_Pa']).height if inside else None
        results.append(
            {
                'law': row['law'],
                'edge': edge,
                'ratio': ratio,
                'height': row['height_outer_m'] / radius,
                'error': row['estimated_error_m'] / radius,
                'solid': found,
                'corrected': None if height is None else height / radius,
                'membrane': inflate(flat, row['pressure_Pa']).height / radius,
            }
        )
    return results


def thin() -> list[dict[str, Any]]:
    """Return solids over the membrane at a height of 0.3 radii, less 1, by thickness."""
    from studies.work_precision.solid import Rubber, Solid

    pressure = float(_membrane((0.0, 0.0))(0.3)[0])
    rows = []
    for ratio in command.each(THIN, 'thin sheets', 'solid'):
        for edge in EDGES:
            path = Solid(Rubber(), ratio, edge, MESHES[1]).path(0.05, 0.3)
            *_, last = path
            rows.append(
                {'ratio': ratio, 'edge': edge, 'more': last.pressure / ratio / pressure - 1.0}
            )
    return rows


# --- the study -----------------------------------------------------------------------------------


def summary(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the largest errors by edge."""
    lines = []
    for edge in EDGES:
        part = [row for row in rows if row['edge'] == edge]
        largest = {
            name: max(float(np.abs(row[name]).max()) for row in part)
            for name in ('pressure', 'height', 'volume', 'maximum')
        }
        off = np.concatenate([row['pressure'] for row in part])
        lines.append(
            {'edge': edge, 'solids': len(part), 'states': off.size, **largest}
            | {'rms_pressure': float(np.sqrt(np.mean(off**2)))}
            | {'of_solids': max(row['of_solid'] for row in part)}
        )
    return lines


def draw(held: Sequence[dict[str, Any]]) -> Figure:
    """Return the picture: pressure over height of three thicknesses, and errors over height."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 3.3), layout='constrained')
        left, right = figure.subplots(1, 2)
        law = HELD_LAWS[-1]
        flat = Pad.of(Material('yeoh', (500.0, *(1e3 * c for c in law))), 1.0, 0.1)
        fine = np.linspace(0.0, pressure_end(flat)[0], 2001)
        height = inflate(flat, fine).height
        left.plot(height, fine / 100.0, color=BLACK, lw=1.0, label='membrane, any h/r')
        for row in held:
            colour = EDGES[row['edge']]
            right.plot(row['heights'], 100.0 * np.array(row['pressure']), color=colour, lw=0.9)
            if row['law'] != list(law) or row['ratio'] == 0.25:
                continue
            pad = pad_of(row['edge'], row['ratio'], law)
            fine = np.linspace(0.0, pressure_end(pad)[0], 2001)
            label = f'{row["edge"]}, h/r = {row["ratio"]:g}'
            style = '-' if row['ratio'] > 0.25 else '--'
            height = inflate(pad, fine).height
            left.plot(
                height, fine / (1e3 * row['ratio']), style, color=colour, lw=1.2, label=label
            )
            left.plot(row['heights'][::2], row['solid'][::2], 'o', color=colour, ms=2.5)
        left.set(xlim=(0.0, 1.4), ylim=(0.0, None), xlabel='height of the outer face / r')
        left.set(ylabel='p r/(μ h)', title='corrected membrane, and solids (points)')
        left.legend(frameon=False, fontsize=7)
        right.axhline(0.0, color=BLACK, lw=0.8)
        right.set(xlabel='height of the outer face / r', ylabel='error of the pressure (%)')
        right.set(title='against solids outside of the fit')
    return figure


def cost() -> tuple[float, float]:
    """Return the time to prepare a pad, s, and of a row of a batch, us."""
    start = time.perf_counter()
    pad = pad_of('bonded', 0.123, HELD_LAWS[0])
    end = pressure_end(pad)[0]
    prepared = time.perf_counter() - start
    rows = np.linspace(0.0, end, 100_000)
    start = time.perf_counter()
    inflate(pad, rows)
    return prepared, 1e6 * (time.perf_counter() - start) / rows.size


def main(words: Sequence[str]) -> int:
    """Compute, compare, print and draw."""
    parser = command.parser('thickness', __doc__)
    parser.add_argument('--fit', action='store_true', help='compute and print the coefficients')
    command.add_out(parser)
    options = parser.parse_args(words)
    if options.fit:
        thin_solids = curves(THIN_LAWS, THIN_RATIOS, 'thin solids of the fit')
        print(printed(thin_solids + curves(FIT_LAWS, FIT_RATIOS, 'solids of the fit')))
        return 0
    prepared, row = cost()
    document: dict[str, Any] = {
        'held': [errors(each) for each in curves(HELD_LAWS, HELD_RATIOS, 'solids')],
        'reference': reference(),
        'thin': thin(),
        'correction_s': prepared,
        'row_us': row,
    }
    document['summary'] = summary(document['held'])
    kept = command.write(options.out, 'thickness', document, {'thickness': draw(document['held'])})
    parts = ('reference', 'thin', 'summary')
    texts = [command.listed(document[part], part) for part in parts]
    texts.append(f'a pad is prepared in {prepared:.2f} s, a row takes {row:.2f} us')
    command.show(options, kept, '\n'.join(texts))
    return 0
