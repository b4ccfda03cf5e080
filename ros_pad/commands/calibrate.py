# SPDX-License-Identifier: Apache-2.0
"""Fit a foot to measured shapes and forces.

Write its YAML file, and beside it a picture of the fit and its residuals.

For example:
  pad calibrate my_pads.csv --foot large37 --out my_foot.yaml
  pad calibrate my_pads.csv --material dragon_skin_10 --thickness 0.4e-3
"""

from __future__ import annotations

import argparse
import json
import math
import pathlib
from dataclasses import asdict
from typing import Any

from ros_pad.commands.command import FILE, Commands, add_command, complain, print_table
from ros_pad.commands.progress import bar
from ros_pad.configuration import choice, refuse
from ros_pad.contact import Foot, Material, Pad
from ros_pad.contact.calibrate import Calibration, calibrate, foot_file
from ros_pad.contact.measurements import Measurements
from ros_pad.errors import ConfigError, InvalidInput


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'calibrate', run, __doc__)
    add = part.add_argument
    text = 'measurements, as docs/calibrate.md and config/measurements/thesis.csv have them'
    add('csv', metavar='CSV', type=pathlib.Path, help=text)
    text = 'start of the fit, kept where nothing was measured: a name in config/feet or YAML file'
    add('--foot', default='large37', help=f'{text} (default %(default)s)')
    text = 'of the pads in place of what the foot has: a name in config/materials or a YAML file'
    add('--material', help=text)
    add('--thickness', type=float, metavar='M', help='of their sheet, m')
    text = 'of liquid on the wet floor before a foot lands, m (default %(default)g)'
    add('--film-thickness', type=float, default=3.0e-4, metavar='M', help=text)
    text = 'of that liquid, Pa s (default %(default)g, water)'
    add('--viscosity', type=float, default=1.0e-3, metavar='PA_S', help=text)
    add('--out', help='foot to write (default: CSV_foot.yaml here)', **FILE)
    add('--force', action='store_true', help='replace existing files')
    add('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Fit the foot, write it with its picture and print the fit; return the exit status."""
    path = options.out or pathlib.Path(f'{options.csv.stem}_foot.yaml')
    choice('ending of --out', path.suffix, ('.yaml', '.yml'))
    beside = path.with_suffix('.png')
    for each in (path, beside):
        refuse(each, options.force)
    foot = Foot.load(options.foot)
    with bar('fitting', 1.0, 'foot'):
        found = calibrate(
            Measurements.read(options.csv),
            foot,
            options.film_thickness,
            options.viscosity,
            rubber=_rubber(options, foot),
        )
    picture: pathlib.Path | None = beside
    try:
        from ros_pad.reports.calibration import draw
        from ros_pad.reports.files import save, write_picture

        write_picture(beside, lambda: draw(found))
        save(path, foot_file(found).encode(), new_folder=False)
    except ConfigError as error:
        complain(error, 0)
        picture = None
        path.write_text(foot_file(found), encoding='utf-8')
    if options.json:
        print(json.dumps(_values(found, path, picture)))
    else:
        _show(found)
        print(f'\nfoot:    {path}\npicture: {picture or "none: it needs Matplotlib"}')
    return 0


def _rubber(options: argparse.Namespace, foot: Foot) -> Pad | None:
    """Return the pad of a material that the options ask for, if any."""
    if options.material is None and options.thickness is None:
        return None
    material, thickness = foot.pad.material, options.thickness
    if options.material is not None:
        material = Material.load(options.material)
    if thickness is None:
        thickness = foot.pad.thickness
    if material is None or thickness is None:
        raise InvalidInput(
            f'--material and --thickness are both needed: the foot {foot.source} has'
            f' material {material} and thickness {thickness} m'
        )
    return Pad.of(material, foot.pad.radius, thickness, foot.pad.measured_limit)


def _values(
    found: Calibration, path: pathlib.Path, picture: pathlib.Path | None
) -> dict[str, Any]:
    def plain(values: dict[str, Any]) -> dict[str, Any]:
        """Replace NaN, which JSON does not have, by None."""
        return {key: None if value != value else value for key, value in values.items()}

    return {
        'measurements': found.measurements.source,
        'constants': [plain(asdict(constant)) for constant in found.constants],
        'residuals': [plain(asdict(each) | {'error': each.error}) for each in found.residuals],
        'warnings': list(found.warnings),
        'foot': str(path),
        'figure': str(picture) if picture else None,
    }


def _show(found: Calibration) -> None:
    rows = []
    for each in found.constants:
        between = 'too few points' if each.fitted else 'kept'
        if not math.isnan(each.low):
            between = f'{each.low:.4g} to {each.high:.4g}'
        rows.append([each.name, each.unit, f'{each.value:.5g}', between, f'{each.points}'])
        rows[-1].append(each.note)
    print_table(['constant', 'unit', 'value', '95 % interval', 'points', ''], rows, texts=2)
    rows = []
    for row in found.residuals:
        error = 'none in the model' if math.isnan(row.error) else f'{100.0 * row.error:+.1f} %'
        values = [f'{row.measured:.5g}', f'{row.modelled:.5g}', error]
        rows.append([row.quantity, row.setting, *values, '' if row.used else '(not fitted)'])
    print()
    print_table(['measured', 'at', 'measured', 'model', 'error', ''], rows, texts=2)
    for warning in found.warnings:
        print(f'\nnote: {warning}')
