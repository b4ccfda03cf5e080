# SPDX-License-Identifier: Apache-2.0
"""The conditions of a trial: everything that is needed to repeat it."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
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
    settings = trial.settings
    recorded, source = settings.get('conditions'), 'as recorded with the trial'
    if not isinstance(recorded, Mapping):
        recorded, source = {}, 'no scene is on record: only the following conditions are known'
    found = [('conditions', source)]
    if trial.scene:
        found.append(('scene', _scene_words(trial, recorded)))
    found.append(('policy', trial.policy or 'not on record'))
    if trial.scene:
        found.append(('seed of floor and noise', str(trial.seed)))
    if trial.fidelity:
        found.append(('simulation', trial.fidelity))
    for key, name in _PARTS.items():
        if key in recorded:
            text = _listed(recorded[key])
            if key == 'body':
                text = f'{recorded.get("robot", "robot")}: {text}'
                text += f', steering {recorded.get("heading_gain", 0.0):g} 1/s'
            found.append((name, text))
        elif key == 'foot' and settings.get('foot'):
            found.append((name, str(settings['foot'])))
    if recorded.get('dome_pressure'):
        found.append(('pressure of a dome', f'{recorded["dome_pressure"]:g} Pa gauge, fixed'))
    elif recorded:
        found.append(('pressure of a dome', 'from the load and the measured force limit'))
    # Simulated trials run at the default ambient pressure.
    ambient = settings.get(
        'ambient_pressure', AMBIENT_PRESSURE.default if trial.fidelity else None
    )
    if ambient is not None:
        found.append(('ambient pressure', f'{ambient:g} Pa'))
    found.append(('scheduled faults', '; '.join(settings.get('faults', ())) or 'none'))
    if 'recorded' in settings:
        found.append(('recorded', str(settings['recorded'])))
    versions = {'ros_pad': settings['version']} if 'version' in settings else {}
    versions |= settings.get('versions') or {}
    found.append(
        (
            'versions',
            ', '.join(f'{name} {each}' for name, each in versions.items()) or 'not on record',
        )
    )
    found.append(('git', str(settings.get('git') or 'not on record')))
    if again := repeated_by(trial):
        found.append(('command to repeat it', again))
    return found


def repeated_by(trial: Trial) -> str | None:
    """Return the command that repeats a simulated trial; None without simulation or metrics."""
    own = trial.metrics
    if not trial.scene or not trial.fidelity or own is None:
        return None
    words = ['pad', 'run', trial.scene, '--policy', trial.policy, '--seed', str(trial.seed)]
    words += ['--fidelity', trial.fidelity]
    whole = not own.verdict and not trial.settings.get('interrupted')
    if whole and own.cycles >= 1.0 and abs(own.cycles - round(own.cycles)) < 0.01:
        words += ['--cycles', str(round(own.cycles))]
    if trial.settings.get('foot'):
        words += ['--foot', str(trial.settings['foot'])]
    return shlex.join(words)


def _scene_words(trial: Trial, values: Mapping[str, Any]) -> str:
    words = [trial.scene]
    if values.get('description'):
        words.append(str(values['description']))
    if trial.metrics is not None:
        words.append(f'{trial.metrics.cycles:.4g} gait cycles')
    return '; '.join(words)


def _listed(values: Mapping[str, Any]) -> str:
    return ', '.join(_items(values))


def _items(values: Mapping[str, Any], of: str = '') -> Iterator[str]:
    for name, each in values.items():
        words = f'{of}{name.replace("_", " ")}'
        if each is None or each == () or each == [] or name in ('homes', 'middles'):
            continue
        if name in ('cell', 'wet_fraction', 'patch_length') and not each:  # not used by this floor
            continue
        if isinstance(each, Mapping):
            yield from _items(each, f'{words} ')
        elif isinstance(each, bool) or not isinstance(each, (int, float)):
            yield f'{words} {each}' if name != 'source' else str(each)
        else:
            unit = _UNITS.get(name, '')
            if of.endswith('measured limit '):
                unit = {'slope': 'N/Pa'}.get(name, unit)
            yield f'{words} {each:.6g} {unit}'.rstrip()


__all__ = ['repeated_by', 'rows']
