# SPDX-License-Identifier: Apache-2.0
"""``pad wet``: how high liquid climbs a pad of any shape, and how it pulls."""

from __future__ import annotations

import argparse
import json
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ros_pad.capillary import Mesh
from ros_pad.capillary import Wet
from ros_pad.capillary import WetPattern
from ros_pad.capillary import wet
from ros_pad.capillary import wet_pattern
from ros_pad.capillary.layers import BALANCES
from ros_pad.commands.command import Commands
from ros_pad.commands.command import add_command
from ros_pad.commands.command import complain
from ros_pad.contact import THESIS_LIQUID
from ros_pad.contact import WATER
from ros_pad.contact import Liquid
from ros_pad.contact.pad import number
from ros_pad.errors import InvalidInput
from ros_pad.errors import MeshError

LIQUIDS = {'water': WATER, 'thesis': THESIS_LIQUID}
# What each shape must be given, and may be given, of --radius --contact-radius and so on.
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
    'dry': 'the liquid does not rise there: it does not wet the wall enough for this balance',
    'coarse': 'the rise is not resolved: more --layers, or a mesh that is cut off lower',
    'saturated': 'the liquid goes over the top of the mesh',
    'no_circle': 'no arc of a circle fits between wall and floor: this wall needs another method',
    'far_off': 'no equilibrium of this balance on this wall, or no arc: --balance energy; --loose'
    ' takes it as it is',
    'far_off energy': 'on slender or wholly wetted walls arcs are off by a sixth and more:'
    ' ros_pad.capillary.bath_meniscus; --loose takes it as it is',
    'far_apart': 'the surface sags in gaps this wide: ros_pad.capillary.pattern_surface; --loose'
    ' takes it as level',
}
_DESCRIPTION = """\
How high liquid climbs a pad that stands on a wet floor, and how it pulls.

MESH is a closed STL, OBJ, PLY or MSH file (pip install 'ros_pad[mesh]'), z up, \
the floor at z = 0, or one of these shapes:
  dome      --radius (of the sphere) --contact-radius [--height]
  cone      --contact-radius --top-radius --height
  cylinder  --radius --height
  pattern   --pads --pitch --radius --contact-radius [--height]: domes in a hexagonal layout
With --area, or for a pattern, the liquid stands between many pads with a level surface.

  pressure         of the liquid over the air: below 0 it pulls
  force            pressure times projected section: the thesis' estimate of what one side of the \
pad feels, no bound. On the other side the liquid pulls back, and nothing is left of it round a \
symmetric pad
  capillary force  what a scene may be given: capillary_force in the file of its foot, N for each \
pad; the size of that estimate, or with --hysteresis what the pinned line holds"""


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
    shape = part.add_argument_group('shapes')
    shape.add_argument('--radius', type=float, metavar='M', help='of sphere or cylinder, m')
    shape.add_argument('--contact-radius', type=float, metavar='M', help='on the floor, m')
    shape.add_argument('--top-radius', type=float, metavar='M', help='of a cone, m')
    shape.add_argument('--height', type=float, metavar='M', help='m (of a dome: up to its widest)')
    shape.add_argument('--pitch', type=float, metavar='M', help='of a pattern, m')
    shape.add_argument(
        '--rings', type=int, metavar='N', help='number of bands of triangles going up'
    )
    shape.add_argument(
        '--sectors', type=int, metavar='N', help='number of triangles round the axis'
    )
    file = part.add_argument_group('files')
    file.add_argument(
        '--scale', type=float, metavar='S', help='unit of the file in m: 1e-3 for mm (1)'
    )
    file.add_argument('--lift', type=float, metavar='M', help='added to all heights, m (0)')
    file.add_argument('--flip', action='store_true', help='turn a mesh that is inside out')
    liquid = part.add_argument_group('liquid')
    liquid.add_argument(
        '--liquid',
        choices=tuple(LIQUIDS),
        default='water',
        help="tensions of water on silicone (default), or those of the thesis' appendix",
    )
    liquid.add_argument('--tension', type=float, metavar='N/M', help='of another liquid, N/m')
    liquid.add_argument('--angle', type=float, metavar='DEG', help='of contact, degrees')
    liquid.add_argument('--density', type=float, metavar='KG/M3', help='kg/m³ (1000)')
    many = part.add_argument_group('many pads')
    many.add_argument('--pads', type=int, metavar='N', help='number that stands on the area')
    many.add_argument('--area', type=float, metavar='M2', help='of all of them, m²')
    part.add_argument(
        '--balance',
        choices=BALANCES,
        default='energy',
        help='how the height is found (%(default)s)',
    )
    part.add_argument(
        '--loose',
        action='store_true',
        help='take heights that are known to be far off too: to compare, not to use',
    )
    part.add_argument(
        '--layers', type=int, metavar='N', help='number from floor to top (100, pattern 200)'
    )
    part.add_argument('--slices', type=int, metavar='N', help='number round the axis (36)')
    part.add_argument(
        '--direction', type=float, default=0.0, metavar='DEG', help='of the force, degrees (0)'
    )
    part.add_argument(
        '--hysteresis',
        type=float,
        nargs=2,
        metavar=('ADVANCING', 'RECEDING'),
        help='contact angles, degrees: the capillary force is then what pinning holds',
    )
    part.add_argument('--figure', metavar='FILE', help='draw the wetted mesh: .png, .pdf or .svg')
    part.add_argument('--html', metavar='FILE', help='a page with the mesh, to be turned')
    part.add_argument('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Print what liquid does on the mesh; return the exit status."""
    number('--direction', options.direction, 'degrees', low=-math.inf)
    liquid = _liquid(options)
    try:
        mesh = _mesh(options)
        many = options.area is not None or options.mesh == 'pattern'
        found = _between(mesh, liquid, options) if many else _round(mesh, liquid, options)
    except MeshError as error:
        return complain(error, 2)
    values = {
        'mesh': options.mesh,
        'faces': len(mesh.faces),
        'surface_tension_n_per_m': liquid.surface_tension,
        'contact_angle_deg': math.degrees(liquid.angle),
        'density_kg_per_m3': liquid.density,
        'balance': found.balance,
        **_values(found, math.radians(options.direction)),
        'capillary_force_n': _of_a_foot(found, options),
        'figure': options.figure,
        'html': options.html,
    }
    rows = _rows(values)
    if options.figure is not None or options.html is not None:
        _draw(options, mesh, found, rows)
    if options.json:
        print(json.dumps({name: _plain(value) for name, value in values.items()}))
    else:
        width = max(len(words) for words, _ in rows)
        for words, value in rows:
            print(f'{words:{width}}  {value}')
    if values['status'] == 'ok':
        return 0
    worst = Counter(np.atleast_1d(found.status).tolist())
    worst.pop('ok', None)
    name, _ = worst.most_common(1)[0]
    advice = _ADVICE.get(f'{name} {found.balance}', _ADVICE[name])
    return complain(f'no height: status {values["status"]}: {advice}', 1)


def _liquid(options: argparse.Namespace) -> Liquid:
    liquid = LIQUIDS[options.liquid]
    if options.tension is not None and options.angle is None:
        raise InvalidInput('--tension needs --angle: contact angles go with the liquid')
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
                f'{_option(min(given))} is for shapes, and {options.mesh} is a file'
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
        raise InvalidInput(f'{name} means nothing to a {options.mesh}')
    sizes = {
        name: getattr(options, name) for name in (*needed, *allowed) if name in given | {'pads'}
    }
    if options.mesh in ('dome', 'pattern'):
        sizes['sphere_radius'] = sizes.pop('radius')
    if options.mesh != 'pattern':
        sizes.pop('pads', None)
    return make(**sizes)


def _round(mesh: Mesh, liquid: Liquid, options: argparse.Namespace) -> Wet:
    if options.pads is not None:
        raise InvalidInput('--pads needs --area: of the whole pattern, m²')
    return wet(
        mesh,
        liquid,
        options.balance,
        100 if options.layers is None else options.layers,
        36 if options.slices is None else options.slices,
        strict=not options.loose,
    )


def _between(mesh: Mesh, liquid: Liquid, options: argparse.Namespace) -> WetPattern:
    if options.hysteresis is not None:
        raise InvalidInput('--hysteresis is for a single pad, which has one contact line')
    if options.slices is not None:
        raise InvalidInput('--slices is for a single pad: between many the surface is level')
    pads, area = 1 if options.pads is None else options.pads, options.area
    if options.mesh == 'pattern':
        # Each dome has a hexagon to itself, unless the area is given.
        cells = math.sqrt(0.75) * options.pitch**2 * pads
        pads, area = 1, cells if area is None else area
    layers = 200 if options.layers is None else options.layers
    strict = not options.loose
    return wet_pattern(mesh, liquid, area, pads, options.balance, layers, strict)


def _option(name: str) -> str:
    return f'--{name.replace("_", "-")}'


def _values(found: Wet | WetPattern, direction: float) -> dict[str, Any]:
    if isinstance(found, WetPattern):
        return {
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


def _of_a_foot(found: Wet | WetPattern, options: argparse.Namespace) -> float:
    """Return what goes under ``capillary_force`` into the file of a foot: N for each pad."""
    direction = math.radians(options.direction)
    if isinstance(found, WetPattern):
        return abs(found.force) / (options.pads or 1)
    if options.hysteresis is None:
        return abs(found.force(direction))
    advancing, receding = map(math.radians, options.hysteresis)
    return found.hysteresis_force(direction, advancing, receding)


_UNITS = {
    'n_per_m': 'N/m', 'kg_per_m3': 'kg/m³', 'm': 'm', 'm2': 'm²', 'm3': 'm³', 'pa': 'Pa',
    'n': 'N', 'deg': '°',
}  # fmt: skip


def _rows(values: dict[str, Any]) -> list[tuple[str, str]]:
    """Return names in words and values with units, for the reader."""
    rows = []
    for name, value in values.items():
        if value is None or isinstance(value, np.ndarray):
            continue
        unit = next(
            (unit for unit in sorted(_UNITS, key=len, reverse=True) if name.endswith(f'_{unit}')),
            None,
        )
        words = (name if unit is None else name.removesuffix(f'_{unit}')).replace('_', ' ')
        if isinstance(value, float):
            text = 'no answer' if math.isnan(value) else f'{value:.6g} {_UNITS[unit or "m"]}'
        else:
            text = str(value)
        rows.append((words, text))
    return rows


def _plain(value: Any) -> Any:
    """Return what JSON knows: no arrays, and null for what has no answer."""
    if isinstance(value, np.ndarray):
        return [_plain(each) for each in value.tolist()]
    return None if isinstance(value, float) and math.isnan(value) else value


def _draw(
    options: argparse.Namespace,
    mesh: Mesh,
    found: Wet | WetPattern,
    rows: list[tuple[str, str]],
) -> None:
    from ros_pad.figures import wetted
    from ros_pad.figures import wetted_page

    if options.figure is not None:
        wetted.draw(options.figure, mesh, found, math.radians(options.direction))
    if options.html is not None:
        title = f'{mesh.source}, {options.liquid}'
        told = [row for row in rows if row[0] not in ('figure', 'html')]
        wetted_page.write(options.html, title, told, wetted.picture(mesh, found))
