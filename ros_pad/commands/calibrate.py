# SPDX-License-Identifier: Apache-2.0
"""``pad calibrate``: fit a foot to measurements."""

from __future__ import annotations

import argparse
import io
import json
import math
import pathlib
from dataclasses import asdict
from typing import Any

from ros_pad.commands.command import Commands, add_command, complain
from ros_pad.commands.folder import check_pictures
from ros_pad.commands.progress import bar
from ros_pad.configuration import refuse
from ros_pad.contact import Foot, Material, Pad
from ros_pad.contact.calibrate import FITS, Calibration, calibrate, foot_file
from ros_pad.contact.measurements import Measurements
from ros_pad.errors import ConfigError, InvalidInput, PadError


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'calibrate',
        run,
        'Fit a foot to measured shapes and forces; write its YAML file and a picture of the fit '
        'and its residuals.',
        'pad calibrate my_pads.csv --foot large37 --out my_foot.yaml\n'
        'pad calibrate my_pads.csv --material dragon_skin_10 --thickness 0.4e-3',
    )
    part.add_argument(
        'csv',
        metavar='CSV',
        type=pathlib.Path,
        help='measurements, with units in the header: docs/calibrate.md describes them, '
        'config/measurements/thesis.csv is an example',
    )
    part.add_argument(
        '--foot',
        default='large37',
        help='foot whose values the fit starts from, and keeps where nothing was measured: a name '
        'in config/feet or a YAML file (default large37)',
    )
    part.add_argument(
        '--material',
        metavar='MATERIAL',
        help='material of the pads in place of what the foot has: a name in config/materials or a '
        'YAML file',
    )
    part.add_argument('--thickness', type=float, metavar='M', help='thickness of their sheet, m')
    part.add_argument(
        '--fit',
        choices=FITS,
        help='what the shapes of domes of a material give: one factor on its stresses (default) '
        'or the thickness of the sheet; without a material it is the stiffness of the law of the '
        'thesis',
    )
    part.add_argument(
        '--film-thickness',
        type=float,
        default=3.0e-4,
        metavar='M',
        help='thickness of the liquid on the wet floor before a foot lands, m (default 3e-4)',
    )
    part.add_argument(
        '--viscosity',
        type=float,
        default=1.0e-3,
        metavar='PA_S',
        help='viscosity of that liquid, Pa s (default 1e-3, water)',
    )
    part.add_argument(
        '--out',
        type=pathlib.Path,
        metavar='FILE',
        help='foot to write (default: <name of the CSV>_foot.yaml in this folder)',
    )
    part.add_argument(
        '--figure',
        type=pathlib.Path,
        metavar='FILE',
        help='picture to write, .png, .pdf or .svg (default: a .png beside the foot)',
    )
    part.add_argument('--force', action='store_true', help='replace existing files')
    part.add_argument('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Fit the foot, write it with its picture and print the fit; return the exit status."""
    foot_path = options.out or pathlib.Path(f'{options.csv.stem}_foot.yaml')
    if foot_path.suffix not in ('.yaml', '.yml'):
        raise InvalidInput(f'--out {foot_path}: a name that ends in .yaml is needed')
    figure_path = options.figure or foot_path.with_suffix('.png')
    if figure_path.suffix not in ('.png', '.pdf', '.svg'):
        raise InvalidInput(
            f'--figure {figure_path}: a name that ends in .png, .pdf or .svg is needed'
        )
    for path in (foot_path, figure_path):
        refuse(path, options.force)
    check_pictures(options.figure)
    foot = Foot.load(options.foot)
    with bar('fitting', 2.0, 'steps', delay=1.0) as progress:
        found = calibrate(
            Measurements.read(options.csv),
            foot,
            options.film_thickness,
            options.viscosity,
            fit=options.fit,
            rubber=_rubber(options, foot),
        )
        progress(1.0)
        picture = _picture(found, figure_path)
        progress(2.0)
    _write({**picture, foot_path: foot_file(found).encode()})
    drawn = figure_path if picture else None
    if options.json:
        print(json.dumps(_values(found, foot_path, drawn)))
    else:
        _show(found)
        print(f'\nfoot:    {foot_path}\npicture: {drawn or "none: it needs Matplotlib"}')
    return 0


def _picture(found: Calibration, path: pathlib.Path) -> dict[pathlib.Path, bytes]:
    """Draw a fit; return the content of its file by path, nothing without Matplotlib."""
    try:
        from ros_pad.reports.calibration import draw
    except ConfigError as error:
        complain(error, 0)
        return {}
    picture = io.BytesIO()
    draw(found).savefig(picture, format=path.suffix[1:], dpi=150)
    return {path: picture.getvalue()}


def _rubber(options: argparse.Namespace, foot: Foot) -> Pad | None:
    """Return the pad of a material that the options ask for, if any."""
    if options.material is None and options.thickness is None:
        return None
    material = foot.pad.material
    if options.material is not None:
        material = Material.load(options.material)
    thickness = foot.pad.thickness if options.thickness is None else options.thickness
    if material is None or thickness is None:
        raise InvalidInput(
            f'--material and --thickness are both needed: the foot {foot.source} has'
            f' material {material} and thickness {thickness} m'
        )
    return Pad.of(material, foot.pad.radius, thickness, foot.pad.measured_limit)


def _write(contents: dict[pathlib.Path, bytes]) -> None:
    """Write all files or none, so that no foot is left without its picture."""
    written = {path: path.with_name(f'.{path.name}.part') for path in contents}
    try:
        for path, part in written.items():
            part.write_bytes(contents[path])
        for path, part in written.items():
            part.replace(path)
    except OSError as error:
        raise PadError(f'{path}: cannot be written: {error.strerror}') from error
    finally:
        for part in written.values():
            part.unlink(missing_ok=True)


def _values(
    found: Calibration, foot_path: pathlib.Path, figure_path: pathlib.Path | None
) -> dict[str, Any]:
    def plain(values: dict[str, Any]) -> dict[str, Any]:
        """Replace NaN, which JSON does not have, by None."""
        return {
            key: None if isinstance(value, float) and math.isnan(value) else value
            for key, value in values.items()
        }

    return {
        'measurements': found.measurements.source,
        'constants': [plain(asdict(constant)) for constant in found.constants],
        'residuals': [
            plain(asdict(residual) | {'error': residual.error}) for residual in found.residuals
        ],
        'warnings': list(found.warnings),
        'foot': str(foot_path),
        'figure': str(figure_path) if figure_path else None,
    }


def _show(found: Calibration) -> None:
    print(f'{"constant":20} {"value":>11}  {"95 % interval":>25}  {"unit":15} points')
    for each in found.constants:
        between = 'kept' if not each.fitted else 'too few points'
        if not math.isnan(each.low):
            between = f'{each.low:.4g} to {each.high:.4g}'
        print(
            f'{each.name:20} {each.value:11.5g}  {between:>25}  {each.unit:15} {each.points:6d}'
            f'  {each.note}'
        )
    print(f'\n{"measured":18} {"at":34} {"measured":>11} {"model":>11}   error')
    for row in found.residuals:
        mark = '' if row.used else '  (not fitted)'
        none = 'not known there' if row.quantity == 'force_limit' else 'no equilibrium'
        error = none if math.isnan(row.error) else f'{100.0 * row.error:+6.1f} %'
        print(
            f'{row.quantity:18} {row.setting:34} {row.measured:11.5g} {row.modelled:11.5g}'
            f'  {error}{mark}'
        )
    for warning in found.warnings:
        print(f'\nnote: {warning}')
