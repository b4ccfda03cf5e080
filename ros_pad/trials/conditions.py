# SPDX-License-Identifier: Apache-2.0
"""The conditions of a trial: everything that is needed to repeat it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any

from ros_pad.trials.label import AMBIENT_PRESSURE
from ros_pad.trials.trial import Trial

# Units of the values of a scene and a foot, by name; a value that is not listed has no unit.
_UNITS = {
    'mass': 'kg', 'inertia': 'kg m²', 'height': 'm', 'homes': 'm', 'leg_stiffness': 'N/m',
    'rolling_drag': 'N', 'load': 'N', 'goal': 'm',
    'cycle': 's', 'stride': 'm', 'lift': 'm', 'stroke': 'm', 'stance': 's', 'swing': 's',
    'heading_gain': '1/s', 'film_thickness': 'm', 'viscosity': 'Pa s', 'patch_length': 'm',
    'cell': 'm', 'slope': 'rad', 'roughness': 'm', 'unevenness': 'm', 'weight': 'N',
    'distance': 'm', 'stiffness': 'N/m', 'rate': 'Hz', 'force': 'N', 'position': 'm',
    'moment': 'N m', 'hose_diameter': 'm', 'hose_length': 'm', 'hose_conductance': 'm³/(s Pa)',
    'radius': 'm', 'adhesion_energy': 'J/m²', 'sole_radius': 'm', 'shear_strength': 'Pa',
    'conforming_pressure': 'Pa', 'critical_film': 'm', 'shear_stiffness': 'N/m',
    'chamber_volume': 'm³', 'ceiling': 'Pa', 'dome_pressure': 'Pa', 'settle': 's',
    'pressure': 'Pa', 'ambient_pressure': 'Pa', 'capillary_force': 'N',
}  # fmt: skip

# Parts of a scene that have a row of their own, with the name of this row.
_PARTS = {
    'body': 'robot', 'gait': 'gait', 'foot': 'foot', 'floor': 'floor', 'tow': 'towed load',
    'sensors': 'sensors: rate, noise (standard deviation)', 'regulator': 'regulator and hose',
}  # fmt: skip


def rows(trial: Trial) -> list[tuple[str, str]]:
    """Return the conditions of a trial: names, and values with units, as text.

    The values come from ``settings['conditions']``, which `ros_pad.trials.label.described` made
    when the trial ran.
    """
    settings, own = trial.settings, trial.metrics
    known = settings.get('conditions')
    recorded = known if isinstance(known, Mapping) else {}
    words = (
        trial.scene,
        recorded.get('description'),
        f'{own.cycles:.4g} gait cycles' if own else '',
    )
    parts = {name: _listed(recorded[key]) for key, name in _PARTS.items() if key in recorded}
    if 'robot' in parts:
        parts['robot'] = f'{recorded.get("robot")}: {parts["robot"]}'
    pressure = 'from the load and the measured force limit' if recorded else ''
    if fixed := recorded.get('dome_pressure'):
        pressure = f'{fixed:g} Pa gauge, fixed'
    # Simulated trials run at the default ambient pressure.
    ambient = settings.get(
        'ambient_pressure', AMBIENT_PRESSURE.default if trial.fidelity else None
    )
    versions = settings.get('versions') or {'ros_pad': settings.get('version', 'not on record')}
    found = {
        'conditions': 'as recorded with the trial' if recorded else 'no scene is on record:'
        ' only the following conditions are known',
        'scene': '; '.join(filter(None, words)) if trial.scene else '',
        'policy': trial.policy or 'not on record',
        'seed of floor and noise': str(trial.seed) if trial.scene else '',
        'simulation': trial.fidelity,
        'foot': str(settings.get('foot') or ''),
        **parts,
        'pressure of a dome': pressure,
        'ambient pressure': '' if ambient is None else f'{ambient:g} Pa',
        'scheduled faults': '; '.join(settings.get('faults', ())) or 'none',
        'recorded': settings.get('recorded', ''),
        'versions': ', '.join(f'{name} {each}' for name, each in versions.items()),
        'command to repeat it': _repeated_by(trial) if trial.scene and trial.fidelity and own
        else '',
    }  # fmt: skip
    return [(name, text) for name, text in found.items() if text]


def _repeated_by(trial: Trial) -> str:
    """Return the command that repeats a simulated trial."""
    own = trial.metrics
    assert own
    words = ['pad', 'run', trial.scene, '--policy', trial.policy, '--seed', str(trial.seed)]
    words += ['--fidelity', trial.fidelity]
    whole = not own.verdict and not trial.settings.get('interrupted')
    if whole and own.cycles >= 1.0 and abs(own.cycles - round(own.cycles)) < 0.01:
        words += ['--cycles', str(round(own.cycles))]
    if trial.settings.get('foot'):
        words += ['--foot', str(trial.settings['foot'])]
    return shlex.join(words)


def _listed(values: Mapping[str, Any], of: str = '') -> str:
    """Return the values of a part of a scene with their units, without those that are not used."""
    found = []
    for name, each in values.items():
        words = f'{of}{name.replace("_", " ")}'
        unused = name in ('cell', 'wet_fraction', 'patch_length') and not each
        if each in (None, (), []) or name in ('homes', 'middles') or unused:
            continue
        if isinstance(each, Mapping):
            found.append(_listed(each, f'{words} '))
        elif isinstance(each, bool) or not isinstance(each, (int, float)):
            found.append(str(each) if name == 'source' else f'{words} {each}')
        else:
            unit = 'N/Pa' if words.endswith('measured limit slope') else _UNITS.get(name, '')
            found.append(f'{words} {each:.6g} {unit}'.rstrip())
    return ', '.join(found)


__all__ = ['rows']
