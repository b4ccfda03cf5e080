# SPDX-License-Identifier: Apache-2.0
"""The conditions of a trial: everything that is needed to repeat it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any

from ros_pad.trials.bag_notes import AMBIENT_PRESSURE
from ros_pad.trials.trial import Metrics, Trial


def rows(trial: Trial) -> list[tuple[str, str]]:
    """Return the conditions of a trial: names and values, as text.

    The values of the scene, in SI units, come from ``settings['conditions']``, which
    `ros_pad.trials.bag_notes.described` made when the trial ran.
    """
    settings, own = trial.settings, trial.metrics
    recorded = settings.get('conditions') or {}
    parts = {
        name: ', '.join(_listed(each))
        for name, each in recorded.items()
        if isinstance(each, Mapping)
    }
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
        'pressure of a dome': f'{dome:g} Pa' if (dome := recorded.get('dome_pressure')) else '',
        'ambient pressure': '' if ambient is None else f'{ambient:g} Pa',
        'scheduled faults': '; '.join(settings.get('faults', ())) or 'none',
        'recorded': settings.get('recorded', ''),
        'versions': ', '.join(f'{name} {version}' for name, version in versions.items()),
        'command to repeat it': _repeated_by(trial, own) if own and trial.fidelity else '',
    }
    return [(name, text) for name, text in found.items() if text]


def _repeated_by(trial: Trial, own: Metrics) -> str:
    """Return the command that repeats a simulated trial."""
    settings = trial.settings
    scene = settings.get('conditions', {}).get('source', trial.scene)
    options = {'policy': trial.policy, 'seed': str(trial.seed), 'fidelity': trial.fidelity}
    whole = not own.verdict and not settings.get('interrupted')
    if whole and own.cycles >= 1.0 and abs(own.cycles - round(own.cycles)) < 0.01:
        options['cycles'] = str(round(own.cycles))
    options |= {name: str(settings[name]) for name in ('foot', 'sensing') if settings.get(name)}
    words = [word for name, each in options.items() for word in (f'--{name}', each)]
    return shlex.join(['pad', 'run', scene, *words])


def _listed(values: Mapping[str, Any], of: str = '') -> list[str]:
    """Return the texts and numbers of a part of a scene, with the names of their keys."""
    found = []
    for name, value in values.items():
        if isinstance(value, Mapping):
            found += _listed(value, f'{of}{name}.')
        elif isinstance(value, (int, float, str)):
            found.append(f'{of}{name} {value}')
    return found


__all__ = ['rows']
