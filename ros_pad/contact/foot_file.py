# SPDX-License-Identifier: Apache-2.0
"""Text of a foot file, for :meth:`ros_pad.contact.Foot.load` and every command."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping

from ros_pad.contact.resistance import FOOT_SETTINGS, Foot
from ros_pad.errors import InvalidInput

# Comments of constants that are not fitted; those that others may have changed name no origin.
_WORDS = {
    'sole_radius': 'm',
    'shear_stiffness': 'N/m of the whole foot',
    'chamber_volume': 'm3 of air without the domes',
    'ceiling': 'Pa gauge',
    'capillary_force': 'N a dome, of the start foot',
}


def foot_text(
    foot: Foot, description: str, head: Iterable[str], comments: Mapping[str, str]
) -> str:
    """Return the YAML text of a foot, for :meth:`Foot.load`.

    Parameters
    ----------
    foot : Foot
        The foot.
    description : str
        What the file states under this key.
    head : iterable of str
        Lines of the comment at the top.
    comments : mapping of str to str
        What the comment behind a constant has after its unit, by name of the constant.
    """
    pad, limit, material = foot.pad, foot.pad.measured_limit, foot.pad.material

    def entry(name: str, value: float, unit: str, indent: str = '') -> str:
        # PyYAML reads 1e-05 as text: a number needs a decimal point.
        text = f'{value:.9g}'
        text = text if '.' in text else text.replace('e', '.0e') if 'e' in text else f'{text}.0'
        return f'{f"{indent}{name}: {text}":35} # {unit}'

    def comment(name: str) -> str:
        return comments.get(name, 'of the start foot')

    lines = [
        *(f'# {line}' for line in head),
        # In quotes: a path may contain characters with a meaning in YAML.
        f'description: {json.dumps(description, ensure_ascii=False)}',
        '',
        'pad:',
        entry('radius', pad.radius, 'm', '  '),
    ]
    if material is not None:
        if not material.name:
            raise InvalidInput(
                f'the material {material} has no name: a foot file needs one that was loaded from'
                ' a file (Material.load)'
            )
        lines.append(f'  material: {json.dumps(material.name, ensure_ascii=False)}')
    if pad.thickness is not None:
        lines.append(entry('thickness', pad.thickness, f'm, {comment("thickness")}', '  '))
    if material is None:
        lines += [
            entry('stiffness', pad.stiffness, f'N/m, {comment("stiffness")}', '  '),
            entry('adhesion_energy', pad.adhesion_energy, 'J/m2', '  '),
        ]
    else:
        lines.append(f'  factor: # on the stresses of the material, {comment("factor")}')
        values = (material.factor, *(material.factor_range or ()))
        for name, value in zip(('value', 'low', 'high'), values, strict=True):
            lines.append(entry(name, value, '(factor)', '    '))
    if limit is not None:
        lines += [
            '  measured_limit: # of one pad',
            entry('force', limit.force, f'N, {comment("force_limit")}', '    '),
            entry('pressure', limit.pressure, 'Pa gauge', '    '),
            entry('slope', limit.slope, f'N/Pa, {comment("force_limit_slope")}', '    '),
        ]
    lines += ['', f'pads: {foot.pads}']
    for each in FOOT_SETTINGS[1:]:
        words = _WORDS.get(each.name) or f'{each.unit}, {comment(each.name)}'.removeprefix(', ')
        lines.append(entry(each.name, getattr(foot, each.name), words))
    lines.append(f'force_limit: {foot.limit}')
    if foot.silicones:
        lines.append(f'silicones: {json.dumps(foot.silicones)} # of the sheet, and of the body')
    return '\n'.join(lines) + '\n'
