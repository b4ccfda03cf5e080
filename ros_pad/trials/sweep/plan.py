# SPDX-License-Identifier: Apache-2.0
"""The plan of a sweep: its trials, checked before any of them runs."""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from ros_pad import configuration
from ros_pad.configuration import Table, choice, instance, integer
from ros_pad.control import POLICIES, policy_named
from ros_pad.control.policies import PREFIX
from ros_pad.control.policies import SETTINGS as POLICY_SETTINGS
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.estimation import SETTINGS, Tuning
from ros_pad.simulation import fidelity as levels
from ros_pad.simulation.scene import Scene
from ros_pad.trials.node_settings import Value, errors_naming, tuning_for
from ros_pad.yaml_text import read_yaml

_ESTIMATOR = [each.name for each in SETTINGS]
_POLICY = [each.name for each in POLICY_SETTINGS]

Row: TypeAlias = 'dict[str, Any]'
"""Values of a trial by column."""


@dataclass(frozen=True)
class Job:
    """One trial of a sweep, with everything that a process on another machine needs to run it.

    Attributes
    ----------
    labels : dict
        Scene, policy, seed and parameters, which identify the trial; first columns of its row.
    scene : Scene
        Scene with the parameters of this trial.
    policy : str
        Policy.
    level : str
        Fidelity level.
    seed : int
        Seed of floor and noise.
    tuning : Tuning
        Tuning of the estimators.
    policy_parameters : dict
        Parameters of the adaptive policy.
    """

    labels: Row
    scene: Scene
    policy: str
    seed: int
    level: str
    tuning: Tuning
    policy_parameters: dict[str, Any]

    @property
    def key(self) -> str:
        """Text that identifies this trial within its sweep."""
        return json.dumps(self.labels, sort_keys=True)

    def failed(self, error: object) -> Row:
        """Return the row that has an error in place of the metrics of this trial.

        Parameters
        ----------
        error : object
            Error of the trial.

        Returns
        -------
        dict
            Labels of the trial, and the text of the error.
        """
        return self.labels | {'level': self.level, 'error': str(error)}


@dataclass(frozen=True)
class Sweep:
    """Every combination of scenes, policies, seeds and parameters.

    Attributes
    ----------
    scenes : sequence of str
        Names of scenes, or paths of YAML files.
    policies : sequence of str
        ``flat``, ``dome``, ``adaptive``, ``oracle``; if empty, each scene's own policy.
    seeds : sequence of int
        Seeds of floor and noise, 0 to 2147483647.
    parameters : mapping
        Values by name: a parameter of the estimator node (``wet_prior``), one of the adaptive
        policy (``policy.dwell``), or a key of the scenes' YAML (``tow.weight``). Policies other
        than adaptive have no parameters: their trials run only once, with None for the values of
        ``policy.*``.
    fidelity : str
        ``auto`` or a fidelity level.

    Raises
    ------
    InvalidInput
        When scenes, seeds or the values of a parameter are empty, a value is given twice, a policy
        is unknown, or a seed or name is not allowed.

    Examples
    --------
    >>> from ros_pad.trials.sweep import Sweep
    >>> sweep = Sweep(['leg_wet_flat'], ['flat', 'dome'], range(3))
    >>> [(job.policy, job.seed) for job in sweep.jobs()]
    [('flat', 0), ('flat', 1), ('flat', 2), ('dome', 0), ('dome', 1), ('dome', 2)]
    """

    scenes: Sequence[str]
    policies: Sequence[str] = ()
    seeds: Sequence[int] = (0, 1, 2, 3, 4)
    parameters: Mapping[str, Sequence[Value]] = field(default_factory=dict)
    fidelity: str = 'auto'

    def __post_init__(self) -> None:
        instance('parameters', self.parameters, Mapping)
        axes = {'scene': self.scenes, 'policy': self.policies, 'seed': self.seeds}
        for name, values in (*axes.items(), *self.parameters.items()):
            if isinstance(values, str):
                raise InvalidInput(f'{name} = {values!r} is not allowed: a list is needed')
            if not values and name != 'policy':
                raise InvalidInput(f'{name}: at least one value is needed')
            for place, value in enumerate(values):
                if value in values[:place]:
                    raise InvalidInput(f'{name} = {value!r} is given twice')
        for policy in self.policies:
            choice('policy', policy, POLICIES)
        for seed in self.seeds:
            integer('seed', seed, 0, 2**31 - 1)
        for name in self.parameters:
            # Reading the scene refuses other unknown names.
            known, head = [*_ESTIMATOR, *_POLICY], name.rpartition('.')[0]
            if name == 'policy' or (head in ('policy', 'estimator') and name not in known):
                choice('parameter', name, known)

    def jobs(self) -> list[Job]:
        """Return the trials, in order, each checked as far as is possible without running it.

        Returns
        -------
        list of Job
            The trials.

        Raises
        ------
        ConfigError, InvalidInput
            When a value is not allowed; the message names it, its parameter and what is allowed.
        """
        found: dict[str, Job] = {}
        for source, given in itertools.product(
            self.scenes, itertools.product(*self.parameters.values())
        ):
            values = dict(zip(self.parameters, given, strict=True))
            of_policy = {name: value for name, value in values.items() if name in _POLICY}
            of_estimator = {name: value for name, value in values.items() if name in _ESTIMATOR}
            of_scene = {n: v for n, v in values.items() if n not in of_policy | of_estimator}
            scene = scene_with(source, of_scene)
            with errors_naming(of_estimator):
                tuning = Tuning.of(tuning_for(scene).values | of_estimator)
            for policy in self.policies or (scene.policy,):
                labels: dict[str, Any] = dict(values)
                parameters: dict[str, Any] = {}
                if policy == 'adaptive':
                    parameters = {n.removeprefix(PREFIX): v for n, v in of_policy.items()}
                    with errors_naming(of_policy):
                        policy_named(policy, None, parameters)
                else:
                    labels |= dict.fromkeys(of_policy)
                level = levels.level(scene, self.fidelity, policy)
                for seed in self.seeds:
                    identity = {'scene': source, 'policy': policy, 'seed': seed} | labels
                    job = Job(identity, scene, policy, seed, level, tuning, parameters)
                    found.setdefault(job.key, job)
        policies = {job.policy for job in found.values()}
        for name in self.parameters:
            if name in _POLICY and 'adaptive' not in policies:
                raise InvalidInput(
                    f'parameter {name!r}: only adaptive has parameters, but the policies of this'
                    f' sweep are {", ".join(sorted(policies))}'
                )
        return list(found.values())


def scene_with(source: str | os.PathLike[str], values: Mapping[str, Value]) -> Scene:
    """Read a scene with changed values of some dotted keys of its YAML, such as ``tow.weight``.

    Parameters
    ----------
    source : str or path
        Name of a shipped scene, or path of a YAML file.
    values : mapping
        Values by dotted key.

    Returns
    -------
    Scene
        The scene.

    Raises
    ------
    ConfigError
        When :meth:`Scene.load` raises it, or when a name is below a key that has no keys below
        it. The message names the changed values.
    """
    path = configuration.locate('scenes', source)
    Table.load(path)  # reports errors of the file itself without naming the values
    content = read_yaml(path.read_text(encoding='utf-8'))
    with errors_naming(values):
        for name, value in values.items():
            *folders, key = name.split('.')
            place = content
            for folder in folders:
                place = place.setdefault(folder, {})
                if not isinstance(place, dict):
                    raise ConfigError(
                        f'{path}: {folder} = {place!r} has no keys below it: {name} is unknown'
                    )
            place[key] = value
        return Scene.read(Table(content, os.fspath(path)), os.fspath(source), path.stem)
