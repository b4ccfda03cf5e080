# SPDX-License-Identifier: Apache-2.0
"""Compute number, load, pressure and height of rise of the pads on a sole.

One of --sole-radius and --foot is needed. With --material, or a foot whose pads name one: a table
of pads of each material and thickness, with intervals from what is unsure of the materials.

For example:
  pad design --load 7 --foot large37 --figure design.png
  pad design --load 2 --sole-radius 0.017 --material all --thickness 0.2e-3 0.4e-3
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from ros_pad import configuration
from ros_pad.commands.command import FILE, Commands, add_command, print_table
from ros_pad.commands.folder import check_picture
from ros_pad.configuration import number
from ros_pad.contact import Design, Foot, Material, Pad, design
from ros_pad.contact.design import Candidate, candidates
from ros_pad.contact.layout import edge_of
from ros_pad.contact.limits import CRITERIA, DEFAULT_CRITERION, criteria, resized
from ros_pad.errors import InvalidInput
from ros_pad.making.plan import verdict

USUAL = 'large37'  # the foot whose pads and ceiling are used where none is given
RADII = (0.3e-3, 0.4e-3, 0.5e-3, 0.6e-3, 0.8e-3, 1e-3, 1.25e-3, 1.5e-3, 1.75e-3, 2e-3, 2.5e-3)
MATERIAL_CRITERION = 'flattening'
SHEETS = (2.0 / 15.0, 4.0 / 15.0, 6.0 / 15.0)  # thickness over radius: 0.4 mm of 1.5 and others


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'design', run, __doc__)
    add = part.add_argument
    add('--load', type=float, required=True, metavar='N', help='on one foot, N')
    add('--sole-radius', type=float, metavar='M', help='radius of the sole, m')
    add('--radius', type=float, metavar='M', help='of a pad, m (0.0015)')
    add('--stiffness', type=float, metavar='N/M', help='of a pad, N/m (40)')
    add('--pressure', type=float, metavar='PA', help='highest of the supply, Pa gauge (90000)')
    add('--margin', type=float, default=1.2, help='factor on the load (%(default)g)')
    text = f'of the force limit ({DEFAULT_CRITERION}; of materials {MATERIAL_CRITERION})'
    add('--criterion', choices=CRITERIA, help=text)
    text = 'names in config/materials, YAML files, or all, to compare'
    add('--material', nargs='+', help=text)
    text = 'of their sheets, m (2/15, 4/15 and 6/15 of the radius, or that of the foot)'
    add('--thickness', nargs='+', type=float, metavar='M', help=text)
    text = 'a name in config/feet or a YAML file, for sole, pads, ceiling and criterion'
    add('--foot', help=text)
    add('--figure', help='draw the table into a new .png, .pdf or .svg', **FILE)
    add('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Print the designs; return the exit status."""
    check_picture(options.figure)
    foot = Foot.load(options.foot or USUAL)
    if options.sole_radius is not None:
        area = math.pi * number('--sole-radius', options.sole_radius, 'm', above=True) ** 2
    elif options.foot is not None:
        area = foot.sole_area
    else:
        raise InvalidInput('the size of the sole is missing: give --sole-radius (m) or --foot')
    if options.material is not None or foot.pad.material is not None:
        found = _of_materials(options, foot, area)
    elif options.thickness is not None:
        raise InvalidInput('--thickness needs --material, or a foot whose pads name a material')
    else:
        found = _of_stiffness(options, foot, area)
    if options.json:
        found['figure'] = None if options.figure is None else str(options.figure)
        print(json.dumps(found))
    else:
        print('', *found['says'], sep='\n')
    return 0


def _as_built(options: argparse.Namespace, foot: Foot, radius: float, area: float) -> int | None:
    """Return the number of pads of the foot that was asked for, if sole and radius are its own."""
    own = options.foot is not None and (radius, area) == (foot.pad.radius, foot.sole_area)
    return foot.pads if own else None


def _of_stiffness(options: argparse.Namespace, foot: Foot, area: float) -> dict[str, Any]:
    """Design pads of a stiffness, as built and as many as fit; return what JSON has."""
    pad = foot.pad
    if options.stiffness not in (None, pad.stiffness):
        pad = replace(pad, stiffness=options.stiffness, measured_limit=None)
    if options.radius is not None:
        pad = resized(pad, options.radius)
    own = DEFAULT_CRITERION if options.foot is None else foot.limit
    criterion = options.criterion or (own if own in criteria(pad) else DEFAULT_CRITERION)
    ceiling = foot.ceiling if options.pressure is None else options.pressure
    rules: dict[str, Any] = {'ceiling': ceiling, 'margin': options.margin}
    designs = {'full': design(options.load, area, pad, criterion=criterion, **rules)}
    if pads := _as_built(options, foot, pad.radius, area):
        built = design(options.load, area, pad, pads=pads, criterion=criterion, **rules)
        designs = {'as built': built, **designs}
    # Limits measured on one pad do not hold for another radius.
    rules['criterion'] = DEFAULT_CRITERION if criterion == 'measured' else criterion
    radii = [
        design(options.load, area, resized(pad, radius), **rules)
        for radius in RADII
        if area >= math.pi * (radius + edge_of(radius)) ** 2 and radius >= (pad.thickness or 0.0)
    ]
    if options.figure is not None:
        from ros_pad.reports.design import draw
        from ros_pad.reports.files import write_picture

        write_picture(options.figure, lambda: draw(radii))
    first = next(iter(designs.values()))
    named = [{'name': name} | values(each) for name, each in designs.items()]
    rows = [values(each) for each in radii]
    if not options.json:
        print(
            f'{first.load:g} N on a sole of {first.area:.4g} m², pads of {first.pad.stiffness:g}'
            f' N/m, margin {first.margin:g}, at up to {first.ceiling:.0f} Pa\n'
        )
        _print_rows(_OF_DESIGNS, [*named, *({'name': 'other radius'} | row for row in rows)])
    says = [*advice(first), _cast(foot, first.pad, first.pads, area, first.ceiling)]
    return {'designs': named, 'radii': rows, 'says': says}


def _of_materials(options: argparse.Namespace, foot: Foot, area: float) -> dict[str, Any]:
    """Design pads of materials and thicknesses; return what JSON has."""
    if options.stiffness is not None:
        raise InvalidInput('--stiffness is not allowed with a material, which has its own')
    radius = foot.pad.radius if options.radius is None else options.radius
    limit, measured = MATERIAL_CRITERION, None
    if options.material is not None:
        every = options.material == ['all']
        names = configuration.names('materials') if every else options.material
        materials, sheets = [Material.load(name) for name in names], [radius * s for s in SHEETS]
        ceiling = Foot.load(USUAL).ceiling
    else:
        assert foot.pad.material is not None and foot.pad.thickness is not None
        materials, sheets = [foot.pad.material], [foot.pad.thickness]
        ceiling = foot.ceiling
        # A limit that was measured holds for its own pad alone.
        if (radius, options.thickness) == (foot.pad.radius, None):
            measured = foot.pad.measured_limit
        if foot.limit != 'measured' or measured is not None:
            limit = foot.limit
    rules: dict[str, Any] = {
        'ceiling': ceiling if options.pressure is None else options.pressure,
        'margin': options.margin,
        'criterion': options.criterion or limit,
    }
    found = candidates(
        options.load,
        area,
        materials,
        options.thickness or sheets,
        radius,
        pads=_as_built(options, foot, radius, area),
        measured_limit=measured,
        **rules,
    )
    if options.figure is not None:
        from ros_pad.reports.design import draw_candidates
        from ros_pad.reports.files import write_picture

        write_picture(options.figure, lambda: draw_candidates(found, rules['ceiling']))
    rows = [candidate_values(each) for each in found]
    if not options.json:
        print(f'{found[0].pads} pads of radius {radius:g} m\n')
        _print_rows(_OF_CANDIDATES, [row | {'ballooning_margin': _margin(row)} for row in rows])
    yes, doubt = (sum(each.carried == word for each in found) for word in ('yes', 'in doubt'))
    says = [
        f'{yes} of {len(found)} candidates carry {options.load:g} N at up to'
        f' {rules["ceiling"]:g} Pa, with a margin of {rules["margin"]:g} by the criterion'
        f' {rules["criterion"]}; {doubt} more if their material is as favourable as it may be.',
        'In brackets: from the lowest to the highest factor on the stresses that the doubts about'
        ' a material leave open (see its file). pad calibrate narrows it to your pads.',
    ]
    if rules['criterion'] == 'flattening':
        says.append(
            'Flattening is the end of the model: the pad of the thesis carried 0.33, 0.57 and 0.67'
            ' of it at 65, 75 and 85 kPa.'
        )
    first = found[0]
    says.append(_cast(foot, first.pad, first.pads, area, first.largest_pressure.low))
    return {'load_n': options.load, 'area_m2': area} | rules | {'candidates': rows, 'says': says}


def _cast(foot: Foot, pad: Pad, pads: int, area: float, ceiling: float) -> str:
    """Return whether a design can be cast, with the other properties of a foot."""
    silicones = (
        foot.silicones if pad.material is None else (pad.material.name, *foot.silicones[1:])
    )
    new: dict[str, Any] = {'pad': pad, 'pads': pads, 'sole_radius': math.sqrt(area / math.pi)}
    new |= {'silicones': silicones, 'ceiling': min(foot.ceiling, 0.999 * ceiling)}
    return verdict(replace(foot, source='this design', limit='flattening', **new))


def candidate_values(each: Candidate) -> dict[str, Any]:
    """Return the values of a candidate by name with unit; None for values that are not finite."""
    spans = {
        'pressure_pa': each.pressure,
        'height_m': each.height,
        'reachable_load_n': each.load,
        'largest_pressure_pa': each.largest_pressure,
        'ballooning_margin': each.ballooning_margin,
    }
    return {
        'material': each.material,
        'thickness_m': each.pad.thickness,
        'radius_m': each.pad.radius,
        'pads': each.pads,
        **{name: list(map(_finite, span)) for name, span in spans.items()},
        'balloons': each.balloons,
        'carried': each.carried,
    }


def _finite(value: Any) -> Any:
    """Return a value, or None for NaN and infinity, which JSON does not have."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


_UNITS = {
    **{'load': '_n', 'area': '_m2', 'criterion': '', 'margin': '', 'pads': '', 'pitch': '_m'},
    **{'load_per_pad': '_n', 'pressure': '_pa', 'ceiling': '_pa', 'pad_limit': '_n'},
    **{'reachable_load': '_n', 'dome_width': '_m', 'rise_height': '_m', 'pads_needed': ''},
    **{'pads_without_touching': '', 'carried': '', 'touching': ''},
}  # of the values of a design, as their JSON names end


def values(each: Design) -> dict[str, Any]:
    """Return the values of a design by name with unit; None for values that are not finite."""
    pad = {'radius_m': each.pad.radius, 'stiffness_n_per_m': each.pad.stiffness}
    return pad | {name + unit: _finite(getattr(each, name)) for name, unit in _UNITS.items()}


def advice(each: Design) -> Iterator[str]:
    """Yield sentences on whether the load is carried and, if not, what would be enough."""
    if each.carried:
        yield (
            f'{each.load:g} N is carried: {each.pads} pads with {each.load_per_pad:.3g} N each, '
            f'at {each.pressure:.0f} Pa or more.'
        )
    else:
        yield (
            f'{each.load:g} N cannot be carried: {each.pads} pads carry {each.reachable_load:.3g} '
            f'N with a margin of {each.margin:g} at {each.ceiling:.0f} Pa.'
        )
        if each.pressure > each.ceiling:
            yield f'A supply of {each.pressure:.0f} Pa would be enough.'
        if math.isfinite(each.pads_needed):
            yield (
                f'{each.pads_needed} pads would be enough, on a sole of radius'
                f' {each.radius_needed:.3g} m or so.'
            )
    if each.touching:
        yield (
            f'{each.pads} domes touch one another: {each.dome_width:.3g} m wide at a pitch of'
            f' {each.pitch:.3g} m.'
        )


# Heads of the printed tables, by the names of values in JSON.
_OF_DESIGNS = {
    'name': '',
    'radius_m': 'radius, m',
    'pads': 'pads',
    'pitch_m': 'pitch, m',
    'load_per_pad_n': 'on a pad, N',
    'pressure_pa': 'needed, Pa',
    'reachable_load_n': 'reach, N',
    'rise_height_m': 'rise, m',
    'criterion': 'limit',
    'carried': 'carried',
}
_OF_CANDIDATES = {
    'material': 'material',
    'thickness_m': 'sheet, m',
    'pressure_pa': 'pressure, Pa',
    'height_m': 'height, m',
    'reachable_load_n': 'load, N',
    'largest_pressure_pa': 'largest, Pa',
    'ballooning_margin': 'over pressure',
    'carried': 'carried',
}


def _print_rows(heads: dict[str, str], rows: Sequence[dict[str, Any]]) -> None:
    print_table([*heads.values()], [[_text(row[name]) for name in heads] for row in rows])


def _margin(row: dict[str, Any]) -> str:
    return ('' if row['balloons'] else 'over ') + _text(row['ballooning_margin'])


def _text(value: object) -> str:
    if isinstance(value, bool):
        return 'yes' if value else 'no'
    if isinstance(value, list):  # a value with the ends of its interval
        middle, low, high = ('none' if each is None else _text(each) for each in value)
        return middle if low == high else f'{middle} ({low} to {high})'
    if isinstance(value, float):
        return f'{value:.0f}' if value >= 1e3 else f'{value:.3g}'
    return '-' if value is None else str(value)
