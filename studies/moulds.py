# SPDX-License-Identifier: Apache-2.0
"""Judge the moulds of shipped and of random feet by programs and formulas that made none of them.

Parts are judged closed by trimesh and, where it is installed, by admesh; volumes by formulas of
circles; what is put together overlaps nowhere but where it is squeezed; moulds come off without
undercut; a flood fill of voxels leads from the inlet to every pad and nowhere else; every sheet
is as thick as it was asked. With prusa-slicer (FDM, 0.2 mm) also layers, time and mass.

For example:
  python -m studies moulds --random 50
"""

from __future__ import annotations

import io
import math
import pathlib
import re
import shutil
import subprocess
import tempfile
import time
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import matplotlib
import numpy as np

from ros_pad.commands.folder import new_folder
from ros_pad.commands.progress import bar
from ros_pad.configuration import names
from ros_pad.contact import Foot, Material, Pad
from ros_pad.contact.layout import edge_of, hexagonal, reach_of
from ros_pad.contact.pad import Array
from ros_pad.errors import InvalidInput
from ros_pad.making import Part, Plan, build, plan
from ros_pad.making.files import stl
from ros_pad.making.solids import Solid, as_printed
from ros_pad.reports.mould_drawings import assembled, exploded, moulded
from ros_pad.reports.moulds import PRINTED, test_piece
from ros_pad.reports.style import STYLE
from studies import command

FEET = ('large37', 'large331', 'small217')
_OFF = 0.01  # share by which a volume may be off its formula: chords of circles
_EMPTY = 1e-3  # mm³ of overlap that is rounding


# --- judges --------------------------------------------------------------------------------------


def faults(made: Plan, parts: Mapping[str, Part], voxel: float | None = None) -> list[str]:
    """Return what is wrong with the parts of a foot, in words."""
    found = [f'{part.name} is not closed' for part in parts.values() if not closed(part)]
    found += [f'{part.name} is not flat on the bed' for part in parts.values() if not lies(part)]
    found += [f'{name}: volume' for name, off in volumes(made, parts) if abs(off) > _OFF]
    found += overlaps(made, parts)
    found += undercuts(parts)
    found += thicknesses(made, parts)
    return found + leaks(made, parts, voxel or min(max(0.3 * made.r['pad'], 0.05), 0.5))


def closed(part: Part) -> bool:
    """Return whether trimesh and admesh find the part closed, its faces turned outwards."""
    import trimesh

    data = stl(as_printed(part))
    mesh: Any = trimesh.load(io.BytesIO(data), file_type='stl')
    good = mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0.0
    if not shutil.which('admesh'):
        return bool(good)
    with tempfile.NamedTemporaryFile(suffix='.stl') as file:
        file.write(data)
        file.flush()
        output = subprocess.run(['admesh', file.name], capture_output=True, text=True).stdout
    # Of facets: before and after its repair; edges fixed, removed, added, reversed.
    apart = re.findall(r'disconnected edges? *: +(\d+)', output)
    mended = re.findall(r'(?:Edges fixed|Facets (?:re|ad)\w+|Backwards edges) *: *(\d+)', output)
    return bool(good and len(apart) == 3 and not any(map(int, [*apart, *mended])))


def lies(part: Part) -> bool:
    """Return whether a printed part has half of its outline or more on the bed."""
    solid = as_printed(part)
    return part.made not in PRINTED or solid.slice(0.05).area() > 0.5 * solid.project().area()


def _cone(low: float, high: float, start: float, end: float) -> float:
    """Return the volume of a cone between heights."""
    return math.pi / 3.0 * (high - low) * (start * start + start * end + end * end)


def volumes(made: Plan, parts: Mapping[str, Part]) -> Iterator[tuple[str, float]]:
    """Yield parts and how far their volumes are off the formulas of circles, as a share."""
    z, r, use, pads = made.z, made.r, made.set, made.foot.pads
    slope, gap, thick = made.slope, use['clearance'], max(4.0, 0.12 * r['outer'])

    def disc(radius: float, low: float, high: float) -> float:
        return _cone(low, high, radius, radius)

    large = made.process == 'large'
    seal = _cone(0.0, 1.0 if large else 2.0, r['gasket'], r['gasket'] - slope)
    wall = _cone(z['sheet'], z['flange'], r['sole'], r['bore'])
    pins = pads * _cone(z['sheet'], z['face'], r['pad'], r['root'])
    pegs = 3.0 * disc(1.5, 0.0, 3.0)
    mounts = use['mount_holes'] * disc(0.5 * use['mount_hole'], 0.0, 4.5)
    vents = 12.0 * 0.3 * 2.5  # up to the groove
    hollow = disc(r['flange'] + gap, z['flange'] - 0.5 * gap, z['top'])
    hollow = hollow if large else disc(r['gasket'], z['flange'], z['top'])
    formulas = {
        'lid': disc(r['outer'], 0.0, thick) - 3.0 * disc(1.5 + gap, 0.0, thick),
        'spacer': disc(r['outer'], 0.0, z['sheet'])
        - disc(r['sole'], 0.0, z['sheet'])
        - 3.0 * disc(1.5 + gap, 0.0, z['sheet']),
        'ring': disc(r['outer'], z['sheet'], z['top'])
        - wall
        + (disc(r['bore'], 0.0, 0.5 * gap) if large else 0.0)
        - hollow
        - vents
        - 3.0 * disc(1.5 + gap, 0.0, 3.5)
        - 3.0 * disc(1.5 + gap, 0.0, 4.5)
        + disc(r['sole'] + 2.5, 0.0, 1.0)
        - disc(r['sole'] + 4.0, 0.0, 1.0),
        'inner mould': disc(r['outer'], z['top'], z['face'] + 5.0) + pins + pegs,
        'cap': disc(r['flange'], z['stop'], z['cap'])
        - disc(r['plenum'], z['land'], z['roof'])
        - disc(0.5 * use['fitting'], z['roof'], z['cap'])
        - made.screws * disc(r['screw'], z['stop'], z['cap'])
        - mounts
        - (disc(r['gasket'] + 1.0, z['stop'], z['land']) if large else 0.0),
        'air': pins
        + disc(r['plenum'], z['face'], z['roof'])
        + disc(0.5 * use['fitting'], z['roof'], z['cap']),
    }
    sheet = disc(r['sole'], 0.0, z['sheet'])
    if large:
        core = disc(r['bone'], z['bone'], z['flange'])
        holes = pads * disc(r['hole'], z['bone'], z['top'])
        screws = made.screws * disc(r['thread'], z['flange'], z['top'])
        formulas['bone'] = core + disc(r['flange'], z['flange'], z['top']) - screws - holes
        formulas['silicone'] = sheet + wall - core + holes + seal - pins
        formulas['inner mould'] += 3.0 * disc(
            r['thread'] - 0.5 * gap, z['flange'] + 0.5, z['face']
        )
        formulas['inner mould'] -= seal
    else:
        low = z['flange'] - 3.0
        formulas |= {'sheet': sheet, 'body': wall + seal - pins}
        formulas['retainer'] = (
            disc(r['flange'], low, z['stop'])
            - made.screws * disc(r['thread'], low, z['stop'])
            - disc(r['bore'] + gap, low, z['flange'])
            - disc(r['gasket'] + 1.0, z['flange'], z['stop'])
        )
    for name, volume in formulas.items():
        yield name, parts[name].solid.volume() / volume - 1.0


def overlap(one: Solid, other: Solid) -> float:
    """Return the volume that two solids share, mm³.

    By intersection and by union: where faces coincide, one of them may invent a prism.
    """
    shared = (one ^ other).volume(), one.volume() + other.volume() - (one + other).volume()
    return min(shared) if min(shared) > _EMPTY else 0.0


def overlaps(made: Plan, parts: Mapping[str, Part]) -> list[str]:
    """Return pairs that overlap in the mould or in the foot, but for the seal that is squeezed."""
    found = []
    for group in (moulded(parts), assembled(parts)):
        for index, one in enumerate(group):
            for other in group[index + 1 :]:
                shared = overlap(one.solid, other.solid)
                if other.name == 'cap' and one.name in ('silicone', 'body'):
                    shared = _beside_the_seal(made, shared)
                if shared:
                    found.append(f'{one.name} and {other.name} overlap by {shared:.3g} mm³')
    return found


def _beside_the_seal(made: Plan, shared: float) -> float:
    """Return what cap and silicone share, mm³, if it is not the squeezed seal, and else 0."""
    z, r = made.z, made.r
    low = z['top'] if made.process == 'large' else z['flange']
    slope = made.slope
    share = (z['land'] - low) / (z['face'] - low)
    squeezed = _cone(z['land'], z['face'], r['gasket'] - share * slope, r['gasket'] - slope)
    squeezed -= math.pi * r['plenum'] ** 2 * (z['face'] - z['land'])
    return 0.0 if abs(shared / squeezed - 1.0) < _OFF else shared - squeezed


def undercuts(parts: Mapping[str, Part]) -> list[str]:
    """Return the parts that meet what they come off while they are drawn off, in 11 steps."""
    found = []
    cast = [parts[name].solid for name in ('bone', 'silicone', 'body', 'sheet') if name in parts]
    pegs = {'ring': 'inner mould', 'lid': 'ring', 'spacer': 'ring'}
    for name in ('lid', 'spacer', 'ring', 'inner mould'):
        part, stays = (
            parts[name],
            [*cast, *(parts[each].solid for each in [pegs.get(name)] if each)],
        )
        for step in np.geomspace(1e-2, 30.0, 11):
            moved = part.solid.translate((0.0, 0.0, part.leaves * float(step)))
            if any(overlap(moved, each) for each in stays):
                found.append(f'{name} meets what it comes off after {step:.2g} mm')
                break
    return found


def thicknesses(made: Plan, parts: Mapping[str, Part]) -> list[str]:
    """Return the pads whose sheet is more than 1 % off."""
    cast = parts['silicone' if made.process == 'large' else 'sheet'].solid
    kind, radius = type(cast), 0.8 * made.r['pad']
    column = kind.cylinder(made.z['face'] + 1.0, radius, radius, 24).translate((0.0, 0.0, -0.5))
    every = kind.compose([column.translate((x, y, 0.0)) for x, y in made.places.tolist()])
    area = column.slice(0.1).area()
    thick = [piece.volume() / area for piece in (every ^ cast).decompose()]
    off = [each for each in thick if abs(each / made.z['sheet'] - 1.0) > 0.01]
    found = [f'a sheet is {each:.4g} mm' for each in off]
    if len(thick) != made.foot.pads:
        found.append(f'{len(thick)} sheets under {made.foot.pads} pads')
    return found


def leaks(made: Plan, parts: Mapping[str, Part], voxel: float) -> list[str]:
    """Return pads that no air reaches from the inlet, and whether it gets out."""
    from scipy.ndimage import label

    solids = [part.solid for part in assembled(parts)]
    z = made.z
    outer = made.r['flange'] + 3.0 * voxel
    grid = np.arange(-outer, outer + voxel, voxel)
    low = min(0.25 * z['sheet'], voxel)
    levels = [
        -0.5 * voxel,
        low,
        0.75 * z['sheet'],
        *np.arange(z['sheet'] + 0.2 * voxel, z['cap'], voxel),
    ]
    filled = np.array([_filled(solids, level, grid) for level in levels])
    # A lid on the inlet, so that the air has no way out there.
    filled[-1] = True
    open_, _ = label(~filled)
    middle = len(grid) // 2
    inlet = open_[-2, middle, middle]
    if not inlet:
        return ['the inlet is closed']
    index = np.clip(np.rint((made.places + outer) / voxel).astype(int), 0, len(grid) - 1)
    reached = open_[3, index[:, 1], index[:, 0]] == inlet
    found = [f'no air reaches pad {number}' for number in np.flatnonzero(~reached)]
    return found + ['air gets out'] * bool(open_[0, 0, 0] == inlet)


def _filled(solids: Sequence[Solid], level: float, grid: Array) -> Array:
    """Return which points of a square grid at a height are inside one of the solids."""
    inside = np.zeros((len(grid), len(grid)), bool)
    for solid in solids:
        # Even-odd rule along the rows of the grid.
        turns = np.zeros((len(grid), len(grid) + 1), int)
        for polygon in solid.slice(level).to_polygons():
            ends = np.roll(polygon, -1, axis=0)
            low, high = (
                np.minimum(polygon[:, 1], ends[:, 1]),
                np.maximum(polygon[:, 1], ends[:, 1]),
            )
            row, edge = np.nonzero((grid[:, None] >= low) & (grid[:, None] < high))
            (x, y), (dx, dy) = polygon[edge].T, (ends - polygon)[edge].T
            column = np.searchsorted(grid, x + (grid[row] - y) * dx / dy)
            np.add.at(turns, (row, column), 1)
        inside |= turns[:, :-1].cumsum(axis=1) % 2 == 1
    return inside


# --- feet ----------------------------------------------------------------------------------------


def random_feet(count: int, seed: int) -> Iterator[Foot]:
    """Yield feet of random pads and silicones, on soles from too small to twice as large."""
    rng = np.random.default_rng(seed)
    start, materials = Foot.load('large37'), names('materials')
    for number in range(count):
        radius = float(np.exp(rng.uniform(math.log(0.3e-3), math.log(3e-3))))
        pads = int(np.exp(rng.uniform(0.0, math.log(250.0))))
        room = (2.6 * radius + 0.8e-3) * reach_of(hexagonal(pads)) + radius + edge_of(radius)
        silicones = rng.choice(materials, 2, replace=False).tolist()
        thickness = radius * float(rng.uniform(0.1, 0.6))
        pad = Pad.of(Material.load(silicones[0]), radius, thickness)
        yield replace(
            start,
            source=f'random {number}',
            pad=pad,
            pads=pads,
            sole_radius=float(rng.uniform(0.9, 1.5)) * max(room, 3e-3),
            sole_thickness=float(rng.uniform(3e-3, 10e-3)),
            ceiling=max(0.6 * _end(pad), 1.1e3),
            limit='flattening',
            silicones=tuple(silicones),
        )


def _end(pad: Pad) -> float:
    from ros_pad.contact.limits import largest_pressure

    return largest_pressure(pad)


def judged(foot: Foot) -> dict[str, Any]:
    """Return the verdict on a foot: refused with reasons, or made with faults."""
    start = time.perf_counter()
    try:
        made = plan(foot)
    except InvalidInput as error:
        return {'foot': foot.source, 'refused': str(error)}
    parts = build(made)
    spent = time.perf_counter() - start
    wrong = faults(made, parts)
    return {'foot': foot.source, 'process': made.process, 'faults': wrong, 'build_s': spent}


def sliced(part: Part) -> dict[str, str]:
    """Return layers, time and mass of a part by PrusaSlicer, in its default profiles."""
    resin = part.made == 'resin'
    how = _RESIN if resin else _FILAMENT
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        path, out = folder / 'part.stl', folder / ('part.sl1' if resin else 'part.gcode')
        path.write_bytes(stl(as_printed(part)))
        words = ['prusa-slicer', *how, '--layer-height', '0.05' if resin else '0.2']
        done = subprocess.run(
            [*words, '--output', str(out), str(path)], capture_output=True, text=True
        )
        if done.returncode or not out.exists():
            return {'layers': 'error', 'time': done.stderr.strip() or done.stdout.strip()}
        text = zipfile.ZipFile(out).read('config.ini').decode() if resin else out.read_text()
    output = dict(re.findall(r'^;? ?(\w[^=\n]*?) = (.*)$', text, re.MULTILINE))
    if resin:
        minutes, grams = float(output['printTime']) / 60.0, 1.15 * float(output['usedMaterial'])
        layers = str(int(output['numFast']) + int(output['numSlow']))
        return {'layers': layers, 'time': f'{minutes:.0f} min', 'grams': f'{grams:.1f}'}
    return {
        'layers': str(text.count(';LAYER_CHANGE')),
        'time': output['estimated printing time (normal mode)'],
        'grams': output['filament used [g]'],
    }


_RESIN = (
    *('--export-sla', '--printer-technology', 'SLA', '--initial-layer-height', '0.05'),
    *(
        '--bed-shape',
        '0x0,145x0,145x145,0x145',
        '--display-width',
        '145',
        '--display-height',
        '145',
    ),
)
# Arachne takes ten minutes for a bone with 331 holes.
_FILAMENT = (
    *('--export-gcode', '--filament-density', '1.04', '--perimeter-generator', 'classic'),
    *('--bed-shape', '0x0,250x0,250x210,0x210'),
)


def main(words: Sequence[str]) -> int:
    """Judge the feet; write tables and pictures; print all parts, and what is wrong."""
    part = command.parser('moulds', __doc__)
    command.add_out(part, None)
    command.add_count(part, '--random', 50, 'number of random feet', 0)
    command.add_count(part, '--seed', 3301, 'seed of the random feet', 0)
    options = part.parse_args(words)
    found: dict[str, list[dict[str, Any]]] = {'parts': [], 'feet': []}
    pictures = {}
    with bar('judging', 2.0 * len(FEET) + options.random, 'feet') as progress:
        for name in FEET:
            whole = plan(Foot.load(name))
            for made in (whole, test_piece(whole)):
                parts = build(made)
                verdict = {'foot': made.foot.source, 'faults': faults(made, parts)}
                found['feet'].append(verdict)
                found['parts'] += [
                    _row(made, each) for each in parts.values() if each.made != 'air'
                ]
                progress(len(found['feet']))
            with matplotlib.rc_context(STYLE):
                if name in ('large37', 'small217'):
                    pictures[f'moulds_{name}'] = exploded(whole, build(whole)).figure
        for foot in random_feet(options.random, options.seed):
            found['feet'].append(judged(foot))
            progress(len(found['feet']))
    command.write(options.out or new_folder(None, 'moulds'), 'moulds', found, pictures)
    table = command.listed(found['parts'])
    for one in found['feet']:
        table += f'\n{one["foot"]}: {one.get("refused") or one["faults"] or "no fault"}'
    refused = sum('refused' in one for one in found['feet'])
    wrong = sum(bool(one.get('faults')) for one in found['feet'])
    table += f'\n{len(found["feet"])} feet: {refused} refused, {wrong} with faults'
    command.show(options, found, table)
    return 1 if wrong else 0


def _row(made: Plan, part: Part) -> dict[str, Any]:
    row: dict[str, Any] = {
        'foot': made.foot.source,
        'part': part.name,
        'of': part.made,
        'triangles': part.solid.num_tri(),
        'cm3': round(1e-3 * part.solid.volume(), 3),
        'closed': closed(part),
    }
    output = sliced(part) if part.made in PRINTED and shutil.which('prusa-slicer') else {}
    return row | {'layers': '', 'time': '', 'grams': ''} | output
