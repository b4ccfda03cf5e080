# SPDX-License-Identifier: Apache-2.0
"""Sweeps: scenes x policies x seeds x ranges of parameters, on all cores or on a Dask cluster.

A sweep has a folder. Each finished trial is one transaction in the file ``trials.sqlite`` of this
folder, so that a killed sweep can continue where it stopped. At the end the sweep writes
``trials.csv`` (and ``trials.parquet`` if pyarrow is installed) with one row for each trial.
"""

from ros_pad.trials.sweep.execution import run
from ros_pad.trials.sweep.plan import Job, Row, Sweep, Value
from ros_pad.trials.sweep.table import Found, Point, is_sweep, points, read

__all__ = ['Found', 'Job', 'Point', 'Row', 'Sweep', 'Value', 'is_sweep', 'points', 'read', 'run']
