# SPDX-License-Identifier: Apache-2.0
"""``pad wet``: compute how high liquid rises on a pad of any shape, and its force on the pad."""

from __future__ import annotations

import argparse
import json
import math
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ros_pad.capillary import Mesh, Wet, WetPattern, WetSurface, wet, wet_pattern, wet_surface
from ros_pad.capillary.layers import BALANCES
from ros_pad.commands.command import Commands, add_command, complain
from ros_pad.commands.folder import check_pictures
from ros_pad.commands.progress import bar
from ros_pad.configuration import integer, number
from ros_pad.contact import THESIS_LIQUID, WATER, Liquid
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.errors import InvalidInput, MeshError, NoSurface

LIQUIDS = {'water': WATER, 'thesis': THESIS_LIQUID}
# Of each shape: function that makes it, sizes that it needs, sizes that it allows.
SHAPES: dict[str, tuple[Callable[..., Mesh], tuple[str, ...], tuple[str, ...]]] = {
    'dome': (Mesh.dome, ('radius', 'contact_radius'), ('height', 'rings', 'sectors')),
    'cone': (Mesh.cone, ('contact_radius', 'top_radius', 'height'), ('rings', 'sectors')),
    'cylinder': (Mesh.cylinder, ('radius', 'height'), ('rings', 'sectors')),
    'pattern': (
        Mesh.dome_pattern,
        ('pads', 'pitch', 'radius', 'contact_radius'),
        ('height', 'rings', 'sectors'),
    ),
}
_SIZES = ('radius', 'contact_radius', 'top_radius', 'height', 'pitch', 'rings', 'sectors')
_ADVICE = {
    'dry': 'by this balance the liquid does not rise: it does not wet the wall enough',
    'coarse': 'the layers are too thick for this rise: use more --layers, or cut the mesh lower',
    'saturated': 'the liquid would rise above the top of the mesh',
    'no_circle': 'no arc of a circle fits between wall and floor: this wall needs another method',
    'far_off': 'this balance has no equilibrium or no arc on this wall: try --balance energy;'
    ' --loose accepts the height',
    'far_off energy': 'on slender or wholly wetted walls, arcs are wrong by a sixth or more: use'
    ' --method energy; --loose accepts the height',
    'far_apart': 'in gaps this wide the surface is not level: use --method energy; --loose accepts'
    ' a level surface',
}
# Relative errors of heights that are returned, as measured by `studies liquid_limits`.
_ERRORS = {'energy': (-0.14, 0.18), 'force': (-0.13, 0.29), 'thesis': (-0.13, 0.29)}
_ERROR_OF_LEVEL = (-0.03, 0.0)
_DESCRIPTION = """\
Compute how high liquid rises on a pad that stands on a wet floor, and its force.

MESH is a closed STL, OBJ, PLY or MSH file (pip install 'ros_pad[mesh]'), z up, \
the floor at z = 0, or one of these shapes:
  dome      --radius (of the sphere) --contact-radius [--height]
  cone      --contact-radius --top-radius --height
  cylinder  --radius --height
  pattern   --pads --pitch --radius --contact-radius [--height]: domes in a hexagonal layout
With --area, or for a pattern, the liquid stands between many pads.

Methods:
  layers    the thesis': arcs of a circle round a pad, a level surface between many; fast
  energy    a surface of triangles of least energy: some seconds, errors below 1 %

  height error     of layers the range that a study measured, of energy an estimate from a \
coarser mesh
  pull             towards the floor, of method energy
  pressure         of the liquid, relative to the air: below 0 the liquid pulls
  force            pressure times projected section: the thesis' estimate of the force on one \
side of the pad; it is no bound. The liquid on the other side pulls back; on a symmetric pad the \
sum is 0
  capillary force  value for the key capillary_force in the file of a foot, N for each pad: the \
size of that estimate (method layers), or with --hysteresis the largest force of a pinned contact \
line (both methods)"""


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'wet',
        run,
        _DESCRIPTION,
        'pad wet dome --radius 1.55e-3 --contact-radius 0.6e-3 --figure dome.png',
    )
    part.add_argument('mesh', metavar='MESH', help=f'a file, or one of: {", ".join(SHAPES)}')
    _add_mesh(part)
    _add_liquid(part)
    _add_method(part)
    part.add_argument(
        '--figure', metavar='FILE', help='draw the wetted mesh into a .png, .pdf or .svg'
    )
    part.add_argument('--json', action='store_true', help='print one JSON object')


def _add_mesh(part: argparse.ArgumentParser) -> None:
    shape = part.add_argument_group('shapes')
    for name, text in (
        ('radius', 'radius of sphere or cylinder, m'),
        ('contact-radius', 'radius of the contact disc, m'),
        ('top-radius', 'radius of a cone at its top, m'),
        ('height', 'm (default for a dome: up to its widest section)'),
        ('pitch', 'distance of pads in a pattern, m'),
    ):
        shape.add_argument(f'--{name}', type=float, metavar='M', help=text)
    text = 'number of bands of triangles from floor to top'
    shape.add_argument('--rings', type=int, metavar='N', help=text)
    text = 'number of triangles round the axis'
    shape.add_argument('--sectors', type=int, metavar='N', help=text)
    file = part.add_argument_group('files')
    text = 'unit of the file in m: 1e-3 for mm (1)'
    file.add_argument('--scale', type=float, metavar='S', help=text)
    file.add_argument('--lift', type=float, metavar='M', help='added to all heights, m (0)')
    text = 'reverse the faces of a mesh that is inside out'
    file.add_argument('--flip', action='store_true', help=text)


def _add_liquid(part: argparse.ArgumentParser) -> None:
    liquid = part.add_argument_group('liquid').add_argument
    text = "surface tensions of water on silicone (default), or those of the thesis' appendix"
    liquid('--liquid', choices=tuple(LIQUIDS), default='water', help=text)
    liquid('--tension', type=float, metavar='N/M', help='surface tension of another liquid, N/m')
    liquid('--angle', type=float, metavar='DEG', help='contact angle, degrees')
    liquid('--density', type=float, metavar='KG/M3', help='density, kg/m³')
    many = part.add_argument_group('many pads').add_argument
    many('--pads', type=int, metavar='N', help='number of pads on the area')
    many('--area', type=float, metavar='M2', help='of all pads with the gaps between them, m²')


def _add_method(part: argparse.ArgumentParser) -> None:
    add = part.add_argument
    add('--method', choices=('layers', 'energy'), default='layers', help='see above (%(default)s)')
    add('--balance', choices=BALANCES, help='of layers: what gives the height (energy)')
    text = 'also accept heights with large errors: to compare, not to use'
    add('--loose', action='store_true', help=text)
    text = 'number of layers from floor to top (100; many pads 200)'
    add('--layers', type=int, metavar='N', help=text)
    add('--slices', type=int, metavar='N', help='number of slices round the axis (36)')
    text = 'azimuth of the force, degrees (0)'
    add('--direction', type=float, default=0.0, metavar='DEG', help=text)
    angles = ('ADVANCING', 'RECEDING')
    text = 'contact angles, degrees: the capillary force is then that of the pinned line'
    add('--hysteresis', type=float, nargs=2, metavar=angles, help=text)


def run(options: argparse.Namespace) -> int:
    """Find the height of the liquid on the mesh and print it; return the exit status."""
    number('--direction', options.direction, 'degrees', low=-math.inf)
    check_pictures(options.figure)
    liquid = _liquid(options)
    try:
        with bar('wetting', 2.0, 'steps', delay=1.0) as progress:
            mesh = _mesh(options)
            progress(1.0)
            many = options.area is not None or options.mesh == 'pattern'
            if options.pads is not None and not many:
                raise InvalidInput('--pads needs --area, the area of all pads, m²')
            started = time.perf_counter()
            found: Wet | WetPattern | WetSurface
            if options.method == 'energy':
                found = _of_least_energy(mesh, liquid, options)
            else:
                found = (_between if many else _round)(mesh, liquid, options)
            spent = time.perf_counter() - started
            progress(2.0)
    except NoSurface as error:
        return complain(f'no surface of least energy, status {error.status}: {error}', 1)
    except MeshError as error:
        return complain(error, 2)
    values = {
        'mesh': options.mesh,
        'faces': len(mesh.faces),
        'surface_tension_n_per_m': liquid.surface_tension,
        'contact_angle_deg': math.degrees(liquid.angle),
        'density_kg_per_m3': liquid.density,
        'method': options.method,
        'time_s': spent,
        **_values(found, math.radians(options.direction)),
        'height_error': _error(found, options),
        'capillary_force_n': _of_a_foot(found, options),
        'figure': options.figure,
    }
    rows = _rows(values)
    if options.figure is not None:
        from ros_pad.reports import wetted

        wetted.draw(options.figure, mesh, found, math.radians(options.direction))
    if options.json:
        print(json.dumps({name: _plain(value) for name, value in values.items()}))
    else:
        width = max(len(words) for words, _ in rows)
        for words, value in rows:
            print(f'{words:{width}}  {value}')
    if values['status'] == 'ok' or isinstance(found, WetSurface):
        return 0
    worst = Counter(np.atleast_1d(found.status).tolist())
    worst.pop('ok', None)
    name, _ = worst.most_common(1)[0]
    advice = _ADVICE.get(f'{name} {found.balance}', _ADVICE[name])
    return complain(f'no valid height, status {values["status"]}: {advice}', 1)


def _liquid(options: argparse.Namespace) -> Liquid:
    liquid = LIQUIDS[options.liquid]
    if options.tension is not None and options.angle is None:
        raise InvalidInput('--tension needs --angle: the contact angle depends on the liquid')
    angle = liquid.angle if options.angle is None else math.radians(options.angle)
    return replace(
        liquid,
        surface_tension=liquid.surface_tension if options.tension is None else options.tension,
        density=liquid.density if options.density is None else options.density,
        contact_angle=angle,
    )


def _mesh(options: argparse.Namespace) -> Mesh:
    given = {name for name in _SIZES if getattr(options, name) is not None}
    of_files = {'scale', 'lift'} & {k for k, v in vars(options).items() if v is not None}
    if options.mesh not in SHAPES:
        if given:
            raise InvalidInput(
                f'{_option(min(given))} is only for shapes, and {options.mesh} is a file'
            )
        return Mesh.read(
            options.mesh,
            scale=1.0 if options.scale is None else options.scale,
            lift=0.0 if options.lift is None else options.lift,
            flip=options.flip,
        )
    make, needed, allowed = SHAPES[options.mesh]
    missing = [name for name in needed if getattr(options, name) is None]
    if missing:
        raise InvalidInput(f'a {options.mesh} needs {" ".join(map(_option, missing))}')
    other = sorted(of_files | given - {*needed, *allowed})
    if other or options.flip:
        name = _option(other[0] if other else 'flip')
        raise InvalidInput(f'{name} is no option of the mesh {options.mesh}')
    sizes = {
        name: getattr(options, name) for name in (*needed, *allowed) if name in given | {'pads'}
    }
    if options.mesh == 'pattern' and options.method == 'energy':
        # One of many equal pads is drawn and computed.
        make = Mesh.dome
        number('--pitch', sizes.pop('pitch'), 'm', above=True)
        integer('--pads', sizes.pop('pads'), 1)
    if options.mesh in ('dome', 'pattern'):
        sizes['sphere_radius'] = sizes.pop('radius')
    if options.mesh != 'pattern':
        sizes.pop('pads', None)
    return make(**sizes)


def _round(mesh: Mesh, liquid: Liquid, options: argparse.Namespace) -> Wet:
    return wet(
        mesh,
        liquid,
        options.balance or 'energy',
        100 if options.layers is None else options.layers,
        36 if options.slices is None else options.slices,
        strict=not options.loose,
    )


def _between(mesh: Mesh, liquid: Liquid, options: argparse.Namespace) -> WetPattern:
    if options.hysteresis is not None:
        raise InvalidInput('--hysteresis is for a single pad, which has one contact line')
    if options.slices is not None:
        raise InvalidInput('--slices is for a single pad: between many pads the surface is level')
    pads, area = 1 if options.pads is None else options.pads, options.area
    if options.mesh == 'pattern':
        # Without --area, each dome has the area of its hexagon in the pattern.
        cells = math.sqrt(0.75) * options.pitch**2 * pads
        pads, area = 1, cells if area is None else area
    layers = 200 if options.layers is None else options.layers
    strict = not options.loose
    return wet_pattern(mesh, liquid, area, pads, options.balance or 'energy', layers, strict)


def _of_least_energy(mesh: Mesh, liquid: Liquid, options: argparse.Namespace) -> WetSurface:
    for name in ('balance', 'layers', 'slices', 'loose'):
        if getattr(options, name) not in (None, False):
            raise InvalidInput(f'{_option(name)} is only for --method layers')
    area = options.area
    if area is not None:
        pads = 1 if options.pads is None else integer('pads', options.pads, 1)
        area = number('--area', area, 'm²', above=True) / pads
    elif options.mesh == 'pattern':
        area = math.sqrt(0.75) * options.pitch**2
    return wet_surface(mesh, liquid, area)


def _option(name: str) -> str:
    return f'--{name.replace("_", "-")}'


def _values(found: Wet | WetPattern | WetSurface, direction: float) -> dict[str, Any]:
    if isinstance(found, WetSurface):
        away = found.line[:, :2] - found.axis
        height = found.mean_height
        return {
            'status': 'ok',
            'height_m': height,
            'height_spread_m': float(np.ptp(found.line[:, 2])),
            'ring_radius_m': float(np.hypot(*away.T).mean()),
            'pressure_pa': -found.liquid.density * GRAVITY * height,
            'volume_m3': found.volume,
            'pull_n': float(-found.force[2]),
            'azimuths_deg': np.degrees(np.mod(np.arctan2(*away.T[::-1]), 2.0 * math.pi)),
            'heights_m': found.line[:, 2],
        }
    if isinstance(found, WetPattern):
        return {
            'balance': found.balance,
            'status': found.status,
            'height_m': found.height,
            'pressure_pa': found.pressure,
            'volume_m3': found.volume,
            'void_area_m2': found.void_area,
            'section_m2': found.section,
            'force_n': found.force,
        }
    kinds = Counter(found.status.tolist())
    return {
        'balance': found.balance,
        'status': ', '.join(f'{name} {count}' for name, count in kinds.items())
        if len(kinds) > 1
        else found.status[0].item(),
        'height_m': found.mean_height,
        'height_spread_m': found.height_spread,
        'ring_radius_m': float(np.mean(found.ring_radii)),
        'curvature_radius_m': float(np.mean(found.curvature_radius)),
        'pressure_pa': float(np.mean(found.pressure)),
        'section_m2': found.section(direction),
        'force_n': found.force(direction),
        'direction_deg': math.degrees(direction),
        'azimuths_deg': np.degrees(found.azimuths),
        'heights_m': found.heights,
        'statuses': found.status,
    }


def _error(
    found: Wet | WetPattern | WetSurface, options: argparse.Namespace
) -> list[float] | None:
    """Return the lowest and highest relative error of the height; None where it has no bound."""
    if isinstance(found, WetSurface):
        return [-found.error, found.error]
    if options.loose:
        return None
    return list(_ERROR_OF_LEVEL if isinstance(found, WetPattern) else _ERRORS[found.balance])


def _of_a_foot(found: Wet | WetPattern | WetSurface, options: argparse.Namespace) -> float | None:
    """Return the value of the key ``capillary_force`` in the file of a foot, N for each pad."""
    direction = math.radians(options.direction)
    if isinstance(found, WetPattern):
        return abs(found.force) / (options.pads or 1)
    if options.hysteresis is None:
        # Exact surfaces pull a symmetric pad as much to one side as to the other.
        return None if isinstance(found, WetSurface) else abs(found.force(direction))
    advancing, receding = map(math.radians, options.hysteresis)
    return found.hysteresis_force(direction, advancing, receding)


_UNITS = {
    'n_per_m': 'N/m', 'kg_per_m3': 'kg/m³', 'm': 'm', 'm2': 'm²', 'm3': 'm³', 'pa': 'Pa',
    'n': 'N', 'deg': '°', 's': 's',
}  # fmt: skip


def _rows(values: dict[str, Any]) -> list[tuple[str, str]]:
    """Return each name as words with its value and unit; leave out None and arrays."""
    rows = []
    for name, value in values.items():
        if value is None or isinstance(value, np.ndarray):
            continue
        unit = next(
            (unit for unit in sorted(_UNITS, key=len, reverse=True) if name.endswith(f'_{unit}')),
            None,
        )
        words = (name if unit is None else name.removesuffix(f'_{unit}')).replace('_', ' ')
        if isinstance(value, list):
            text = ' to '.join(f'{100.0 * share:+.2g} %' for share in value)
        elif isinstance(value, float):
            text = 'no answer' if math.isnan(value) else f'{value:.6g} {_UNITS[unit or "m"]}'
        else:
            text = str(value)
        rows.append((words, text))
    return rows


def _plain(value: Any) -> Any:
    """Return a value for JSON: lists for arrays, null for NaN."""
    if isinstance(value, np.ndarray):
        return [_plain(each) for each in value.tolist()]
    return None if isinstance(value, float) and math.isnan(value) else value
