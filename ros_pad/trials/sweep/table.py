# SPDX-License-Identifier: Apache-2.0
"""The rows of a sweep: stored after each trial, and written as a table at the end."""

from __future__ import annotations

import csv
import hashlib
import importlib.util
import json
import os
import pathlib
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import ros_pad
from ros_pad.errors import InvalidInput, PadError
from ros_pad.trials.sweep.plan import Row, Sweep, scene_with
from ros_pad.trials.trial import Trial, fault_lines

RESULTS = 'trials.sqlite'
LAST_COLUMNS = ('level', 'verdict', 'error', 'real_time_factor')
SCENE = 'scene '  # prefix of the fingerprint of a scene in an identity


def columns_of(trial: Trial) -> Row:
    """Return the metrics of a trial by column, with one column for each leg of a list."""
    assert trial.metrics is not None
    found: Row = {}
    for name, value in trial.metrics.as_dict().items():
        if name == 'refusals':
            found[name] = '; '.join(value)
        elif name == 'faults':
            found[name] = '; '.join(fault_lines(value))
        elif name == 'cycles':  # renamed, because a scene has a key of this name
            found['cycles_walked'] = value
        elif isinstance(value, list):
            found |= {
                f'{name}_leg{leg}': each for leg, each in zip(trial.legs, value, strict=True)
            }
        else:
            found[name] = value
    return found | {'level': trial.fidelity, 'real_time_factor': trial.real_time_factor}


def identity(sweep: Sweep) -> dict[str, Any]:
    """Return version, fidelity, parameters and checksums of the scenes of a sweep.

    Trials belong to one sweep only if these are the same; scenes may be added.
    """
    scenes = {
        # The representation of a scene holds all of its values, also those of its foot.
        f'{SCENE}{each}': hashlib.sha256(repr(scene_with(each, {})).encode()).hexdigest()
        for each in sweep.scenes
    }
    return {
        'version': ros_pad.__version__,
        'fidelity': sweep.fidelity,
        'parameters': sorted(sweep.parameters),
        **scenes,
    }


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
        self._base = sqlite3.connect(path, timeout=0.0, isolation_level=None)
        try:
            with self._named():
                self._open(about, set(keys))
        except BaseException:
            self._base.close()
            raise

    @contextmanager
    def _named(self) -> Iterator[None]:
        """Turn an error of the database into one that names its file."""
        try:
            yield
        except sqlite3.Error as error:
            if 'locked' in str(error):
                raise PadError(
                    f'{self.folder}: another sweep is running in this folder: wait for its end'
                ) from error
            # A full disk, or a folder without the right to write, damages nothing.
            full = isinstance(error, sqlite3.OperationalError)
            what = 'cannot be written' if full else 'is damaged'
            raise PadError(f'{self.folder / RESULTS} {what}: {error}') from error

    def _open(self, about: Mapping[str, Any], keys: set[str]) -> None:
        base = self._base
        base.execute('PRAGMA locking_mode = EXCLUSIVE')
        base.execute('BEGIN EXCLUSIVE')
        base.execute('CREATE TABLE IF NOT EXISTS about (name TEXT PRIMARY KEY, value TEXT)')
        base.execute('CREATE TABLE IF NOT EXISTS trial (key TEXT PRIMARY KEY, row TEXT)')
        self._compare(about)
        rows = base.execute('SELECT key, row FROM trial')
        self._rows = {key: json.loads(row) for key, row in rows}
        self._refuse_others(keys)
        for name, value in about.items():
            base.execute('INSERT OR REPLACE INTO about VALUES (?, ?)', (name, json.dumps(value)))
        base.execute('COMMIT')

    def _compare(self, about: Mapping[str, Any]) -> None:
        for name, text in self._base.execute('SELECT name, value FROM about').fetchall():
            before, now = json.loads(text), about.get(name)
            if before == now or (name.startswith(SCENE) and now is None):
                continue
            if name.startswith(SCENE):
                raise InvalidInput(
                    f'{self.folder}: {name} has changed since these trials: take a new folder'
                )
            raise InvalidInput(
                f'{self.folder} holds a sweep with {name} {before}, not {now}: take a new folder'
            )

    def _refuse_others(self, keys: set[str]) -> None:
        others = sorted(set(self._rows) - keys)
        if others:
            first = ', '.join(f'{name}={value}' for name, value in json.loads(others[0]).items())
            raise InvalidInput(
                f'{self.folder} holds {len(others)} trials that are not in this sweep, such as'
                f' {first}: add their values to this sweep, or take a new folder'
            )

    def __enter__(self) -> Results:
        return self

    def __exit__(self, *error: object) -> None:
        self._base.close()

    def __contains__(self, key: str) -> bool:
        return key in self._rows

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, key: str, row: Row) -> None:
        """Write a row to the disk before returning; keep the row that a key has already."""
        with self._named():
            self._base.execute('INSERT OR IGNORE INTO trial VALUES (?, ?)', (key, json.dumps(row)))
        self._rows.setdefault(key, row)

    def forget_failures(self) -> None:
        """Delete the rows of trials that failed, so that these trials run again."""
        for key in [key for key, row in self._rows.items() if row.get('error')]:
            self._base.execute('DELETE FROM trial WHERE key = ?', (key,))
            del self._rows[key]

    def rows(self, keys: Iterable[str]) -> list[Row]:
        """Return the finished rows, in the order of ``keys``, all with the same columns."""
        return aligned([self._rows[key] for key in keys if key in self._rows])


def aligned(rows: Sequence[Row]) -> list[Row]:
    """Return rows with the same columns; a value that a row lacks is None."""
    names = dict.fromkeys(name for row in rows for name in row if name not in LAST_COLUMNS)
    return [{name: row.get(name) for name in (*names, *LAST_COLUMNS)} for row in rows]


def write_tables(rows: Sequence[Row], folder: pathlib.Path) -> list[pathlib.Path]:
    """Write ``trials.csv``, and ``trials.parquet`` if pyarrow is installed; return the paths.

    Each file is replaced completely or not at all. Without rows, nothing is written.
    """
    if not rows:
        return []
    paths = [folder / 'trials.csv']
    with _replacing(paths[0]) as part, part.open('w', newline='', encoding='utf-8') as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    if importlib.util.find_spec('pyarrow'):
        import pyarrow.parquet

        paths.append(folder / 'trials.parquet')
        with _replacing(paths[1]) as part:
            pyarrow.parquet.write_table(pyarrow.Table.from_pylist(list(rows)), part)
    return paths


@contextmanager
def _replacing(path: pathlib.Path) -> Iterator[pathlib.Path]:
    part = path.with_name(f'.{path.name}')
    yield part
    part.replace(path)
