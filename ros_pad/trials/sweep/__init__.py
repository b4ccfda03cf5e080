# SPDX-License-Identifier: Apache-2.0
"""Sweeps: scenes x policies x seeds x ranges of parameters, on all cores or on a Dask cluster.

A sweep has a folder. Each finished trial is one transaction in the file ``trials.sqlite`` of this
folder, so that a killed sweep can continue where it stopped. At the end the sweep writes
``trials.csv`` (and ``trials.parquet`` if pyarrow is installed) with one row for each trial.
"""

from ros_pad.trials.sweep.execution import run
from ros_pad.trials.sweep.plan import Job
from ros_pad.trials.sweep.plan import Row
from ros_pad.trials.sweep.plan import Sweep
from ros_pad.trials.sweep.plan import Value
from ros_pad.trials.sweep.summary import Found
from ros_pad.trials.sweep.summary import Point
from ros_pad.trials.sweep.summary import is_sweep
from ros_pad.trials.sweep.summary import points
from ros_pad.trials.sweep.summary import read

__all__ = ['Found', 'Job', 'Point', 'Row', 'Sweep', 'Value', 'is_sweep', 'points', 'read', 'run']
