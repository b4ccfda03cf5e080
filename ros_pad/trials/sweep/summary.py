# SPDX-License-Identifier: Apache-2.0
"""Read a sweep from its folder, and compute the means over its seeds."""

from __future__ import annotations

import json
import math
import os
import pathlib
import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import stdtrit

from ros_pad.control import POLICIES
from ros_pad.errors import InvalidInput, PadError
from ros_pad.trials.sweep.plan import Row, Sweep
from ros_pad.trials.sweep.table import RESULTS, SCENE, aligned


@dataclass(frozen=True)
class Found:
    """The finished part of the sweep in a folder.

    Attributes
    ----------
    folder : Path
        Folder of the sweep.
    sweep : Sweep
        Scenes, policies, seeds and parameters of the finished trials.
    rows : list of dict
        One row for each finished trial, in the order of the sweep, all with the same columns.
    about : dict
        Version, fidelity, parameters and checksums of the scenes.
    """

    folder: pathlib.Path
    sweep: Sweep
    rows: list[Row]
    about: dict[str, Any]

    @property
    def fingerprints(self) -> dict[str, str]:
        """Checksum of the content of each scene."""
        found = (item for item in self.about.items() if item[0].startswith(SCENE))
        return {name.removeprefix(SCENE): str(value) for name, value in found}


def is_sweep(folder: str | os.PathLike[str]) -> bool:
    """Return whether a folder holds a sweep.

    Parameters
    ----------
    folder : str or path
        The folder.

    Returns
    -------
    bool
        True if it has the file of a sweep.
    """
    return (pathlib.Path(folder) / RESULTS).is_file()


def read(folder: str | os.PathLike[str]) -> Found:
    """Read the finished trials of a sweep, without changing its folder.

    Parameters
    ----------
    folder : str or path
        Folder of the sweep.

    Returns
    -------
    Found
        Its finished trials.

    Raises
    ------
    InvalidInput
        When the folder holds no sweep, or no trial of it is finished.
    PadError
        When the sweep is running, or its file is damaged.
    """
    folder = pathlib.Path(folder)
    path = folder / RESULTS
    if not path.is_file():
        raise InvalidInput(f'{folder} holds no sweep: there is no {RESULTS} in it')
    try:
        uri = f'{path.resolve().as_uri()}?mode=ro'
        with closing(sqlite3.connect(uri, timeout=0.0, uri=True)) as base:
            pairs = base.execute('SELECT name, value FROM about ORDER BY rowid').fetchall()
            rows = [json.loads(row) for (row,) in base.execute('SELECT row FROM trial')]
    except sqlite3.Error as error:
        if 'locked' in str(error):
            raise PadError(f'{folder}: a sweep is running here: wait for its end') from error
        raise PadError(f'{path} is damaged: {error}') from error
    if not rows:
        raise InvalidInput(f'{folder}: no trial of this sweep is finished')
    about = {name: json.loads(value) for name, value in pairs}
    sweep = _sweep_of(rows, about)
    # A sweep runs in this order: scenes, then parameters, then policies, then seeds.
    axes: dict[str, Sequence[Any]] = {
        'scene': sweep.scenes, **sweep.parameters, 'policy': sweep.policies, 'seed': sweep.seeds,
    }  # fmt: skip
    places = [(name, {value: at for at, value in enumerate(axes[name])}) for name in axes]
    rows.sort(key=lambda row: [place.get(row[name], -1) for name, place in places])
    return Found(folder, sweep, aligned(rows), about)


def _sweep_of(rows: Sequence[Row], about: Mapping[str, Any]) -> Sweep:
    # A row begins with its labels, in the order of the command line.
    names = [name for name in rows[0] if name in about['parameters']]
    scenes = [name.removeprefix(SCENE) for name in about if name.startswith(SCENE)]
    done = {row['scene'] for row in rows}
    return Sweep(
        [scene for scene in scenes if scene in done],
        [each for each in POLICIES if each in _values(rows, 'policy')],
        _values(rows, 'seed'),
        {name: _values(rows, name) for name in names},
        about['fidelity'],
    )


def _values(rows: Iterable[Row], name: str) -> list[Any]:
    """Return the different values of a column: sorted numbers, or texts in alphabetical order."""
    found = {row[name] for row in rows if row[name] is not None}
    if all(isinstance(each, (int, float)) for each in found):
        return sorted(found)
    return sorted(found, key=str)


@dataclass(frozen=True)
class Point:
    """Distance per gait cycle for one scene, policy and combination of parameters, over all seeds.

    Attributes
    ----------
    labels : dict
        Scene, policy and parameters by name.
    walks : int
        Number of walks in the mean, which neither failed nor ended early.
    left_out : int
        Number of walks that failed or ended early.
    mean : float or None
        Mean distance, m; None without walks.
    low : float or None
        Lower end of the 95 % interval of the mean by Student's t, m; None for fewer than two
        walks.
    high : float or None
        Upper end of this interval, m.
    """

    labels: Row
    walks: int
    left_out: int
    mean: float | None
    low: float | None
    high: float | None


def points(rows: Iterable[Row], parameters: Iterable[str]) -> list[Point]:
    """Return the mean distance per cycle over the seeds, for each combination of the rest.

    Parameters
    ----------
    rows : iterable of dict
        Rows of a sweep, from :func:`run` or :func:`read`.
    parameters : iterable of str
        Names of the parameters of the sweep.

    Returns
    -------
    list of Point
        Mean distance, m, and its 95 % interval.
    """
    names = ('scene', 'policy', *parameters)
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    found = []
    for values, group in groups.items():
        distances = [
            row['distance_per_cycle_m']
            for row in group
            if not row.get('error') and not row.get('verdict')
        ]
        mean = low = high = None
        if distances:
            mean = float(np.mean(distances))
        if mean is not None and len(distances) > 1:
            half = float(stdtrit(len(distances) - 1, 0.975) * np.std(distances, ddof=1))
            half /= math.sqrt(len(distances))
            low, high = mean - half, mean + half
        labels = dict(zip(names, values, strict=True))
        left_out = len(group) - len(distances)
        found.append(Point(labels, len(distances), left_out, mean, low, high))
    return found
