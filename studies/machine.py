# SPDX-License-Identifier: Apache-2.0
"""Description of the machine, and processor time and memory of a process."""

from __future__ import annotations

import datetime
import os
import pathlib
import platform
import resource
import time

import numpy as np


def processor() -> str:
    """Return the model of the processor, and the number of its cores."""
    name = platform.processor() or platform.machine()
    info = pathlib.Path('/proc/cpuinfo')
    if info.exists():
        lines = info.read_text(encoding='utf-8').splitlines()
        models = [line.split(':', 1)[1].strip() for line in lines if line.startswith('model name')]
        name = models[0] if models else name
    return f'{name}, {os.cpu_count()} cores'


def machine() -> dict[str, str]:
    """Return a description of the machine: processor, system, Python, NumPy, and the date."""
    return {
        'processor': processor(),
        'system': platform.system(),
        'python': platform.python_version(),
        'numpy': np.__version__,
        'date': datetime.date.today().isoformat(),
    }


def processor_time(pid: int) -> float:
    """Return the processor time that a process has used, s."""
    words = pathlib.Path(f'/proc/{pid}/stat').read_text(encoding='ascii').rpartition(')')[2]
    user, system = words.split()[11:13]
    return (int(user) + int(system)) / os.sysconf('SC_CLK_TCK')


def memory(pid: int | str = 'self') -> float:
    """Return the resident memory of a process, MB."""
    pages = pathlib.Path(f'/proc/{pid}/statm').read_text(encoding='ascii').split()[1]
    return int(pages) * os.sysconf('SC_PAGE_SIZE') / 1e6


def spent_time() -> float:
    """Return the processor time of this process and of the programs that it has run, s."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime
