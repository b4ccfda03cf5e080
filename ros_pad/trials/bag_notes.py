# SPDX-License-Identifier: Apache-2.0
"""Write and read the custom data that describe a trial in its bag."""

from __future__ import annotations

import contextlib
import functools
import json
import math
import os
import pathlib
import platform
import subprocess
from dataclasses import asdict
from importlib import metadata
from typing import Any

import ros_pad
from ros_pad.bags import BagReader, annotate
from ros_pad.configuration import Setting
from ros_pad.errors import BagError
from ros_pad.simulation import fidelity as levels
from ros_pad.simulation.pneumatics import ATMOSPHERE
from ros_pad.simulation.scene import FloorPlan, Scene
from ros_pad.simulation.terms import terms
from ros_pad.trials.trial import Metrics, Trial

KEY = 'ros_pad'
"""Key of the conditions and results of a trial."""

MADE_WITH = 'ros_pad_made_with'
"""Key of the versions of the software that made the bag."""

PARAMETERS = 'ros_pad_parameters'
"""Key of the first parameters of the nodes of ros_pad, by full name of the node."""

CHANGES = 'ros_pad_parameter_changes'
"""Key of the parameters that changed while recording: log time in ns, node, name, new value."""

LOST = 'ros_pad_lost'
"""Key of the number of messages on each topic that were lost before the recorder received them."""

RECORDED_AT = 'ros_pad_recorded_at'
"""Key of where messages were recorded: ``publisher`` or ``receiver``."""

AMBIENT_PRESSURE = Setting(
    'ambient_pressure', ATMOSPHERE, 'Absolute pressure of the air around the robot.',
    'Pa', 30000.0, 120000.0,
)  # fmt: skip


def label(
    scene: Scene, policy: str, seed: int, fidelity: str, sensing: str = 'markers'
) -> dict[str, str]:
    """Return the custom data of a trial's bag, which :func:`note` completes: texts by key.

    Parameters
    ----------
    scene, policy, seed, fidelity, sensing
        The conditions of the trial; ``sensing`` is ``markers`` or ``joints``.
    """
    known = {
        'scene': scene.source,
        'policy': policy,
        'seed': seed,
        'fidelity': fidelity,
        'floor': asdict(scene.floor),
        'ambient_pressure': AMBIENT_PRESSURE.default,
        'settings': settings(scene, policy, fidelity, sensing),
    }
    return {KEY: json.dumps(known), MADE_WITH: json.dumps(made_with())}


def note(folder: str | os.PathLike[str], trial: Trial) -> None:
    """Add the results of a trial, and the metrics of other policies, to its closed bag.

    ``interrupted`` says whether the trial was stopped before its end.
    """
    known = json.loads(BagReader(folder).custom_data[KEY])
    known['metrics'] = trial.metrics.as_dict() if trial.metrics else None
    known['real_time_factor'] = trial.real_time_factor
    for name in ('comparison', 'interrupted'):
        known['settings'][name] = trial.settings[name]
    annotate(folder, {KEY: json.dumps(known)})


def read(bag: BagReader) -> dict[str, Any]:
    """Return what a bag says of its trial: fields of :class:`ros_pad.trials.Trial`, by name.

    Texts are empty, others None or 0, where it says nothing; ``settings`` have at least the
    ``ambient_pressure``, Pa.

    Raises
    ------
    BagError
        When its custom data are not those of ros_pad.
    """
    try:
        noted = json.loads(bag.custom_data.get(KEY, '{}'))
        seed = int(noted.get('seed') or 0)
        ambient = float(noted.get('ambient_pressure', AMBIENT_PRESSURE.default))
        return {name: str(noted.get(name) or '') for name in ('scene', 'policy', 'fidelity')} | {
            'seed': seed,
            'floor': FloorPlan(**noted['floor']).build(seed) if noted.get('floor') else None,
            'metrics': Metrics(**noted['metrics']) if noted.get('metrics') else None,
            'settings': dict(noted.get('settings') or {}) | {'ambient_pressure': ambient},
            'real_time_factor': noted.get('real_time_factor'),
        }
    except (AttributeError, TypeError, ValueError) as error:
        raise BagError(
            f'{bag.path}: custom data {KEY!r} does not describe a trial of ros_pad: {error}'
        ) from error


@functools.cache
def made_with() -> dict[str, str]:
    """Return the versions of ros_pad and of the libraries that its numbers depend on.

    The key ``git``, the description of the commit, exists only in a checkout of the repository.
    """
    versions = {'ros_pad': ros_pad.__version__}
    folder = pathlib.Path(ros_pad.__file__).parent.parent
    if (folder / '.git').exists():
        with contextlib.suppress(OSError, subprocess.SubprocessError):
            words = ['git', '-C', str(folder), 'describe', '--always', '--dirty', '--tags']
            said = subprocess.run(words, capture_output=True, text=True, timeout=5.0, check=True)
            versions['git'] = said.stdout.strip()
    versions['python'] = platform.python_version()
    for package in ('numpy', 'scipy', 'mujoco', 'mcap'):
        with contextlib.suppress(metadata.PackageNotFoundError):
            versions[package] = metadata.version(package)
    if distro := os.environ.get('ROS_DISTRO'):
        versions['ros'] = distro
    return versions | {'system': f'{platform.system()} {platform.machine()}'}


def promise(trial: Trial) -> str:
    """Return a sentence about the accuracy of the distance of a trial."""
    if trial.metrics is not None and trial.metrics.verdict:
        return f'the walk on {trial.fidelity} ended early: its accuracy is unknown'
    return str(trial.settings['fidelity_note'])


def settings(scene: Scene, policy: str, fidelity: str, sensing: str = 'markers') -> dict[str, Any]:
    """Return what pages and replays show of a trial's settings: scene, level and versions."""
    choice = levels.choose(scene, fidelity, policy)
    known = [asdict(each) for each in terms(scene, choice.level, policy)]
    return {
        'foot': scene.foot.source,
        'expected_load': scene.expected_load,
        'stride_m': scene.gait.stride,
        'cycle_s': scene.gait.cycle,
        'settle_s': scene.settle,
        'sensing': sensing,
        'faults': [str(fault) for fault in scene.faults],
        # JSON has no infinity.
        'fidelity_bound': choice.bound if choice.bound < math.inf else None,
        'fidelity_note': choice.note,
        'omitted': [each for each in known if not each['taken']],
        'taken': [each for each in known if each['taken']],
        'comparison': [],
        'version': ros_pad.__version__,
        'versions': made_with(),
        'conditions': described(scene),
    }


def described(scene: Scene) -> dict[str, Any]:
    """Return a scene as plain values for JSON, nested like its YAML, in SI units."""
    values: dict[str, Any] = asdict(scene)
    # The tables of a foot are computed from its other values.
    values['foot'] = {n: value for n, value in values['foot'].items() if n[0] != '_'}
    values['body'].pop('robot', None)  # its file is named
    values['faults'] = [str(fault) for fault in scene.faults]
    return values
