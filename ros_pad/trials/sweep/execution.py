# SPDX-License-Identifier: Apache-2.0
"""Run the trials of a sweep by the same code on a pool of processes or on a Dask cluster."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager
from functools import partial
from typing import TypeAlias

import ros_pad
from ros_pad.configuration import integer
from ros_pad.errors import PadError
from ros_pad.pace import Progress
from ros_pad.trials import loop
from ros_pad.trials.sweep.plan import Job, Row, Sweep
from ros_pad.trials.sweep.table import Results, columns_of, identity, write_tables
from ros_pad.workers import cores, pool

PATIENCE = 20.0  # s, longest wait for a Dask scheduler or its first worker

Workers: TypeAlias = 'tuple[Callable[[], AbstractContextManager[Executor]], int]'
"""What opens an executor, and how many trials are submitted to it at the same time."""

Pairs: TypeAlias = 'Generator[tuple[Job, Row], None, list[Job]]'


def run(
    sweep: Sweep,
    folder: str | os.PathLike[str],
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
    retry: bool = False,
) -> list[Row]:
    """Run the trials that are not finished yet, store their rows in a folder, and return all rows.

    A script needs ``if __name__ == '__main__':`` before this call, as for every pool of processes.

    Parameters
    ----------
    sweep : Sweep
        Sweep to run.
    folder : path
        A new folder, or the folder of this sweep or of a part of it, which then continues.
    workers : int or None
        Number of processes, from 1; None is one for each core.
    scheduler : str or None
        Address of a Dask scheduler, such as ``tcp://host:8786``; its cluster is used instead of
        processes.
    progress : callable or None
        Called with the number of finished trials.
    retry : bool
        Whether trials that failed before run again.

    Returns
    -------
    list of dict
        One row for each trial, in the order of the sweep. Except for the real-time factor, the
        rows do not depend on the workers.

    Raises
    ------
    ConfigError, InvalidInput
        When an argument is not allowed, or the folder holds something else; no trial runs then.
    PadError
        When Dask is missing, its cluster does not answer or has another version of ros_pad, or
        another sweep is running in the folder.
    """
    if workers is not None:
        integer('workers', workers, 1)
    jobs = {job.key: job for job in sweep.jobs()}
    with ExitStack() as stack:
        count = workers or cores()
        # Twice as many jobs as processes, so that no process waits for work.
        used: Workers = partial(pool, count), 2 * count
        if scheduler is not None:
            used = stack.enter_context(_cluster(scheduler))
        results = stack.enter_context(Results(folder, identity(sweep), jobs))
        if retry:
            results.forget_failures()
        missing = [job for key, job in jobs.items() if key not in results.done]
        progress = progress or (lambda done: None)
        try:
            progress(len(results.done))
            with closing(_finished(missing, used)) as rows:
                for job, row in rows:
                    results.add(job.key, row)
                    progress(len(results.done))
        finally:
            table = results.rows(jobs)
            write_tables(table, results.folder)
        return table


def run_job(job: Job) -> Row:
    """Run one trial and return its row; if the trial fails, the row has its error."""
    try:
        trial = loop.run(
            job.scene, job.policy, job.seed, job.level, tuning=job.tuning,
            policy_parameters=job.policy_parameters,
        )  # fmt: skip
    except Exception as error:  # the other trials continue after any error
        return job.failed(f'{type(error).__name__}: {error}')
    return job.labels | columns_of(trial)


def _finished(jobs: Iterable[Job], workers: Workers) -> Generator[tuple[Job, Row], None, None]:
    """Yield jobs with their rows as they finish.

    A process that dies (for lack of memory, for example) breaks its whole pool. The trials of this
    pool run again, each alone in a pool; a trial whose process dies again has failed.
    """
    left = deque(jobs)
    while left:
        for job in (yield from _until_broken(left, workers)):
            if (yield from _until_broken(deque([job]), workers)):
                yield job, job.failed('its process died, possibly for lack of memory')


def _until_broken(left: deque[Job], workers: Workers) -> Pairs:
    """Run the remaining jobs; if the executor breaks, return the jobs that it had accepted."""
    running: dict[Future[Row], Job] = {}
    opened, most = workers
    with opened() as executor:
        try:
            while left or running:
                while left and len(running) < most:
                    running[executor.submit(run_job, left[0])] = left[0]
                    left.popleft()
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    try:
                        row = future.result()
                    except BrokenProcessPool:
                        raise
                    except CancelledError as error:
                        raise PadError(
                            f'the connection to the Dask scheduler was lost: {error}'
                        ) from error
                    except Exception as error:  # a job that killed workers of a cluster, say
                        row = running[future].failed(f'{type(error).__name__}: {error}')
                    yield running.pop(future), row
        except BrokenProcessPool:
            return list(running.values())
    return []


@contextmanager
def _cluster(address: str) -> Iterator[Workers]:
    """Connect to a Dask scheduler; refuse workers with another version of ros_pad."""
    try:
        import distributed
    except ModuleNotFoundError as error:
        raise PadError(f'Dask is not installed ({error}): pip install "ros_pad[sweep]"') from error
    try:
        client = distributed.Client(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise PadError(f'cannot connect to scheduler {address}: {error}') from error
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
            versions = client.run(_version)
        except (ImportError, TimeoutError) as error:
            raise PadError(
                f'scheduler {address}: no worker with ros_pad {_version()} after {PATIENCE:g} s:'
                f' {error}: start dask worker {address}'
            ) from error
        for worker, theirs in versions.items():
            if theirs != _version():
                raise PadError(
                    f'worker {worker} has ros_pad {theirs}: {_version()} is needed, as here'
                )

        @contextmanager
        def opened() -> Iterator[Executor]:
            """Open an executor; Dask itself repeats the jobs of a lost worker."""
            executor = client.get_executor(pure=False)
            try:
                yield executor
            finally:
                executor.shutdown(wait=False)

        yield opened, 1000


def _version() -> str:
    """Return the version of ros_pad, here or on a worker of a cluster."""
    return ros_pad.__version__
