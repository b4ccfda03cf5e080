# SPDX-License-Identifier: Apache-2.0
"""The rows of a sweep: stored after each trial, read again, and their means over seeds."""

from __future__ import annotations

import csv
import hashlib
import importlib.util
import json
import math
import os
import pathlib
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import stdtrit

import ros_pad
from ros_pad.errors import InvalidInput, PadError
from ros_pad.trials.sweep.plan import Row, Sweep, scene_with
from ros_pad.trials.trial import Trial, fault_lines

RESULTS = 'trials.sqlite'
LAST_COLUMNS = ('level', 'verdict', 'error', 'real_time_factor')
SCENE = 'scene '  # prefix of the fingerprint of a scene in an identity
ABOUT = 'about'  # key of the row that says what the sweep is
AXES = 'axes'  # key of what is combined, which may grow


def columns_of(trial: Trial) -> Row:
    """Return the metrics of a trial by column, with one column for each leg of a list."""
    assert trial.metrics is not None
    found = trial.metrics.as_dict()
    found['cycles_walked'] = found.pop('cycles')  # a scene has a key of this name
    found['faults'] = '; '.join(fault_lines(found['faults']))
    found['refusals'] = '; '.join(found['refusals'])
    for name in [name for name, value in found.items() if isinstance(value, list)]:
        for leg, value in zip(trial.legs, found.pop(name), strict=True):
            found[f'{name}_leg{leg}'] = value
    return found | {'level': trial.fidelity, 'real_time_factor': trial.real_time_factor}


def identity(sweep: Sweep) -> dict[str, Any]:
    """Return version, fidelity, parameters and checksums of the scenes of a sweep, and its axes.

    Trials belong to one sweep only if these are the same; scenes and values may be added.
    """
    scenes = {name: scene_with(name, {}) for name in sweep.scenes}
    return {
        'version': ros_pad.__version__,
        'fidelity': sweep.fidelity,
        'parameters': sorted(sweep.parameters),
        # The representation of a scene holds all of its values, also those of its foot.
        **{
            f'{SCENE}{name}': hashlib.sha256(repr(scene).encode()).hexdigest()
            for name, scene in scenes.items()
        },
        AXES: {
            'scenes': list(sweep.scenes),
            'policies': list(sweep.policies or {each.policy: 0 for each in scenes.values()}),
            'seeds': list(sweep.seeds),
            'parameters': {name: list(each) for name, each in sweep.parameters.items()},
            'fidelity': sweep.fidelity,
        },
    }


@contextmanager
def _named(path: pathlib.Path) -> Iterator[None]:
    """Turn an error of a database into one that names its file."""
    try:
        yield
    except sqlite3.Error as error:
        if 'locked' in str(error):
            raise PadError(f'{path.parent}: a sweep is running here: wait for its end') from error
        raise PadError(f'{path} cannot be read or written: {error}') from error


def _stored(base: sqlite3.Connection) -> tuple[Row, dict[str, Row]]:
    """Return what a database says of its sweep, and the rows of finished trials by key."""
    rows = {key: json.loads(row) for key, row in base.execute('SELECT key, row FROM trial')}
    return rows.pop(ABOUT, {}), rows


class Results:
    """The finished trials of a sweep, in its folder. Only one process at a time can open them.

    Parameters
    ----------
    folder : path
        Created if it is missing; an existing folder must be empty or hold a sweep.
    about : mapping
        Result of :func:`identity`.
    keys : iterable of str
        Keys of all trials of the sweep.

    Raises
    ------
    InvalidInput
        When the folder holds something else, or another sweep; the message names the difference.
    PadError
        When another process has the results open, or their file is damaged.

    Attributes
    ----------
    folder : Path
    done : dict
        Rows of finished trials, by key.
    """

    def __init__(
        self, folder: str | os.PathLike[str], about: Mapping[str, Any], keys: Iterable[str]
    ) -> None:
        self.folder = pathlib.Path(folder)
        path = self.folder / RESULTS
        known = not self.folder.exists() or path.exists()
        if not known and not (self.folder.is_dir() and not any(self.folder.iterdir())):
            raise InvalidInput(
                f'{self.folder} exists, holds no sweep and is not overwritten: take a new folder'
            )
        self.folder.mkdir(parents=True, exist_ok=True)
        # SQLite's transactions survive a kill in the middle of writing.
        with _named(path), ExitStack() as stack:
            base = sqlite3.connect(path, timeout=0.0, isolation_level=None)
            self._base = stack.enter_context(closing(base))
            base.execute('PRAGMA locking_mode = EXCLUSIVE')
            base.execute('BEGIN EXCLUSIVE')
            base.execute('CREATE TABLE IF NOT EXISTS trial (key TEXT PRIMARY KEY, row TEXT)')
            before, self.done = _stored(base)
            self._refuse(before, about, set(keys))
            pair = ABOUT, json.dumps(before | dict(about))
            base.execute('INSERT OR REPLACE INTO trial VALUES (?, ?)', pair)
            base.execute('COMMIT')
            self.close = stack.pop_all().close

    def _refuse(self, before: Row, about: Mapping[str, Any], keys: set[str]) -> None:
        """Refuse another sweep, and one that lacks trials which are there."""
        for name, old in before.items():
            new = about.get(name)
            added = name == AXES or (name.startswith(SCENE) and new is None)
            if old != new and not added:
                raise InvalidInput(
                    f'{self.folder} holds a sweep with {name} {old}, not {new}: take a new folder'
                )
        if others := sorted(set(self.done) - keys):
            raise InvalidInput(
                f'{self.folder} holds {len(others)} trials that are not in this sweep, such as'
                f' {others[0]}: add their values to this sweep, or take a new folder'
            )

    def __enter__(self) -> Results:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def add(self, key: str, row: Row) -> None:
        """Write a row to the disk before returning; keep the row that a key has already."""
        with _named(self.folder / RESULTS):
            self._base.execute('INSERT OR IGNORE INTO trial VALUES (?, ?)', (key, json.dumps(row)))
        self.done.setdefault(key, row)

    def forget_failures(self) -> None:
        """Delete the rows of trials that failed, so that these trials run again."""
        for key in [key for key, row in self.done.items() if row.get('error')]:
            self._base.execute('DELETE FROM trial WHERE key = ?', (key,))
            del self.done[key]

    def rows(self, keys: Iterable[str]) -> list[Row]:
        """Return the finished rows, in the order of ``keys``, all with the same columns."""
        return _aligned([self.done[key] for key in keys if key in self.done])


def _aligned(rows: Sequence[Row]) -> list[Row]:
    """Return rows with the same columns; a value that a row lacks is None."""
    names = dict.fromkeys(name for row in rows for name in row if name not in LAST_COLUMNS)
    return [{name: row.get(name) for name in (*names, *LAST_COLUMNS)} for row in rows]


def write_tables(rows: Sequence[Row], folder: pathlib.Path) -> None:
    """Write ``trials.csv``, and ``trials.parquet`` if pyarrow is installed.

    Each file is replaced completely or not at all. Without rows, nothing is written.
    """
    if not rows:
        return
    new = folder / '.trials'
    with new.open('w', newline='', encoding='utf-8') as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    new.replace(folder / 'trials.csv')
    if importlib.util.find_spec('pyarrow'):
        import pyarrow.parquet

        pyarrow.parquet.write_table(pyarrow.Table.from_pylist(list(rows)), new)
        new.replace(folder / 'trials.parquet')


# --- reading ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Found:
    """The finished part of the sweep in a folder.

    Attributes
    ----------
    folder : Path
        Folder of the sweep.
    sweep : Sweep
        Scenes, policies, seeds and parameters, also of trials that are not finished.
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
        return {
            name.removeprefix(SCENE): str(value)
            for name, value in self.about.items()
            if name.startswith(SCENE)
        }


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
    if not is_sweep(folder):
        raise InvalidInput(f'{folder} holds no sweep: there is no {RESULTS} in it')
    path = (folder / RESULTS).resolve()
    with (
        _named(path),
        closing(sqlite3.connect(f'{path.as_uri()}?mode=ro', timeout=0.0, uri=True)) as base,
    ):
        about, done = _stored(base)
    rows = list(done.values())
    if not rows:
        raise InvalidInput(f'{folder}: no trial of this sweep is finished')
    sweep = Sweep(**about[AXES])
    axes = {'scene': sweep.scenes, **sweep.parameters}
    axes |= {'policy': sweep.policies, 'seed': sweep.seeds}
    rows.sort(key=lambda row: [
        own.index(row[name]) if row[name] is not None else -1 for name, own in axes.items()
    ])  # fmt: skip
    return Found(folder, sweep, _aligned(rows), about)


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
    groups: dict[tuple[Any, ...], list[float | None]] = {}
    for row in rows:
        good = not row.get('error') and not row.get('verdict')
        group = groups.setdefault(tuple(row[name] for name in names), [])
        group.append(row['distance_per_cycle_m'] if good else None)
    found = []
    for values, group in groups.items():
        distances = [each for each in group if each is not None]
        count, mean, low, high = len(distances), None, None, None
        if count:
            mean = float(np.mean(distances))
        if mean is not None and count > 1:
            half = float(stdtrit(count - 1, 0.975) * np.std(distances, ddof=1)) / math.sqrt(count)
            low, high = mean - half, mean + half
        labels = dict(zip(names, values, strict=True))
        found.append(Point(labels, count, len(group) - count, mean, low, high))
    return found
