# SPDX-License-Identifier: Apache-2.0
"""Compute the shape of a pad at a pressure, free or pressed, and its force limits.

  height            of the sphere over the pad base, before the floor cuts it
  depth             part of that height that the floor cuts off
  gap               from pad base to floor: height less depth
  ring of liquid    balance of weight and surface tension around a single pad; it does not
                    depend on the width of the gap, and is no prediction (docs/errata.md)
  tangential force  of one half of the ring: a bound, because the other half pushes back
  force limit       largest load of one pad, by criterion: docs/model/force_limit.md

With --model membrane, the free dome and the force limits remain those of the spherical dome; pads
of a material are membranes.

For example:
  pad contact --pressure 75000 --force 0.1
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from typing import Any

from ros_pad import contact
from ros_pad.commands.command import Commands, add_command, complain, named
from ros_pad.configuration import number
from ros_pad.contact.dome import MODELS
from ros_pad.contact.limits import criteria, largest_pressure
from ros_pad.errors import InvalidInput, NoEquilibrium

_TITLES = {
    'free': 'free dome',
    'pressed': 'pressed on the floor',
    'meniscus': 'ring of liquid',
    'force_limit_n': 'force limit, by criterion',
}


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'contact', run, __doc__)
    add = part.add_argument
    text = 'gauge pressure in the pad, Pa'
    add('--pressure', type=float, required=True, metavar='PA', help=text)
    add('--force', type=float, default=0.0, metavar='N', help='load on the pad, N (0)')
    which = part.add_mutually_exclusive_group()
    text = 'of the thesis: radius 1.5 mm (large, default) or 0.5 mm (small)'
    which.add_argument('--pad', choices=('large', 'small'), default='large', help=text)
    which.add_argument('--foot', help='the pad of a foot: a name in config/feet or a YAML file')
    text = 'of a pad with --radius and --thickness: a name in config/materials or a YAML file'
    which.add_argument('--material', help=text)
    add('--radius', type=float, metavar='M', help='of a pad of a material, m')
    add('--thickness', type=float, metavar='M', help='of a pad of a material, m')
    text = 'thesis: spherical dome (default); membrane: exact and slower, see above'
    add('--model', choices=MODELS, help=text)
    add('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Print shape, ring of liquid and force limits of the pad; return the exit status."""
    pad = _pad(options)
    pressure, force = options.pressure, options.force
    values: dict[str, Any] = {
        'pad': options.material or options.foot or options.pad,
        'radius_m': pad.radius,
        'stiffness_n_per_m': pad.stiffness,
        'model': options.model,
        'pressure_pa': pressure,
        'force_n': force,
    }
    failure: NoEquilibrium | None = None
    try:
        for part, shape in _shapes(pad, options):
            values[part] = shape
    except NoEquilibrium as error:  # the results before the error are still printed
        failure = error
        values[next(part for part in _TITLES if part not in values)] = {'status': error.status}
    # The membrane model also has solutions above the pressures at which the force limits end.
    ends: dict[str, float] = {each: largest_pressure(pad) for each in criteria(pad)}
    values['force_limit_n'] = {
        criterion: contact.force_limit(pad, pressure, criterion) if pressure < end else None
        for criterion, end in ends.items()
    }
    if options.json:
        print(json.dumps(values))
    else:
        _show(values, ends)
    return 0 if failure is None else complain(f'{failure} (status {failure.status})', 1)


def _pad(options: argparse.Namespace) -> contact.Pad:
    """Return the pad that the options name; set the model where none was given."""
    if options.material is not None:
        material = contact.Material.load(options.material)
        radius = number('--radius', options.radius, 'm', 1e-4, 1e-2)
        thickness = number('--thickness', options.thickness, 'm', 1e-5, 1e-2)
        pad = contact.Pad.of(material, radius, thickness)
    else:
        for key in ('radius', 'thickness'):
            if getattr(options, key) is not None:
                raise InvalidInput(f'--{key} is not allowed without --material')
        pad = contact.LARGE_PAD if options.pad == 'large' else contact.SMALL_PAD
        if options.foot is not None:
            pad = contact.Foot.load(options.foot).pad
    if options.model is None:
        options.model = 'thesis' if pad.material is None else 'membrane'
    elif pad.material is not None:
        raise InvalidInput('--model is not allowed for a pad of a material')
    return pad


def _shapes(pad: contact.Pad, options: argparse.Namespace) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield name and values of the free dome, the pressed dome and its ring of liquid.

    Raises NoEquilibrium at the first of them that does not exist.
    """

    def values(of: Any, *names: str) -> dict[str, Any]:
        units = {'volume': '_m3', 'tangential_force': '_n', 'status': ''}
        return {name + units.get(name, '_m'): getattr(of, name) for name in names}

    pressure, force = options.pressure, options.force
    free = contact.inflate(pad, pressure)
    yield 'free', values(free, 'height', 'sphere_radius', 'volume')
    adhesion = 'matlab' if pad.material is None else 'none'
    pressed = contact.press(pad, pressure, force, adhesion, options.model)
    names = ('height', 'depth', 'contact_radius', 'sphere_radius', 'gap', 'status')
    yield 'pressed', values(pressed, *names)
    if not force > 0.0:  # the ring around a dome without load is too small to compute
        yield 'meniscus', {'status': 'no_contact'}
        return
    ring = contact.meniscus(pressed, contact.WATER)
    yield 'meniscus', values(ring, 'height', 'ring_radius', 'tangential_force', 'status')


def _show(values: dict[str, Any], ends: dict[str, float]) -> None:
    pad, pressure, force = values['pad'], values['pressure_pa'], values['force_n']
    name = f'{pad} pad' if pad in ('large', 'small') else f'pad of {pad}'
    print(f'{name}, {pressure:g} Pa gauge, {force:g} N')
    for part, title in _TITLES.items():
        if part not in values:
            continue
        print(title)
        for key, value in values[part].items():
            name = key if part != 'force_limit_n' else f'{key}_n'
            words, text = named(name, value)
            if value is None:
                text = f'not known above {ends[key]:.6g} Pa'
            print(f'  {words:18} {text}')
        if part == 'meniscus' and values[part].get('ring_radius_m', 0.0) > values['radius_m']:
            print('  (wider than the pad: this balance is not valid there, see docs/errata.md)')
