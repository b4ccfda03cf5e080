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
from ros_pad.commands.command import Commands, add_command, complain, named
from ros_pad.commands.folder import check_pictures
from ros_pad.commands.progress import bar
from ros_pad.configuration import integer, number
from ros_pad.contact import THESIS_LIQUID, WATER, Liquid
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.errors import InvalidInput, MeshError, NoSurface

LIQUIDS = {'water': WATER, 'thesis': THESIS_LIQUID}
# Of each shape: function that makes it, and its sizes, in the order of that function.
SHAPES: dict[str, tuple[Callable[..., Mesh], tuple[str, ...]]] = {
    'dome': (Mesh.dome, ('radius', 'contact_radius', 'height')),
    'cone': (Mesh.cone, ('contact_radius', 'top_radius', 'height')),
    'cylinder': (Mesh.cylinder, ('radius', 'height')),
    'pattern': (Mesh.dome_pattern, ('pads', 'pitch', 'radius', 'contact_radius', 'height')),
}
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
# Relative errors of heights that are returned, as measured at commit 07dfc820 by a study.
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


# Of each option that is a number: in place of a value, help.
_NUMBERS = {
    'radius': ('M', 'radius of sphere or cylinder, m'),
    'contact-radius': ('M', 'radius of the contact disc, m'),
    'top-radius': ('M', 'radius of a cone at its top, m'),
    'height': ('M', 'm (default for a dome: up to its widest section)'),
    'pitch': ('M', 'distance of pads in a pattern, m'),
    'scale': ('S', 'unit of a file in m: 1e-3 for mm (1)'),
    'tension': ('N/M', 'surface tension of another liquid, N/m'),
    'angle': ('DEG', 'contact angle, degrees'),
    'density': ('KG/M3', 'density, kg/m³'),
    'area': ('M2', 'of all pads with the gaps between them, m²'),
    'direction': ('DEG', 'azimuth of the force, degrees (0)'),
}


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    example = 'pad wet dome --radius 1.55e-3 --contact-radius 0.6e-3 --figure dome.png'
    part = add_command(commands, 'wet', run, _DESCRIPTION, example)
    add = part.add_argument
    add('mesh', metavar='MESH', help=f'a file, or one of: {", ".join(SHAPES)}')
    for name, (unit, text) in _NUMBERS.items():
        add(f'--{name}', type=float, metavar=unit, help=text)
    add('--pads', type=int, metavar='N', help='number of pads on the area')
    text = "surface tensions of water on silicone (default), or those of the thesis' appendix"
    add('--liquid', choices=tuple(LIQUIDS), default='water', help=text)
    add('--method', choices=('layers', 'energy'), default='layers', help='see above (%(default)s)')
    add('--balance', choices=BALANCES, help='of layers: what gives the height (energy)')
    text = 'also accept heights with large errors: to compare, not to use'
    add('--loose', action='store_true', help=text)
    text = 'number of layers from floor to top (100; many pads 200)'
    add('--layers', type=int, metavar='N', help=text)
    angles = ('ADVANCING', 'RECEDING')
    text = 'contact angles, degrees: the capillary force is then that of the pinned line'
    add('--hysteresis', type=float, nargs=2, metavar=angles, help=text)
    add('--figure', metavar='FILE', help='draw the wetted mesh into a .png, .pdf or .svg')
    add('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Find the height of the liquid on the mesh and print it; return the exit status."""
    direction = math.radians(
        number('--direction', options.direction or 0.0, 'degrees', low=-math.inf)
    )
    check_pictures(options.figure)
    liquid = _liquid(options)
    try:
        with bar('wetting', 2.0, 'steps', delay=1.0) as progress:
            mesh = _mesh(options)
            progress(1.0)
            started = time.perf_counter()
            found = _wet(mesh, liquid, options)
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
        **_values(found, direction),
        'height_error': _error(found, options.loose),
        'capillary_force_n': _of_a_foot(found, options, direction),
        'figure': options.figure,
    }
    if options.figure is not None:
        from ros_pad.reports import wetted

        wetted.draw(options.figure, mesh, found, direction)
    if options.json:
        print(json.dumps({name: _plain(value) for name, value in values.items()}))
    else:
        _show(values)
    if values['status'] == 'ok' or isinstance(found, WetSurface):
        return 0
    worst = Counter(np.atleast_1d(found.status).tolist())
    worst.pop('ok', None)
    name, _ = worst.most_common(1)[0]
    advice = _ADVICE.get(f'{name} {found.balance}', _ADVICE[name])
    return complain(f'no valid height, status {values["status"]}: {advice}', 1)


def _liquid(options: argparse.Namespace) -> Liquid:
    if options.tension is not None and options.angle is None:
        raise InvalidInput('--tension needs --angle: the contact angle depends on the liquid')
    liquid = LIQUIDS[options.liquid]
    given = {'surface_tension': options.tension, 'density': options.density}
    angle = liquid.angle if options.angle is None else math.radians(options.angle)
    changes = {name: value for name, value in given.items() if value is not None}
    return replace(liquid, **changes, contact_angle=angle)


def _mesh(options: argparse.Namespace) -> Mesh:
    of_shapes = {name for _, sizes in SHAPES.values() for name in sizes} - {'pads'}
    given = {name for name in {*of_shapes, 'scale'} if getattr(options, name) is not None}
    if options.mesh not in SHAPES:
        if other := min(given - {'scale'}, default=None):
            raise InvalidInput(
                f'{_option(other)} is only for shapes, and {options.mesh} is a file'
            )
        return Mesh.read(options.mesh, scale=1.0 if options.scale is None else options.scale)
    make, sizes = SHAPES[options.mesh]
    optional = 'height' if 'contact_radius' in sizes and 'radius' in sizes else ''
    if missing := [
        _option(name) for name in sizes if name != optional and getattr(options, name) is None
    ]:
        raise InvalidInput(f'a {options.mesh} needs {" ".join(missing)}')
    if other := min(given - {*sizes}, default=None):
        raise InvalidInput(f'{_option(other)} is no option of the mesh {options.mesh}')
    if options.mesh == 'pattern' and options.method == 'energy':
        # One of many equal pads is drawn and computed.
        number('--pitch', options.pitch, 'm', above=True)
        make, sizes = SHAPES['dome']
    return make(*(getattr(options, name) for name in sizes))


def _wet(mesh: Mesh, liquid: Liquid, options: argparse.Namespace) -> Wet | WetPattern | WetSurface:
    """Solve by the method that the options ask for."""
    area, pads = options.area, options.pads
    if options.mesh == 'pattern' and area is None:  # each dome has its hexagon in the pattern
        area = math.sqrt(0.75) * options.pitch**2 * pads
    if area is None and pads is not None:
        raise InvalidInput('--pads needs --area, the area of all pads, m²')
    pads = 1 if pads is None else integer('pads', pads, 1)
    if options.method == 'energy':
        for name in ('balance', 'layers', 'loose'):
            if getattr(options, name) not in (None, False):
                raise InvalidInput(f'{_option(name)} is only for --method layers')
        cell = None if area is None else number('--area', area, 'm²', above=True) / pads
        return wet_surface(mesh, liquid, cell)
    layers, strict = options.layers, not options.loose
    balance = options.balance or 'energy'
    if area is None:
        return wet(mesh, liquid, balance, 100 if layers is None else layers, strict=strict)
    if options.hysteresis is not None:
        raise InvalidInput('--hysteresis is for a single pad, which has one contact line')
    pads = 1 if options.mesh == 'pattern' else pads
    return wet_pattern(
        mesh, liquid, area, pads, balance, 200 if layers is None else layers, strict
    )


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


def _error(found: Wet | WetPattern | WetSurface, loose: bool) -> list[float] | None:
    """Return the lowest and highest relative error of the height; None where it has no bound."""
    if isinstance(found, WetSurface):
        return [-found.error, found.error]
    if loose:
        return None
    return list(_ERROR_OF_LEVEL if isinstance(found, WetPattern) else _ERRORS[found.balance])


def _of_a_foot(
    found: Wet | WetPattern | WetSurface, options: argparse.Namespace, direction: float
) -> float | None:
    """Return the value of the key ``capillary_force`` in the file of a foot, N for each pad."""
    if isinstance(found, WetPattern):
        return abs(found.force) / (options.pads or 1)
    if options.hysteresis is None:
        # Exact surfaces pull a symmetric pad as much to one side as to the other.
        return None if isinstance(found, WetSurface) else abs(found.force(direction))
    advancing, receding = map(math.radians, options.hysteresis)
    return found.hysteresis_force(direction, advancing, receding)


def _show(values: dict[str, Any]) -> None:
    """Print each name as words with its value and unit; leave out None and arrays."""
    shown = {k: v for k, v in values.items() if not (v is None or isinstance(v, np.ndarray))}
    rows = [named(name, value) for name, value in shown.items()]
    width = max(len(words) for words, _ in rows)
    for words, text in rows:
        print(f'{words:{width}}  {text}')


def _plain(value: Any) -> Any:
    """Return a value for JSON: lists for arrays, null for NaN."""
    if isinstance(value, np.ndarray):
        return [_plain(each) for each in value.tolist()]
    return None if isinstance(value, float) and math.isnan(value) else value
