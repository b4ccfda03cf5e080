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
    'measured limit slope': 'N/Pa',
}  # fmt: skip


def rows(trial: Trial) -> list[tuple[str, str]]:
    """Return the conditions of a trial: names, and values with units, as text.

    The values of the scene come from ``settings['conditions']``, which
    `ros_pad.trials.label.described` made when the trial ran.
    """
    settings, own = trial.settings, trial.metrics
    recorded = settings.get('conditions') or {}
    parts = {name: _listed(each) for name, each in recorded.items() if isinstance(each, Mapping)}
    # Simulated trials run at the default ambient pressure.
    ambient = settings.get(
        'ambient_pressure', AMBIENT_PRESSURE.default if trial.fidelity else None
    )
    versions = settings.get('versions') or {'ros_pad': settings.get('version', 'not on record')}
    found = {
        'conditions': '' if recorded else 'no scene is on record: only these are known',
        'scene': trial.scene,
        'description': recorded.get('description', ''),
        'gait cycles': f'{own.cycles:.4g}' if own else '',
        'policy': trial.policy or 'not on record',
        'seed of floor and noise': str(trial.seed) if trial.scene else '',
        'simulation': trial.fidelity,
        'foot': str(settings.get('foot') or ''),
        'robot': recorded.get('robot', ''),
        **parts,
        'pressure of a dome': _quantity('pressure', recorded.get('dome_pressure')),
        'ambient pressure': _quantity('pressure', ambient),
        'scheduled faults': '; '.join(settings.get('faults', ())) or 'none',
        'recorded': settings.get('recorded', ''),
        'versions': ', '.join(f'{name} {version}' for name, version in versions.items()),
        'command to repeat it': _repeated_by(trial) if trial.scene and trial.fidelity else '',
    }
    return [(name, text) for name, text in found.items() if text]


def _repeated_by(trial: Trial) -> str:
    """Return the command that repeats a simulated trial."""
    own = trial.metrics
    if own is None:
        return ''
    words = ['pad', 'run', trial.scene, '--policy', trial.policy, '--seed', str(trial.seed)]
    words += ['--fidelity', trial.fidelity]
    whole = not own.verdict and not trial.settings.get('interrupted')
    if whole and own.cycles >= 1.0 and abs(own.cycles - round(own.cycles)) < 0.01:
        words += ['--cycles', str(round(own.cycles))]
    if trial.settings.get('foot'):
        words += ['--foot', str(trial.settings['foot'])]
    return shlex.join(words)


def _listed(values: Mapping[str, Any], of: str = '') -> str:
    """Return the texts and numbers of a part of a scene, with their units."""
    found = []
    for name, value in values.items():
        words = f'{of}{name.replace("_", " ")}'
        if isinstance(value, Mapping):
            found.append(_listed(value, f'{words} '))
        elif quantity := _quantity(words if words in _UNITS else name, value):
            found.append(f'{words} {quantity}')
    return ', '.join(found)


def _quantity(name: str, value: Any) -> str:
    """Return a text, or a number with its unit; empty for anything else."""
    if isinstance(value, (int, float)):
        return f'{value:.6g} {_UNITS.get(name, "")}'.rstrip()
    return value if isinstance(value, str) else ''


__all__ = ['rows']
