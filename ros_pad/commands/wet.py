# SPDX-License-Identifier: Apache-2.0
"""Compute how high liquid rises on a pad that stands on a wet floor, and its force.

MESH is a closed STL, OBJ, PLY or MSH file (pip install 'ros_pad[mesh]'), z up, the floor at z = 0,
or one of these shapes:
  dome      --radius (of the sphere) --contact-radius [--height]
  cone      --contact-radius --top-radius --height
  cylinder  --radius --height
  pattern   --pads --pitch --radius --contact-radius [--height]: domes in a hexagonal layout
With --area, or for a pattern, the liquid stands between many pads.

Methods:
  layers    the thesis': arcs of a circle round a pad, a level surface between many; fast
  energy    a surface of triangles of least energy: some seconds, errors below 1 %

  height error     of layers the range that a study measured, of energy an estimate from a
                   coarser mesh
  pull             towards the floor, of method energy
  pressure         of the liquid, relative to the air: below 0 the liquid pulls
  force            pressure times projected section: the thesis' estimate of the force on one
                   side of the pad; it is no bound. The liquid on the other side pulls back; on a
                   symmetric pad the sum is 0
  capillary force  value for the key capillary_force in the file of a foot, N for each pad: the
                   size of that estimate (method layers), or with --hysteresis the largest force
                   of a pinned contact line (both methods)

For example:
  pad wet dome --radius 1.55e-3 --contact-radius 0.6e-3 --figure dome.png
  pad wet my_pad.stl --scale 1e-3 --tension 0.05 --angle 70
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ros_pad.capillary import Mesh, Wet, WetPattern, WetSurface, wet, wet_pattern, wet_surface
from ros_pad.capillary.layers import BALANCES
from ros_pad.commands.command import FILE, Commands, add_command, complain, named
from ros_pad.commands.folder import check_picture
from ros_pad.commands.progress import bar
from ros_pad.configuration import integer, number
from ros_pad.contact import THESIS_LIQUID, WATER, Liquid
from ros_pad.errors import InvalidInput, MeshError, NoSurface

LIQUIDS = {'water': WATER, 'thesis': THESIS_LIQUID}
# Of each shape: function that makes it, the sizes that it needs in the order of that function,
# and one that may be left out.
SHAPES: dict[str, tuple[Callable[..., Mesh], tuple[str, ...], str]] = {
    'dome': (Mesh.dome, ('radius', 'contact_radius'), 'height'),
    'cone': (Mesh.cone, ('contact_radius', 'top_radius', 'height'), ''),
    'cylinder': (Mesh.cylinder, ('radius', 'height'), ''),
    'pattern': (Mesh.dome_pattern, ('pads', 'pitch', 'radius', 'contact_radius'), 'height'),
}
_ADVICE = {
    'dry': 'by this balance the liquid does not rise: it does not wet the wall enough',
    'coarse': 'the layers are too thick for this rise: use more --layers, or cut the mesh lower',
    'saturated': 'the liquid would rise above the top of the mesh',
    'no_circle': 'no arc of a circle fits between wall and floor: this wall needs another method',
    'far_off': 'this balance has no equilibrium or no arc on this wall: try --balance energy',
    'far_off energy': 'on slender or wholly wetted walls, arcs are wrong by a sixth or more: use'
    ' --method energy',
    'far_apart': 'in gaps this wide the surface is not level: use --method energy',
}
# Relative errors of heights that are returned, as measured at commit 07dfc820 by a study.
_ERRORS = {'energy': (-0.14, 0.18), 'force': (-0.13, 0.29), 'thesis': (-0.13, 0.29)}
_ERROR_OF_LEVEL = (-0.03, 0.0)
_SIZES = {
    'radius': 'radius of sphere or cylinder, m',
    'contact_radius': 'radius of the contact disc, m',
    'top_radius': 'radius of a cone at its top, m',
    'height': 'm (default for a dome: up to its widest section)',
    'pitch': 'distance of pads in a pattern, m',
    'scale': 'unit of a file in m: 1e-3 for mm (1)',
}


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'wet', run, __doc__)
    add = part.add_argument
    add('mesh', metavar='MESH', help='shape or file, see above')
    for name, text in _SIZES.items():
        add(_option(name), type=float, metavar='M', help=text)
    add('--pads', type=int, metavar='N', help='how many pads: of a pattern, or with --area (1)')
    add('--liquid', choices=LIQUIDS, default='water', help='water (default) or that of the thesis')
    add('--tension', type=float, metavar='N/M', help='surface tension of another liquid, N/m')
    add('--angle', type=float, metavar='DEG', help='contact angle, degrees')
    add('--density', type=float, metavar='KG/M3', help='density, kg/m³')
    add('--area', type=float, metavar='M2', help='of all pads with the gaps between them, m²')
    add(
        '--direction', type=float, default=0.0, metavar='DEG', help='azimuth of force, degrees (0)'
    )
    add('--method', choices=('layers', 'energy'), default='layers', help='see above (layers)')
    add('--balance', choices=BALANCES, help='of layers: what gives the height (energy)')
    text = 'number of layers from floor to top (100; many pads 200)'
    add('--layers', type=int, metavar='N', help=text)
    angles = ('ADVANCING', 'RECEDING')
    text = 'contact angles, degrees: the capillary force is then that of the pinned line'
    add('--hysteresis', type=float, nargs=2, metavar=angles, help=text)
    add('--figure', help='draw the wetted mesh into a new .png, .pdf or .svg', **FILE)
    add('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Find the height of the liquid on the mesh and print it; return the exit status."""
    direction = math.radians(number('--direction', options.direction, 'degrees', low=-math.inf))
    check_picture(options.figure)
    liquid = _liquid(options)
    try:
        with bar('wetting', 2.0, 'steps') as progress:
            mesh = _mesh(options)
            progress(1.0)
            started = time.perf_counter()
            found = _wet(mesh, liquid, options)
            spent = time.perf_counter() - started
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
        'capillary_force_n': _of_a_foot(found, options, direction),
        'figure': options.figure and str(options.figure),
    }
    if options.figure is not None:
        from ros_pad.reports.files import write_picture
        from ros_pad.reports.wetted import draw

        write_picture(options.figure, lambda: draw(mesh, found, direction))
    if options.json:
        # JSON has no NaN.
        print(json.dumps({name: None if v != v else v for name, v in values.items()}))
    else:
        rows = [named(name, value) for name, value in values.items() if value is not None]
        width = max(len(words) for words, _ in rows)
        print(*(f'{words:{width}}  {text}' for words, text in rows), sep='\n')
    if isinstance(found, WetSurface) or values['status'] == 'ok':
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
    of_file = partial(Mesh.read, options.mesh), (), 'scale'
    make, needed, optional = SHAPES.get(options.mesh, of_file)
    if missing := [_option(name) for name in needed if getattr(options, name) is None]:
        raise InvalidInput(f'a {options.mesh} needs {" ".join(missing)}')
    for name in {*_SIZES} - {*needed, optional}:
        if getattr(options, name) is not None:
            raise InvalidInput(f'{_option(name)} is no option of the mesh {options.mesh}')
    if options.mesh == 'pattern' and options.method == 'energy':
        # One of many equal pads is drawn and computed.
        number('--pitch', options.pitch, 'm', above=True)
        make, needed, optional = SHAPES['dome']
    sizes = [getattr(options, name) for name in (*needed, optional) if name]
    return make(*(each for each in sizes if each is not None))


def _wet(mesh: Mesh, liquid: Liquid, options: argparse.Namespace) -> Wet | WetPattern | WetSurface:
    """Solve by the method that the options ask for."""
    area, pads = options.area, options.pads
    if options.mesh == 'pattern' and area is None:  # each dome has its hexagon in the pattern
        area = math.sqrt(0.75) * options.pitch**2 * pads
    if area is None and pads is not None:
        raise InvalidInput('--pads needs --area, the area of all pads, m²')
    pads = 1 if pads is None else integer('pads', pads, 1)
    if options.method == 'energy':
        for name in ('balance', 'layers'):
            if getattr(options, name) is not None:
                raise InvalidInput(f'{_option(name)} is only for --method layers')
        cell = None if area is None else number('--area', area, 'm²', above=True) / pads
        return wet_surface(mesh, liquid, cell)
    layers, balance = options.layers, options.balance or 'energy'
    if area is None:
        return wet(mesh, liquid, balance, 100 if layers is None else layers)
    if options.hysteresis is not None:
        raise InvalidInput('--hysteresis is for a single pad, which has one contact line')
    pads = 1 if options.mesh == 'pattern' else pads
    return wet_pattern(mesh, liquid, area, pads, balance, 200 if layers is None else layers)


def _option(name: str) -> str:
    return f'--{name.replace("_", "-")}'


def _values(found: Wet | WetPattern | WetSurface, direction: float) -> dict[str, Any]:
    """Return what is known of the liquid, by name with unit."""
    if isinstance(found, WetSurface):
        height = found.mean_height
        return {
            'status': 'ok',
            'height_m': height,
            'height_error': [-found.error, found.error],
            'height_spread_m': float(np.ptp(found.line[:, 2])),
            'ring_radius_m': float(np.hypot(*(found.line[:, :2] - found.axis).T).mean()),
            'pressure_pa': -found.liquid.weight * height,
            'volume_m3': found.volume,
            'pull_n': float(-found.force[2]),
        }
    if isinstance(found, WetPattern):
        return {
            'balance': found.balance,
            'status': found.status,
            'height_m': found.height,
            'height_error': list(_ERROR_OF_LEVEL),
            'pressure_pa': found.pressure,
            'volume_m3': found.volume,
            'void_area_m2': found.void_area,
            'section_m2': found.section,
            'force_n': found.force,
        }
    kinds = Counter(found.status.tolist())
    counted = ', '.join(f'{name} {count}' for name, count in kinds.items())
    return {
        'balance': found.balance,
        'status': counted if len(kinds) > 1 else found.status[0].item(),
        'height_m': found.mean_height,
        'height_error': list(_ERRORS[found.balance]),
        'height_spread_m': found.height_spread,
        'ring_radius_m': float(np.mean(found.ring_radii)),
        'curvature_radius_m': float(np.mean(found.curvature_radius)),
        'pressure_pa': float(np.mean(found.pressure)),
        'section_m2': found.section(direction),
        'force_n': found.force(direction),
        'direction_deg': math.degrees(direction),
    }


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
