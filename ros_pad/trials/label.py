# SPDX-License-Identifier: Apache-2.0
"""What a bag says of the trial in it, under one key of its ``custom_data``."""

from __future__ import annotations

import contextlib
import functools
import json
import math
import os
import pathlib
import platform
import subprocess
from collections.abc import Sequence
from dataclasses import asdict
from importlib import metadata
from typing import Any

import ros_pad
from ros_pad.simulation import fidelity as ladder
from ros_pad.simulation.scene import Scene
from ros_pad.trials.trial import Metrics
from ros_pad.trials.trial import Trial

KEY = 'ros_pad'
"""Of what a simulated trial was, and what came out."""

MADE_WITH = 'ros_pad_made_with'
"""Of the versions of what made the bag."""

PARAMETERS = 'ros_pad_parameters'
"""Of the parameters of the nodes on the graph, by full name of the node."""

CHANGES = 'ros_pad_parameter_changes'
"""Of parameters that changed while it was recorded: log time in ns, node, name, new value."""

LOST = 'ros_pad_lost'
"""Of the numbers of messages that were lost on the way to the recorder, by topic."""

AMBIENT_PRESSURE = 101325.0  # Pa, that simulated trials add to gauge pressures


def label(
    scene: Scene,
    policy: str,
    seed: int,
    fidelity: str,
    *,
    interrupted: bool = False,
    metrics: Metrics | None = None,
    real_time_factor: float | None = None,
    comparison: Sequence[dict[str, Any]] = (),
) -> dict[str, str]:
    """Return the custom data of a trial's bag.

    Parameters
    ----------
    scene, policy, seed, fidelity
        What was run.
    interrupted : bool
        Whether it was cut short.
    metrics, real_time_factor
        What came out, once it is known.
    comparison : sequence of dict
        Metrics of other policies on the same ground, each with its ``policy``.
    """
    return {
        KEY: json.dumps(
            {
                'scene': scene.source,
                'policy': policy,
                'seed': seed,
                'fidelity': fidelity,
                'floor': asdict(scene.floor),
                'ambient_pressure': AMBIENT_PRESSURE,
                'metrics': metrics.as_dict() if metrics else None,
                'real_time_factor': real_time_factor,
                'settings': settings(scene, policy, fidelity)
                | {
                    'interrupted': interrupted,
                    'comparison': list(comparison),
                },
            }
        ),
        MADE_WITH: json.dumps(made_with()),
    }


@functools.cache
def made_with() -> dict[str, str]:
    """Return the versions of ros_pad and of what its numbers hang on, with the git description.

    The latter, ``git``, is there only where ros_pad runs from a checkout of its repository.
    """
    versions = {'ros_pad': ros_pad.__version__}
    folder = pathlib.Path(ros_pad.__file__).parent
    # Elsewhere, as in a venv inside somebody's repository, git would describe that one.
    ours = _git(folder, 'ls-files', '--error-unmatch', '__init__.py')
    if ours and (description := _git(folder, 'describe', '--always', '--dirty', '--tags')):
        versions['git'] = description
    versions['python'] = platform.python_version()
    for package in ('numpy', 'scipy', 'mujoco', 'mcap'):
        with contextlib.suppress(metadata.PackageNotFoundError):
            versions[package] = metadata.version(package)
    if distro := os.environ.get('ROS_DISTRO'):
        versions['ros'] = distro
    return versions | {'system': f'{platform.system()} {platform.machine()}'}


def _git(folder: pathlib.Path, *words: str) -> str:
    """Return what git says there; empty where it does not know, or is not there."""
    try:
        said = subprocess.run(
            ['git', '-C', str(folder), *words], capture_output=True, text=True, timeout=5.0
        )
    except (OSError, subprocess.TimeoutExpired):
        return ''
    return said.stdout.strip() if said.returncode == 0 else ''


def promise(trial: Trial) -> str:
    """Return in words how far the distance of a trial can be trusted."""
    if trial.metrics is not None and trial.metrics.verdict:
        return f'the walk on {trial.fidelity} ended early, and nothing is promised for such walks'
    return str(trial.settings['fidelity_note'])


def settings(scene: Scene, policy: str, fidelity: str) -> dict[str, Any]:
    """Return what a reader of a trial needs to know of its scene, and of the rung it ran on."""
    choice = ladder.choose(scene, fidelity, policy)
    return {
        'foot': scene.foot.source,
        'expected_load': scene.expected_load,
        'stride_m': scene.stride,
        'cycle_s': scene.gait.cycle,
        'settle_s': scene.settle,
        'faults': [str(fault) for fault in scene.faults],
        # JSON knows no infinity.
        'fidelity_bound': choice.bound if choice.bound < math.inf else None,
        'fidelity_note': choice.note,
        'omitted': [asdict(each) for each in ladder.omitted(scene, choice.rung, policy)],
        'version': ros_pad.__version__,
        'versions': {name: each for name, each in made_with().items() if name != 'git'},
        'git': made_with().get('git'),
        'conditions': described(scene),
    }


def described(scene: Scene) -> dict[str, Any]:
    """Return a scene as plain values for JSON: nested as its YAML is, in SI units."""
    values: dict[str, Any] = asdict(scene)
    # Tables that a foot keeps for speed follow from the rest.
    values['foot'] = {
        name: each for name, each in values['foot'].items() if not name.startswith('_')
    }
    values['faults'] = [str(fault) for fault in scene.faults]
    return values
