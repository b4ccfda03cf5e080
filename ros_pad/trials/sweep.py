# SPDX-License-Identifier: Apache-2.0
"""Sweeps: scenes x policies x seeds x ranges of parameters, on all cores or on a Dask cluster.

A sweep lives in a folder. Each trial that is done is one transaction in ``trials.sqlite`` there,
so a sweep that was killed goes on where it stopped. ``trials.csv`` (and ``trials.parquet`` where
pyarrow is installed) is written at the end: a row a trial.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import csv
import difflib
import hashlib
import importlib.util
import itertools
import json
import math
import multiprocessing
import os
import pathlib
import signal
import sqlite3
import threading
from collections import deque
from collections.abc import Callable
from collections.abc import Generator
from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from contextlib import suppress
from dataclasses import dataclass
from dataclasses import field
from dataclasses import fields
from dataclasses import replace
from multiprocessing.connection import Connection
from typing import Any
from typing import TypeAlias

import numpy as np
import yaml
from scipy.special import stdtrit

import ros_pad
from ros_pad import configuration
from ros_pad.configuration import Table
from ros_pad.control import POLICIES
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.errors import PadError
from ros_pad.estimation import Tuning
from ros_pad.simulation import fidelity as ladder
from ros_pad.simulation.scene import Scene
from ros_pad.trials import loop
from ros_pad.trials.trial import Trial
from ros_pad.trials.trial import told

ESTIMATOR, POLICY = 'estimator.', 'policy.'  # what is no key of a scene begins with one of these
RESULTS = 'trials.sqlite'
LARGEST_SEED = 2**31 - 1
LAST_COLUMNS = ('rung', 'verdict', 'error', 'real_time_factor')
PATIENCE = 20.0  # s for a Dask scheduler, or for its first worker, to answer

Value: TypeAlias = 'float | int | bool | str'
Row: TypeAlias = 'dict[str, Any]'
Progress: TypeAlias = Callable[[int, int], None]


@dataclass(frozen=True)
class Job:
    """One trial of a sweep, with all that a process on another machine needs to walk it.

    Attributes
    ----------
    labels : dict
        First columns of its row: scene, policy, seed, each parameter. They tell it from others.
    scene : Scene
        With the parameters of this trial.
    policy, rung : str
    seed : int
    tuning : Tuning
        Of the estimators.
    policy_parameters : dict
        Of the adaptive policy.
    """

    labels: Row
    scene: Scene
    policy: str
    seed: int
    rung: str
    tuning: Tuning
    policy_parameters: dict[str, Any]

    @property
    def key(self) -> str:
        """What tells this trial from the others of its sweep."""
        return json.dumps(self.labels, sort_keys=True)

    def failed(self, error: object) -> Row:
        """Return the row of this trial when it came to nothing."""
        return self.labels | {'rung': self.rung, 'error': str(error)}


@dataclass(frozen=True)
class Sweep:
    """What is to be walked: every combination.

    Attributes
    ----------
    scenes : sequence of str
        Names of scenes, or paths of YAML files.
    policies : sequence of str
        ``flat``, ``dome``, ``adaptive``, ``oracle``; none takes each scene's own.
    seeds : sequence of int
        Of floor and noise, 0 to 2147483647.
    parameters : mapping
        For each name its values. A dotted name is a key of the scenes' YAML (``tow.weight``);
        ``estimator.`` goes before an attribute of :class:`ros_pad.estimation.Tuning` and
        ``policy.`` before a parameter of :func:`ros_pad.control.adaptive`. Policies other than
        adaptive have no parameters: their trials are walked once, with None for these.
    fidelity : str
        ``auto`` or a rung of the ladder.

    Raises
    ------
    InvalidInput
        For nothing to walk, something that is there twice, an unknown policy, or a seed or name
        that is not allowed.
    """

    scenes: Sequence[str]
    policies: Sequence[str] = ()
    seeds: Sequence[int] = (0, 1, 2, 3, 4)
    parameters: Mapping[str, Sequence[Value]] = field(default_factory=dict)
    fidelity: str = 'auto'

    def __post_init__(self) -> None:
        swept: dict[str, Sequence[Any]] = {
            'scene': self.scenes,
            'policy': self.policies,
            'seed': self.seeds,
        }
        for name, values in (*swept.items(), *self.parameters.items()):
            if not values and name != 'policy':
                raise InvalidInput(f'{name}: at least one value is needed')
            for place, value in enumerate(values):
                if value in values[:place]:
                    raise InvalidInput(f'{name} = {value!r}: is there twice')
        for policy in self.policies:
            if policy not in POLICIES:
                raise InvalidInput(f'policy = {policy!r}: one of {", ".join(POLICIES)} is needed')
        for seed in self.seeds:
            whole = isinstance(seed, int) and not isinstance(seed, bool)
            if not whole or not 0 <= seed <= LARGEST_SEED:
                raise InvalidInput(
                    f'seed = {seed!r}: a whole number from 0 to {LARGEST_SEED} is needed'
                )
        for name in self.parameters:
            if name == 'policy':
                raise InvalidInput("parameter 'policy': policies are swept as such (--policy)")
            for prefix, known in (
                (ESTIMATOR, tuple(each.name for each in fields(Tuning))),
                (POLICY, loop.POLICY_PARAMETERS),
            ):
                if name.startswith(prefix) and name.removeprefix(prefix) not in known:
                    near = difflib.get_close_matches(name.removeprefix(prefix), known, n=1)
                    hint = f' Did you mean {prefix + near[0]!r}?' if near else ''
                    raise InvalidInput(
                        f'parameter {name!r} is unknown.{hint}'
                        f' After {prefix!r} are allowed: {", ".join(known)}'
                    )

    def jobs(self) -> list[Job]:
        """Return the trials, in order; each has been checked as far as that goes without walking.

        Raises
        ------
        ConfigError, InvalidInput
            Naming the parameter, its value and what is allowed.
        """
        found: dict[str, Job] = {}
        for source, values in itertools.product(self.scenes, self._combinations()):
            scene = scene_with(
                source, {n: v for n, v in values.items() if not n.startswith((ESTIMATOR, POLICY))}
            )
            tuning = self._tuning(scene, values)
            for policy in self.policies or (scene.policy,):
                chosen: dict[str, Value | None] = dict(values)
                of_policy = {n: v for n, v in values.items() if n.startswith(POLICY)}
                parameters: dict[str, Any] = {}
                if policy == 'adaptive':
                    parameters = {n.removeprefix(POLICY): v for n, v in of_policy.items()}
                    with _told(of_policy):
                        loop.adaptive_with(parameters)
                else:
                    chosen |= dict.fromkeys(of_policy)
                rung = ladder.rung(scene, self.fidelity, policy)
                for seed in self.seeds:
                    labels = {'scene': source, 'policy': policy, 'seed': seed} | chosen
                    job = Job(labels, scene, policy, seed, rung, tuning, parameters)
                    found.setdefault(job.key, job)
        heard = {job.policy for job in found.values()}
        for name in self.parameters:
            if name.startswith(POLICY) and 'adaptive' not in heard:
                raise InvalidInput(
                    f'parameter {name!r}: only adaptive has parameters, and the policies are'
                    f' {", ".join(sorted(heard))}'
                )
        return list(found.values())

    def _combinations(self) -> Iterator[dict[str, Value]]:
        for values in itertools.product(*self.parameters.values()):
            yield dict(zip(self.parameters, values, strict=True))

    def _tuning(self, scene: Scene, values: Mapping[str, Value]) -> Tuning:
        own = {name: value for name, value in values.items() if name.startswith(ESTIMATOR)}
        changes: dict[str, Any] = {n.removeprefix(ESTIMATOR): value for n, value in own.items()}
        with _told(own):
            return replace(loop.tuning_for(scene), **changes)


@contextmanager
def _told(values: Mapping[str, Value]) -> Iterator[None]:
    """Let an error say first which parameters of the sweep it comes of."""
    try:
        yield
    except (ConfigError, InvalidInput) as error:
        if not values:
            raise
        given = ', '.join(f'{name}={value}' for name, value in values.items())
        raise type(error)(f'{given}: {error}') from error


def scene_with(source: str | os.PathLike[str], values: Mapping[str, Value]) -> Scene:
    """Read a scene with other values at some dotted names of its YAML, such as ``tow.weight``.

    Raises
    ------
    ConfigError
        As :meth:`Scene.load`, and for a name that leads nowhere; names the values.
    """
    path = configuration.locate('scenes', source)
    Table.load(path)  # says what is wrong with the file itself
    content = yaml.safe_load(path.read_text(encoding='utf-8'))
    with _told(values):
        for name, value in values.items():
            *folders, key = name.split('.')
            place = content
            for folder in folders:
                place = place.setdefault(folder, {})
                if not isinstance(place, dict):
                    raise ConfigError(
                        f'{path}: {folder} = {place!r} is no table of keys, so there is no {name}'
                    )
            place[key] = value
        return Scene.read(Table(content, os.fspath(path)), os.fspath(source), path.stem)


def walk(job: Job) -> Row:
    """Walk one trial and return its row; a trial that fails is a row with its error."""
    try:
        trial = loop.run(
            job.scene,
            job.policy,
            job.seed,
            job.rung,
            tuning=job.tuning,
            policy_parameters=job.policy_parameters,
        )
    except Exception as error:  # whatever it is, the others shall go on
        return job.failed(f'{type(error).__name__}: {error}')
    return job.labels | columns_of(trial)


def columns_of(trial: Trial) -> Row:
    """Return the figures of a trial as plain values, lists with a column a leg."""
    assert trial.metrics is not None
    found: Row = {}
    for name, value in trial.metrics.as_dict().items():
        if name == 'refusals':
            found[name] = '; '.join(value)
        elif name == 'faults':
            found[name] = '; '.join(told(value))
        elif name == 'cycles':  # what a scene calls so are those that it asks for
            found['cycles_walked'] = value
        elif isinstance(value, list):
            found |= {
                f'{name}_leg{leg}': each for leg, each in zip(trial.legs, value, strict=True)
            }
        else:
            found[name] = value
    found['rung'] = trial.fidelity
    found['real_time_factor'] = trial.real_time_factor
    return found


# --- what is done -------------------------------------------------------------------------------


class Results:
    """The trials of a sweep that are done, in its folder. One process at a time has it open.

    Parameters
    ----------
    folder : path
        Made if need be; one that exists must be empty or hold a sweep.
    about : mapping
        What must not have changed since, by name; scenes with their fingerprints.
    keys : iterable of str
        Of the trials that the sweep asks for.

    Raises
    ------
    InvalidInput
        When the folder holds something else, or another sweep: says what differs.
    PadError
        When another process has it open, or the file is damaged.
    """

    def __init__(
        self, folder: str | os.PathLike[str], about: Mapping[str, Any], keys: Iterable[str]
    ) -> None:
        self.folder = pathlib.Path(folder)
        path = self.folder / RESULTS
        known = not self.folder.exists() or path.exists()
        if not known and not (self.folder.is_dir() and not any(self.folder.iterdir())):
            raise InvalidInput(
                f'{self.folder}: exists and holds no sweep, and nothing is ever overwritten'
            )
        self.folder.mkdir(parents=True, exist_ok=True)
        # SQLite's transactions are what survives a kill in the middle of writing.
        self._base = sqlite3.connect(path, timeout=0.0, isolation_level=None)
        try:
            self._base.execute('PRAGMA locking_mode = EXCLUSIVE')
            self._base.execute('BEGIN EXCLUSIVE')
            for table in (
                'about (name TEXT PRIMARY KEY, value TEXT)',
                'trial (key TEXT PRIMARY KEY, row TEXT)',
            ):
                self._base.execute(f'CREATE TABLE IF NOT EXISTS {table}')
            self._compare(about)
            self._rows = {
                key: json.loads(row)
                for key, row in self._base.execute('SELECT key, row FROM trial')
            }
            self._refuse_others(set(keys))
            for name, value in about.items():
                self._base.execute(
                    'INSERT OR REPLACE INTO about VALUES (?, ?)', (name, json.dumps(value))
                )
            self._base.execute('COMMIT')
        except sqlite3.Error as error:
            self._base.close()
            if 'locked' in str(error):
                raise PadError(f'{self.folder}: another sweep is at work in it') from error
            raise PadError(f'{path}: is damaged: {error}') from error
        except BaseException:
            self._base.close()
            raise

    def _compare(self, about: Mapping[str, Any]) -> None:
        for name, text in self._base.execute('SELECT name, value FROM about').fetchall():
            before, now = json.loads(text), about.get(name)
            if before == now or (name.startswith('scene ') and now is None):
                continue
            if name.startswith('scene '):
                raise InvalidInput(f'{self.folder}: {name} has changed since: take a new folder')
            raise InvalidInput(
                f'{self.folder}: holds a sweep with {name} {before}, not {now}: take a new folder'
            )

    def _refuse_others(self, keys: set[str]) -> None:
        others = sorted(set(self._rows) - keys)
        if others:
            first = ', '.join(f'{name}={value}' for name, value in json.loads(others[0]).items())
            raise InvalidInput(
                f'{self.folder}: holds {len(others)} trials that this sweep does not ask for, as'
                f' {first}: ask for them too, or take a new folder'
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
        """Keep a row for good, before this returns; a key that is there already is left alone."""
        self._base.execute('INSERT OR IGNORE INTO trial VALUES (?, ?)', (key, json.dumps(row)))
        self._rows.setdefault(key, row)

    def forget_failures(self) -> None:
        """Drop the rows with an error."""
        for key in [key for key, row in self._rows.items() if row.get('error')]:
            self._base.execute('DELETE FROM trial WHERE key = ?', (key,))
            del self._rows[key]

    def rows(self, keys: Iterable[str]) -> list[Row]:
        """Return the rows that are there, in the order of ``keys``, all with the same columns."""
        found = [self._rows[key] for key in keys if key in self._rows]
        names = dict.fromkeys(name for row in found for name in row if name not in LAST_COLUMNS)
        return [{name: row.get(name) for name in (*names, *LAST_COLUMNS)} for row in found]


def run(
    sweep: Sweep,
    folder: str | os.PathLike[str],
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
    retry: bool = False,
) -> list[Row]:
    """Walk what is not done yet, keep it in a folder, and return all rows.

    A script that calls this needs ``if __name__ == '__main__':``, as for every pool of processes.

    Parameters
    ----------
    sweep : Sweep
        What to walk.
    folder : path
        New, or of the same sweep, perhaps with less of it: then that goes on.
    workers : int or None
        Processes, 1 or more; None is one for each core.
    scheduler : str or None
        Address of a Dask scheduler, which is used instead: ``tcp://host:8786``.
    progress : callable or None
        Called with the trials that are done, and all.
    retry : bool
        Whether trials that failed before are walked again.

    Returns
    -------
    list of dict
        A row a trial, in the order of the sweep, the same whatever the number of workers but for
        the real-time factor.

    Raises
    ------
    ConfigError, InvalidInput
        For what is not allowed, before anything is walked.
    PadError
        When Dask is missing or its cluster does not answer.
    """
    if workers is not None and (not isinstance(workers, int) or workers < 1):
        raise InvalidInput(f'workers = {workers!r}: a whole number from 1 is needed')
    jobs = {job.key: job for job in sweep.jobs()}
    client = None if scheduler is None else _dask_client(scheduler)
    try:
        with Results(folder, _about(sweep), jobs) as results:
            if retry:
                results.forget_failures()
            missing = [job for key, job in jobs.items() if key not in results]
            walked = _on_dask(client, missing) if client else on_cores(missing, workers)
            try:
                if progress:
                    progress(len(results), len(jobs))
                for job, row in walked:
                    results.add(job.key, row)
                    if progress:
                        progress(len(results), len(jobs))
            finally:
                walked.close()
                rows = results.rows(jobs)
                write_tables(rows, results.folder)
            return rows
    finally:
        if client:
            client.close()


def _about(sweep: Sweep) -> dict[str, Any]:
    """Return what must be the same for trials to belong to one sweep."""
    scenes = {
        # All of a scene, its foot too, is in its representation.
        f'scene {each}': hashlib.sha256(repr(scene_with(each, {})).encode()).hexdigest()
        for each in sweep.scenes
    }
    return {
        'version': ros_pad.__version__,
        'fidelity': sweep.fidelity,
        'parameters': sorted(sweep.parameters),
        **scenes,
    }


# --- on the cores of this machine ---------------------------------------------------------------

Walked: TypeAlias = 'Generator[tuple[Job, Row], None, None]'


def on_cores(jobs: Sequence[Job], workers: int | None = None) -> Walked:
    """Yield jobs with their rows as they are done, from a pool of processes.

    A process that dies (of too little memory, say) takes the pool with it: the trials that were
    in it are walked again, each alone, and that whose process dies again has failed.
    """
    workers = workers or _cores()
    left = deque(jobs)
    while left:
        suspects = yield from _until_broken(left, min(workers, len(left)))
        for job in suspects:
            if (yield from _until_broken(deque([job]), 1)):
                yield job, job.failed('the process that walked it died: too little memory?')


def _until_broken(left: deque[Job], workers: int) -> Generator[tuple[Job, Row], None, list[Job]]:
    """Walk what is left; return what was in the pool if that broke."""
    context = multiprocessing.get_context('spawn')
    alive, parent = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(workers, context, _start_worker, (alive,))
    walking: dict[concurrent.futures.Future[Row], Job] = {}
    try:
        while left or walking:
            # A few more than workers, so that none waits for work.
            while left and len(walking) < 2 * workers:
                walking[pool.submit(walk, left[0])] = left[0]
                left.popleft()
            done, _ = concurrent.futures.wait(walking, return_when='FIRST_COMPLETED')
            for future in done:
                row = future.result()
                yield walking.pop(future), row
    except BrokenProcessPool:
        return list(walking.values())
    finally:
        parent.close()  # ends workers that are still walking
        pool.shutdown(cancel_futures=True)
        alive.close()
    return []


def _start_worker(alive: Connection) -> None:
    # Ctrl-C in a terminal goes to all processes; the first one tells the others.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, args=(alive,), daemon=True).start()


def _end_with_parent(alive: Connection) -> None:
    """End this process when the other end of a pipe is closed, also by a kill."""
    with suppress(EOFError, OSError):
        alive.recv_bytes()
    os._exit(1)


def _cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, 'sched_getaffinity'):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# --- on a Dask cluster --------------------------------------------------------------------------


def version() -> str:
    """Return the version of ros_pad, as workers of a cluster are asked for theirs."""
    return ros_pad.__version__


def _dask_client(address: str) -> Any:
    """Return a client of a scheduler whose workers have this version of ros_pad."""
    try:
        import distributed
    except ModuleNotFoundError as error:
        raise PadError(f'Dask is not here ({error}): pip install "ros_pad[sweep]"') from error
    try:
        client = distributed.Client(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise PadError(f'scheduler {address}: does not answer: {error}') from error
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
        for worker, theirs in client.run(version).items():
            if theirs != version():
                raise PadError(f'worker {worker} has ros_pad {theirs}, here is {version()}')
    except TimeoutError as error:
        client.close()
        raise PadError(f'scheduler {address}: has no workers after {PATIENCE:g} s') from error
    except ImportError as error:
        client.close()
        raise PadError(f'workers of {address} need ros_pad {version()}: {error}') from error
    except BaseException:
        client.close()
        raise
    return client


def _on_dask(client: Any, jobs: Sequence[Job]) -> Walked:
    """Yield jobs with their rows as they are done; Dask walks again what a lost worker had."""
    import distributed

    futures = {client.submit(walk, job, pure=False): job for job in jobs}
    try:
        for future in distributed.as_completed(list(futures)):
            job = futures.pop(future)
            try:
                row = future.result()
            except (concurrent.futures.CancelledError, asyncio.CancelledError) as error:
                raise PadError(f'the Dask scheduler is gone: {error}') from error
            except Exception as error:  # a job that has ended several workers, for one
                row = job.failed(f'{type(error).__name__}: {error}')
            yield job, row
    finally:
        client.cancel(list(futures))


# --- what came out ------------------------------------------------------------------------------


def write_tables(rows: Sequence[Row], folder: pathlib.Path) -> list[pathlib.Path]:
    """Write ``trials.csv``, and ``trials.parquet`` where pyarrow is installed; return the paths.

    Each file is replaced as a whole or not at all.
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


@dataclass(frozen=True)
class Point:
    """Distance a cycle of one scene, policy and combination of parameters, over its seeds.

    Attributes
    ----------
    labels : dict
        Scene, policy, parameters.
    walks : int
        Walks that count: neither failed nor ended early.
    left_out : int
        Those that do not.
    mean : float or None
        m; None without walks.
    low, high : float or None
        Ends of the 95 % interval of the mean by Student's t, m; None for fewer than two walks.
    """

    labels: Row
    walks: int
    left_out: int
    mean: float | None
    low: float | None
    high: float | None


def points(rows: Iterable[Row], parameters: Iterable[str]) -> list[Point]:
    """Return the mean distance a cycle over seeds, with its interval, for each combination."""
    names = ('scene', 'policy', *parameters)
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    found = []
    for values, group in groups.items():
        ways = [
            row['distance_per_cycle_m']
            for row in group
            if not row.get('error') and not row.get('verdict')
        ]
        mean = low = high = None
        if ways:
            mean = float(np.mean(ways))
        if mean is not None and len(ways) > 1:
            half = float(stdtrit(len(ways) - 1, 0.975) * np.std(ways, ddof=1))
            half /= math.sqrt(len(ways))
            low, high = mean - half, mean + half
        labels = dict(zip(names, values, strict=True))
        found.append(Point(labels, len(ways), len(group) - len(ways), mean, low, high))
    return found
