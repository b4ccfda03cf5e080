# SPDX-License-Identifier: Apache-2.0
"""``pad contact``: shape, meniscus and force limits of one pad."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from typing import Any

from ros_pad import contact
from ros_pad.commands.command import Commands, add_command, complain
from ros_pad.configuration import number
from ros_pad.contact.dome import ADHESION_SIGNS, MODELS
from ros_pad.contact.limits import criteria, largest_pressure
from ros_pad.contact.resistance import RUBBER_SETTINGS
from ros_pad.errors import InvalidInput, NoEquilibrium

_TITLES = {
    'free': 'free dome',
    'pressed': 'pressed on the floor',
    'meniscus': 'ring of liquid',
    'force_limit_n': 'force limit, by criterion',
}
_UNITS = {'m': 'm', 'm3': 'm³', 'n': 'N'}
_DESCRIPTION = """\
Shape of a pad at a pressure, free or pressed, and its force limits.

  height            of the sphere over the pad base, before the floor cuts it
  depth             part of that height that the floor cuts off
  gap               from pad base to floor: height less depth
  ring of liquid    balance of weight and surface tension around a single pad; it does not
                    depend on the width of the gap, and is no prediction (docs/errata.md)
  tangential force  of one half of the ring: a bound, because the other half pushes back
  force limit       largest load of one pad, by criterion: docs/model/force_limit.md"""


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'contact',
        run,
        'Shape of a pad at a pressure, free or pressed, and its force limits.',
        'pad contact --pressure 75000 --force 0.1',
    )
    part.description = _DESCRIPTION
    part.add_argument(
        '--pressure', type=float, required=True, metavar='PA', help='gauge pressure in the pad, Pa'
    )
    part.add_argument(
        '--force', type=float, default=0.0, metavar='N', help='load on the pad, N (default 0)'
    )
    which = part.add_mutually_exclusive_group()
    which.add_argument(
        '--pad',
        choices=('large', 'small'),
        default='large',
        help="one of the thesis' pads: radius 1.5 mm (large, default) or 0.5 mm (small)",
    )
    which.add_argument('--foot', help='the pad of a foot: a name in config/feet or a YAML file')
    which.add_argument(
        '--material',
        help='a pad of a material: a name in config/materials or a YAML file, with --radius and '
        '--thickness',
    )
    part.add_argument('--radius', type=float, metavar='M', help='of a pad of a material, m')
    part.add_argument('--thickness', type=float, metavar='M', help='of a pad of a material, m')
    part.add_argument(
        '--adhesion',
        choices=tuple(ADHESION_SIGNS),
        help='sign of the adhesion between pad and floor (default matlab: the floor attracts); '
        'pads of a material have none',
    )
    part.add_argument(
        '--model',
        choices=MODELS,
        help='thesis: spherical dome (default); membrane: exact and slower, but the free dome and '
        'the force limits remain those of the spherical dome; pads of a material are membranes',
    )
    part.add_argument(
        '--liquid',
        choices=('water', 'thesis'),
        default='water',
        help="surface tensions of water on silicone (default), or those of the thesis' appendix",
    )
    part.add_argument('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Print shape, ring of liquid and force limits of the pad; return the exit status."""
    pad, name = _pad(options)
    _choose_law(pad, options)
    liquid = contact.WATER if options.liquid == 'water' else contact.THESIS_LIQUID
    pressure, force = options.pressure, options.force
    values: dict[str, Any] = {
        'pad': options.material or options.foot or options.pad,
        'radius_m': pad.radius,
        'stiffness_n_per_m': pad.stiffness,
        'adhesion': options.adhesion,
        'model': options.model,
        'pressure_pa': pressure,
        'force_n': force,
    }
    failure: NoEquilibrium | None = None
    try:
        for part, shape in _shapes(pad, liquid, options):
            values[part] = shape
    except NoEquilibrium as error:  # the results before the error are still printed
        failure = error
        values[next(part for part in _TITLES if part not in values)] = {'status': error.status}
    # The membrane model also has solutions above the pressures at which the force limits end.
    ends: dict[str, float] = {each: largest_pressure(pad, each) for each in criteria(pad)}
    values['force_limit_n'] = {
        criterion: contact.force_limit(pad, pressure, criterion) if pressure < end else None
        for criterion, end in ends.items()
    }
    if options.json:
        print(json.dumps(values))
    else:
        _show(f'{name}, {pressure:g} Pa gauge, {force:g} N', values, ends, pad.radius)
    return 0 if failure is None else complain(f'{failure} (status {failure.status})', 1)


def _pad(options: argparse.Namespace) -> tuple[contact.Pad, str]:
    """Return the pad that the options name, and its name."""
    pad = contact.LARGE_PAD if options.pad == 'large' else contact.SMALL_PAD
    name = f'{options.pad} pad'
    if options.foot is not None:
        pad, name = contact.Foot.load(options.foot).pad, f'pad of {options.foot}'
    if options.material is not None:
        material = contact.Material.load(options.material)
        sizes = RUBBER_SETTINGS[0], RUBBER_SETTINGS[-1]
        for each in sizes:
            if getattr(options, each.name) is None:
                raise InvalidInput(
                    f'--{each.name} is missing: {each.allowed} is needed with --material'
                )
        radius, thickness = (
            number(f'--{each.name}', getattr(options, each.name), each.unit, each.low, each.high)
            for each in sizes
        )
        made = contact.Pad.of(material, radius, thickness)
        return made, f'pad of {options.material}'
    for key in ('radius', 'thickness'):
        if getattr(options, key) is not None:
            raise InvalidInput(f'--{key} is not allowed without --material')
    return pad, name


def _choose_law(pad: contact.Pad, options: argparse.Namespace) -> None:
    """Set the adhesion and model that were not given; refuse those that the pad does not have."""
    cap = pad.material is None
    for key, of_cap, of_rubber in (
        ('adhesion', 'matlab', 'none'),
        ('model', 'thesis', 'membrane'),
    ):
        if getattr(options, key) is None:
            setattr(options, key, of_cap if cap else of_rubber)
        elif not cap:
            raise InvalidInput(f'--{key} is not allowed for a pad of a material')


def _shapes(
    pad: contact.Pad, liquid: contact.Liquid, options: argparse.Namespace
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield name and values of the free dome, the pressed dome and its ring of liquid.

    Raises NoEquilibrium at the first of them that does not exist.
    """
    pressure, force = options.pressure, options.force
    free = contact.inflate(pad, pressure)
    yield (
        'free',
        {
            'height_m': free.height,
            'sphere_radius_m': free.sphere_radius,
            'volume_m3': free.volume,
        },
    )
    pressed = contact.press(pad, pressure, force, options.adhesion, options.model)
    yield (
        'pressed',
        {
            'height_m': pressed.height,
            'depth_m': pressed.depth,
            'contact_radius_m': pressed.contact_radius,
            'sphere_radius_m': pressed.sphere_radius,
            'gap_m': pressed.gap,
            'status': pressed.status,
        },
    )
    if not force > 0.0:  # the ring around a dome without load is too small to compute
        yield 'meniscus', {'status': 'no_contact'}
        return
    wet = contact.meniscus(pressed, liquid)
    yield (
        'meniscus',
        {
            'height_m': wet.height,
            'ring_radius_m': wet.ring_radius,
            'tangential_force_n': wet.tangential_force,
            'status': wet.status,
        },
    )


def _show(heading: str, values: dict[str, Any], ends: dict[str, float], pad_radius: float) -> None:
    print(heading)
    for part, title in _TITLES.items():
        if part not in values:
            continue
        print(title)
        for key, value in values[part].items():
            words, _, unit = key.rpartition('_') if part != 'force_limit_n' else (key, '', 'n')
            if value is None:
                print(f'  {key:18} not known above {ends[key]:.6g} Pa')
            elif isinstance(value, str):
                print(f'  {key:18} {value}')
            else:
                print(f'  {words.replace("_", " "):18} {value:.6g} {_UNITS[unit]}')
        if part == 'meniscus' and values[part].get('ring_radius_m', 0.0) > pad_radius:
            print('  (wider than the pad: this balance is not valid there, see docs/errata.md)')
