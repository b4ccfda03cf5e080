# SPDX-License-Identifier: Apache-2.0
"""``pad design``: compute how many pads fit on a sole, and at which pressure they carry a load."""

from __future__ import annotations

import argparse
import json
import math
import pathlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ros_pad import configuration
from ros_pad.commands.command import Commands, add_command, print_table
from ros_pad.commands.folder import PICTURES, check_pictures, refuse_existing
from ros_pad.commands.progress import bar
from ros_pad.configuration import number
from ros_pad.contact import LARGE_PAD, Design, Foot, Material, Pad, design, pressure_for
from ros_pad.contact.candidates import Candidate, Span, candidates
from ros_pad.contact.design import CELL
from ros_pad.contact.limits import CRITERIA, DEFAULT_CRITERION, criteria, resized
from ros_pad.errors import InvalidInput
from ros_pad.pace import Progress

CEILING = 90e3  # Pa gauge, the ceiling of the shipped feet
RADII = (0.3e-3, 0.4e-3, 0.5e-3, 0.6e-3, 0.8e-3, 1e-3, 1.25e-3, 1.5e-3, 1.75e-3, 2e-3, 2.5e-3)
OTHER_RADII = (
    'Limits measured on one pad do not hold for another radius: other radii are computed with the '
    f'criterion {DEFAULT_CRITERION}.'
)
MATERIAL_CRITERION = 'flattening'
SHEETS = (2.0 / 15.0, 4.0 / 15.0, 6.0 / 15.0)  # thickness over radius: 0.4 mm of 1.5 and others


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'design',
        run,
        'Compute number, load, pressure and height of rise of the pads on a sole.',
        'pad design --load 7 --foot large37 --figure design.png\n'
        'pad design --load 2 --sole-radius 0.017 --material all --thickness 0.2e-3 0.4e-3',
    )
    part.description = (
        f'{part.description}\nOne of --area, --sole-radius and --foot is needed.'
        '\nWith --material, or a foot whose pads name one: a table of pads of each material and '
        'thickness, with intervals from what is unsure of the materials.'
    )
    part.add_argument('--load', type=float, required=True, metavar='N', help='load on one foot, N')
    sole = part.add_mutually_exclusive_group()
    sole.add_argument('--area', type=float, metavar='M2', help='area of the sole, m²')
    sole.add_argument('--sole-radius', type=float, metavar='M', help='radius of a round sole, m')
    part.add_argument(
        '--radius', type=float, metavar='M', help=f'radius of a pad, m ({LARGE_PAD.radius:g})'
    )
    part.add_argument(
        '--stiffness',
        type=float,
        metavar='N/M',
        help=f'stiffness of a pad, N/m ({LARGE_PAD.stiffness:g})',
    )
    part.add_argument(
        '--pressure',
        type=float,
        metavar='PA',
        help=f'highest pressure of the supply, Pa gauge ({CEILING:g})',
    )
    part.add_argument(
        '--margin', type=float, default=1.2, metavar='X', help='factor on the load (%(default)g)'
    )
    part.add_argument(
        '--criterion',
        choices=CRITERIA,
        help=f'criterion of the force limit ({DEFAULT_CRITERION}; of materials '
        f'{MATERIAL_CRITERION})',
    )
    _add_materials(part)
    part.add_argument(
        '--foot',
        metavar='FOOT',
        help='a name in config/feet or a YAML file: sole, pad, number of pads, ceiling and '
        'criterion are taken from this foot unless an option gives them',
    )
    part.add_argument(
        '--figure',
        type=pathlib.Path,
        metavar='FILE',
        help='draw load and rise over the pad radius into a new .png, .pdf or .svg',
    )
    part.add_argument('--json', action='store_true', help='print one JSON object')


def _add_materials(part: argparse.ArgumentParser) -> None:
    part.add_argument(
        '--material',
        nargs='+',
        metavar='MATERIAL',
        help='materials to compare: names in config/materials, YAML files, or all',
    )
    part.add_argument(
        '--thickness',
        nargs='+',
        type=float,
        metavar='M',
        help='thicknesses of their sheets, m (2/15, 4/15 and 6/15 of the radius, or that of the '
        'foot)',
    )
    part.add_argument(
        '--height', type=float, metavar='M', help='least height of their free domes, m (0)'
    )


def run(options: argparse.Namespace) -> int:
    """Print the designs; return the exit status."""
    refuse_existing('--figure', options.figure, PICTURES)
    check_pictures(options.figure)
    foot = None if options.foot is None else Foot.load(options.foot)
    if options.material is not None or (foot is not None and foot.pad.material is not None):
        return _compare_materials(options, foot)
    for name in ('thickness', 'height'):
        if getattr(options, name) is not None:
            raise InvalidInput(f'--{name} needs --material, or a foot whose pads name a material')
    pad = LARGE_PAD if foot is None else foot.pad
    if options.stiffness not in (None, pad.stiffness):
        pad = replace(pad, stiffness=options.stiffness, measured_limit=None)
    if options.radius is not None:
        pad = resized(pad, options.radius)
    area = _area(options, foot)
    ceiling = CEILING if foot is None else foot.ceiling
    own = DEFAULT_CRITERION if foot is None else foot.limit
    rules: dict[str, Any] = {
        'ceiling': ceiling if options.pressure is None else options.pressure,
        'margin': options.margin,
        'criterion': options.criterion or (own if own in criteria(pad) else DEFAULT_CRITERION),
    }
    designs = {'full': design(options.load, area, pad, **rules)}
    if foot is not None and (pad.radius, area) == (foot.pad.radius, foot.sole_area):
        designs = {'as built': design(options.load, area, pad, pads=foot.pads, **rules), **designs}
    others = rules
    if rules['criterion'] == 'measured':
        others = rules | {'criterion': DEFAULT_CRITERION}
    with bar('radii', 1.0, 'table', delay=1.0) as progress:
        rows = _over(RADII, options.load, area, pad, others, progress)
    sentences = [
        *advice(next(iter(designs.values())), rows, rules['ceiling']),
        *(() if others is rules else (OTHER_RADII,)),
    ]
    if options.figure is not None:
        from ros_pad.reports.design import draw

        radii = np.linspace(0.3e-3, 2.5e-3, 89).tolist()
        with bar('radii', 1.0, 'figure', delay=1.0) as progress:
            draw(options.figure, _over(radii, options.load, area, pad, others, progress))
    if options.json:
        summary = {
            'designs': [{'name': name, **values(each)} for name, each in designs.items()],
            'radii': [values(each) for each in rows],
            'says': sentences,
            'figure': None if options.figure is None else str(options.figure),
        }
        print(json.dumps(summary))
    else:
        _print(designs, rows)
        print('', *sentences, sep='\n')
    return 0


def _compare_materials(options: argparse.Namespace, foot: Foot | None) -> int:
    """Print pads of materials and thicknesses for the load; return the exit status."""
    if options.stiffness is not None:
        raise InvalidInput('--stiffness is not allowed with a material, which has its own')
    own = None if foot is None or options.material is not None else foot.pad
    radius = options.radius
    if radius is None:
        radius = LARGE_PAD.radius if foot is None else foot.pad.radius
    area = _area(options, foot)
    built = foot is not None and (radius, area) == (foot.pad.radius, foot.sole_area)
    ceiling = options.pressure
    if ceiling is None:
        ceiling = CEILING if own is None or foot is None else foot.ceiling
    same = own is not None and (radius, options.thickness) == (own.radius, None)
    limit = MATERIAL_CRITERION if own is None or foot is None else foot.limit
    if limit == 'measured' and not same:  # on another pad
        limit = MATERIAL_CRITERION
    rules: dict[str, Any] = {
        'pads': foot.pads if built and foot is not None else None,
        'ceiling': ceiling,
        'margin': options.margin,
        'criterion': options.criterion or limit,
        'height': options.height or 0.0,
    }
    with bar('candidates', 1.0, 'table', delay=2.0) as progress:
        found = candidates(
            options.load,
            area,
            [own.material] if own and own.material else _materials(options.material),
            options.thickness or ([own.thickness] if own else [radius * each for each in SHEETS]),
            radius,
            measured_limit=own.measured_limit if own is not None and same else None,
            progress=progress,
            **rules,
        )
    sentences = list(material_advice(found, options.load, rules))
    if options.figure is not None:
        from ros_pad.reports.design import draw_candidates

        draw_candidates(options.figure, found, ceiling)
    if options.json:
        summary = {
            'load_n': options.load,
            'area_m2': area,
            **{name: value for name, value in rules.items() if name != 'pads'},
            'candidates': [candidate_values(each) for each in found],
            'says': sentences,
            'figure': None if options.figure is None else str(options.figure),
        }
        print(json.dumps(summary))
    else:
        _print_candidates(found)
        print('', *sentences, sep='\n')
    return 0


def _materials(names: Sequence[str]) -> list[Material]:
    known = configuration.names('materials') if list(names) == ['all'] else names
    return [Material.load(name) for name in known]


def candidate_values(each: Candidate) -> dict[str, Any]:
    """Return the values of a candidate by name with unit; None for values that are not finite."""

    def span(found: Span) -> list[float | None]:
        return [value if math.isfinite(value) else None for value in found]

    return {
        'material': each.material,
        'thickness_m': each.pad.thickness,
        'radius_m': each.pad.radius,
        'pads': each.pads,
        'pressure_pa': span(each.pressure),
        'height_m': span(each.height),
        'reachable_load_n': span(each.load),
        'largest_pressure_pa': span(each.largest_pressure),
        'balloons': each.balloons,
        'ballooning_margin': span(each.ballooning_margin),
        'carried': each.carried,
    }


def material_advice(
    found: Sequence[Candidate], load: float, rules: dict[str, Any]
) -> Iterator[str]:
    """Yield sentences on which candidates carry the load."""
    height = f', {rules["height"]:g} m high,' if rules['height'] else ''
    counts = {word: sum(each.carried == word for each in found) for word in ('yes', 'in doubt')}
    yield (
        f'{counts["yes"]} of {len(found)} candidates carry {load:g} N{height} at up to'
        f' {rules["ceiling"]:g} Pa, with a margin of {rules["margin"]:g} by the criterion'
        f' {rules["criterion"]}; {counts["in doubt"]} more if their material is as favourable as'
        ' it may be.'
    )
    yield (
        'In brackets: from the lowest to the highest factor on the stresses that the doubts about'
        ' a material leave open (see its file). pad calibrate narrows it to your pads.'
    )
    if rules['criterion'] == 'flattening':
        yield (
            'Flattening is the end of the model: the pad of the thesis carried 0.33, 0.57 and 0.67'
            ' of it at 65, 75 and 85 kPa.'
        )


def _over(
    radii: Sequence[float],
    load: float,
    area: float,
    pad: Pad,
    rules: dict[str, Any],
    progress: Progress,
) -> list[Design]:
    """Return designs for those radii, m, of which a pad fits on the sole."""
    fit = [r for r in radii if area >= CELL * r * r and r >= (pad.thickness or 0.0)]
    found = []
    for done, r in enumerate(fit, 1):
        found.append(design(load, area, resized(pad, r), **rules))
        progress(done / len(fit))
    return found


def values(each: Design) -> dict[str, Any]:
    """Return the values of a design by name with unit; None for values that are not finite."""
    found = {
        'load_n': each.load,
        'area_m2': each.area,
        'radius_m': each.pad.radius,
        'stiffness_n_per_m': each.pad.stiffness,
        'criterion': each.criterion,
        'margin': each.margin,
        'pads': each.pads,
        'pitch_m': each.pitch,
        'load_per_pad_n': each.load_per_pad,
        'pressure_pa': each.pressure,
        'ceiling_pa': each.ceiling,
        'pad_limit_n': each.pad_limit,
        'reachable_load_n': each.reachable_load,
        'dome_width_m': each.dome_width,
        'rise_height_m': each.rise_height,
        'pads_needed': each.pads_needed,
        'pads_without_touching': each.pads_without_touching,
        'carried': each.carried,
        'touching': each.touching,
    }
    # JSON has neither NaN nor infinity.
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in found.items()
    }


def advice(each: Design, candidates: Sequence[Design], supply: float) -> Iterator[str]:
    """Yield sentences on whether the load is carried and, if not, which changes would be enough.

    Parameters
    ----------
    each : Design
        The design to judge.
    candidates : sequence of Design
        Designs for the same load and sole with other radii, in rising order.
    supply : float
        Highest pressure of the supply, Pa gauge.
    """
    ends = 'the supply ends' if each.ceiling == supply else 'the data for such pads end'
    if each.carried:
        yield (
            f'{each.load:g} N is carried: {each.pads} pads with {each.load_per_pad:.3g} N each, '
            f'at {each.pressure:.0f} Pa or more.'
        )
    else:
        yield (
            f'{each.load:g} N cannot be carried: {each.pads} pads carry {each.reachable_load:.3g} '
            f'N with a margin of {each.margin:g} at {each.ceiling:.0f} Pa, where {ends}.'
        )
        yield from _remedies(each, candidates)
    if each.pitch < 2.0 * each.pad.radius:
        yield (
            f'{each.pads} pads overlap even when flat: {2 * each.pad.radius:.3g} m wide at a pitch'
            f' of {each.pitch:.3g} m.'
        )
    elif each.touching:
        yield (
            f'{each.pads} domes touch one another: {each.dome_width:.3g} m wide at a pitch of '
            f'{each.pitch:.3g} m.'
        )


def _remedies(each: Design, candidates: Sequence[Design]) -> Iterator[str]:
    if each.pressure > each.ceiling:
        yield f'A supply of {each.pressure:.0f} Pa would be enough.'
    if math.isinf(each.pads_needed):
        least = pressure_for(each.pad, 0.0, each.criterion)
        yield f'No number of pads is enough: such a pad carries nothing below {least:.0f} Pa.'
    else:
        area = each.pads_needed * CELL * each.pad.radius**2
        yield (
            f'{each.pads_needed} pads would be enough, on a sole of {area:.3g} m² '
            f'(radius {math.sqrt(area / math.pi):.3g} m).'
        )
        if each.pads_needed <= each.pads_without_touching:
            yield (
                'They would fit on this sole in a closer pattern: the domes are '
                f'{each.dome_width:.3g} m wide, the pattern allows {3 * each.pad.radius:.3g} m.'
            )
    radii = [other.pad.radius for other in candidates if other.carried]
    if radii:
        yield f'On this sole pads of radius {radii[0]:g} to {radii[-1]:g} m would carry it.'


def _area(options: argparse.Namespace, foot: Foot | None) -> float:
    if options.area is not None:
        return float(options.area)
    if options.sole_radius is not None:
        return math.pi * number('--sole-radius', options.sole_radius, 'm', above=True) ** 2
    if foot is None:
        raise InvalidInput(
            'the size of the sole is missing: give --area (m²), --sole-radius (m) or --foot'
        )
    return foot.sole_area


def _print(designs: dict[str, Design], rows: Sequence[Design]) -> None:
    first = next(iter(designs.values()))
    print(
        f'{first.load:g} N on a sole of {first.area:.4g} m², pads of radius {first.pad.radius:g} '
        f'm and {first.pad.stiffness:g} N/m, limit {first.criterion}, margin {first.margin:g}'
    )
    table = {name: values(each) for name, each in designs.items()}
    print()
    lines = []
    for key, text in (
        ('pads', 'pads'),
        ('pitch_m', 'pitch, m'),
        ('load_per_pad_n', 'load per pad, N'),
        ('pressure_pa', 'pressure needed, Pa'),
        ('ceiling_pa', 'ceiling, Pa'),
        ('reachable_load_n', 'reachable load, N'),
        ('dome_width_m', 'width of the domes, m'),
        ('touching', 'domes touch'),
        ('rise_height_m', 'height of rise, m'),
        ('carried', 'load carried'),
    ):
        lines.append([text, *(_text(each[key]) for each in table.values())])
    print_table(('', *table), lines)
    print()
    keys = ('pads', 'pressure_pa', 'reachable_load_n', 'rise_height_m')
    known = [(f'{each.pad.radius:.5g}', values(each)) for each in rows]
    print_table(
        ('radius, m', 'pads', 'Pa', 'reach, N', 'rise, m'),
        [[radius, *(_text(each[key]) for key in keys)] for radius, each in known],
        texts=0,
    )


def _print_candidates(found: Sequence[Candidate]) -> None:
    first = found[0]
    print(f'{first.pads} pads of radius {first.pad.radius:g} m\n')
    head = ('material', 'sheet, m', 'pressure, Pa', 'height, m', 'load, N', 'largest, Pa')
    rows = [
        [
            each.material,
            f'{each.pad.thickness:g}',
            *(
                _span(span)
                for span in (each.pressure, each.height, each.load, each.largest_pressure)
            ),
            ('' if each.balloons else 'over ') + _span(each.ballooning_margin),
            each.carried,
        ]
        for each in found
    ]
    print_table((*head, 'over pressure', 'carried'), rows)


def _span(span: Span) -> str:
    value, low, high = (_text(each) for each in span)
    return value if low == high else f'{value} ({low} to {high})'


def _text(value: object) -> str:
    if isinstance(value, bool):
        return 'yes' if value else 'no'
    if isinstance(value, float):
        if math.isinf(value):
            return 'none'
        return f'{value:.0f}' if value >= 1e3 else f'{value:.3g}'
    return '-' if value is None else str(value)
