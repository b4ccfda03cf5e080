# SPDX-License-Identifier: Apache-2.0
"""What can be wrong with a machine on which ros_pad is to run, and what to do.

Nothing but the standard library is imported before it is looked for, ROS 2 and extras only in
processes of their own: whatever is broken, the doctor comes to the end of the list.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import metadata
from typing import Any

OLDEST, NEWEST = (3, 11), (3, 13)
"""Versions of Python with which ros_pad is tested."""

DISTRIBUTION = 'jazzy'
"""The ROS 2 with which ros_pad is tested."""

NEEDED = ('numpy', 'scipy', 'yaml', 'matplotlib', 'mpmath', 'tqdm', 'mcap', 'mcap_ros2', 'serial')
"""Modules without which ros_pad does not run."""

EXTRAS = {
    'mujoco': ('mujoco', 'the hexapod with joints, L2; without it L1 walks'),
    'numba': ('fast', 'compiled L1; without it L1 is ten times slower, and the same to the bit'),
    'distributed': ('sweep', 'sweeps on a Dask cluster'),
    'pyarrow': ('sweep', 'Parquet tables of sweeps'),
    'meshio': ('mesh', 'meshes of pads from files, for pad wet'),
}
"""Modules that an extra of ros_pad brings, with its name and what they are for."""

MESSAGES = (
    *('builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs', 'lifecycle_msgs'),
    *('rcl_interfaces', 'rosgraph_msgs', 'sensor_msgs', 'std_msgs', 'std_srvs'),
    'visualization_msgs',
)
"""Packages of messages that the nodes need."""

LOOPBACK = 10.0
"""Within which a message must come from one process to another, s."""

STARTING = 30.0
"""Given to a process to import rclpy or an extra, s: disks are slow the first time."""

ROOM_NEEDED, ROOM_WANTED = 0.1e9, 1e9
"""Free bytes on the disk for bags below which there is a problem, or a warning."""

SHARED_MEMORY = 16e6
"""Free bytes in /dev/shm that two processes with Fast DDS need at least."""

BUFFER = 212992
"""What Linux lets a socket receive before it drops, bytes: `net.core.rmem_max` as it comes."""


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Attributes
    ----------
    what : str
    status : str
        ``ok``, ``warning`` (something does not work that not everybody needs) or ``problem``.
    found : str
    advice : str
        What to do; empty where it is ok.
    """

    what: str
    status: str
    found: str
    advice: str = ''


def examine(progress: Callable[[float], None] | None = None) -> Iterator[Finding]:
    """Look at everything, one after the other.

    Parameters
    ----------
    progress : callable, optional
        Is told which share is done, 0 to 1.
    """
    rounds: tuple[Callable[[], Iterator[Finding]], ...] = (
        python,
        packages,
        extras,
        configuration,
        ros,
        serial_ports,
        folders,
        terminal,
    )
    for number, each in enumerate(rounds):
        yield from each()
        if progress:
            progress((number + 1) / len(rounds))


def python(version: Sequence[int | str] = sys.version_info) -> Iterator[Finding]:
    """Look at the version of Python, and of ros_pad."""
    text = '.'.join(map(str, version[:3]))
    tested = f'{OLDEST[0]}.{OLDEST[1]} to {NEWEST[0]}.{NEWEST[1]}'
    if tuple(version[:2]) < OLDEST:
        yield Finding('Python', 'problem', text, f'ros_pad needs {tested}: make PYTHON=python3.12')
    elif tuple(version[:2]) > NEWEST:
        yield Finding('Python', 'warning', text, f'not tested; {tested} are')
    else:
        yield Finding('Python', 'ok', f'{text}, {sys.executable}')


def packages(names: Sequence[str] = NEEDED) -> Iterator[Finding]:
    """Look for what ros_pad imports, and for its own version."""
    missing, broken = [], []
    for name in names:
        try:
            importlib.import_module(name)
        except ModuleNotFoundError as error:
            missing.append(name if error.name == name else f'{name} (for want of {error.name})')
        except Exception as error:  # whatever a broken package raises
            broken.append(f'{name}: {type(error).__name__}: {error}')
    if missing or broken:
        if missing:
            broken.insert(0, f'not installed: {", ".join(missing)}')
        yield Finding(
            'packages',
            'problem',
            '; '.join(broken),
            'make .venv anew (make clean run), pip install --editable . in the folder of ros_pad,'
            ' or rosdep install --from-paths src --ignore-src',
        )
        return
    yield Finding('packages', 'ok', ', '.join(names))
    from ros_pad.trials import label

    made_with = label.made_with()
    git = made_with.get('git', 'not a checkout of its repository')
    yield Finding('ros_pad', 'ok', f'{made_with["ros_pad"]}, git: {git}')


def extras(names: Sequence[str] = tuple(EXTRAS)) -> Iterator[Finding]:
    """Import the packages that only some need, side by side in processes of their own."""
    here = [name for name in names if importlib.util.find_spec(name)]
    with ThreadPoolExecutor(max_workers=len(here) or 1) as children:
        troubles = dict(zip(here, children.map(_import_trouble, here), strict=True))
    for name in names:
        extra, purpose = EXTRAS[name]
        if name not in here:
            advice = f'pip install "ros_pad[{extra}]", or --editable ".[{extra}]" in its folder'
            yield Finding(name, 'warning', f'not here: {purpose}', advice)
            continue
        if troubles[name]:
            advice = f'pip install --force-reinstall {name}, or pip uninstall {name} to go without'
            yield Finding(name, 'warning', f'{troubles[name]}; {purpose}', advice)
            continue
        with contextlib.suppress(metadata.PackageNotFoundError):
            purpose = f'{metadata.version(name)}: {purpose.partition(";")[0]}'
        yield Finding(name, 'ok', purpose)


def _import_trouble(name: str) -> str:
    """Import a package in a process of its own; return what is wrong, empty if nothing is."""
    code = f'import sys; sys.path[:] = {sys.path!r}; import {name}'
    try:
        child = subprocess.run(
            [sys.executable, '-c', code],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors='replace',
            timeout=STARTING,
        )
    except subprocess.TimeoutExpired:
        return f'import {name} did not end within {STARTING:g} s'
    if child.returncode == 0:
        return ''
    return f'import {name} ends with status {child.returncode}: {_last_line(child.stderr)}'


def configuration() -> Iterator[Finding]:
    """Look for the scenes and feet that ship."""
    try:
        from ros_pad import configuration as files
        from ros_pad.errors import ConfigError
    except ImportError as error:
        yield Finding('config folder', 'problem', str(error), 'see packages, above')
        return
    try:
        folder = files.shared_folder()
        counts = ', '.join(f'{len(files.names(kind))} {kind}' for kind in ('scenes', 'feet'))
        yield Finding('config folder', 'ok', f'{folder}: {counts}')
    except ConfigError as error:
        yield Finding(
            'config folder',
            'problem',
            str(error),
            'source install/setup.bash of your workspace, or pip install ros_pad again',
        )


_ROS = """
import importlib, json
found = {'missing': [], 'rclpy': None, 'rmw': None, 'error': None}
try:
    import rclpy
    found['rclpy'] = rclpy.__file__
    found['rmw'] = rclpy.get_rmw_implementation_identifier()
except Exception as error:
    found['error'] = f'{type(error).__name__}: {error}'
for name in MESSAGES:
    try:
        importlib.import_module(name + '.srv' if name == 'std_srvs' else name + '.msg')
    except Exception as error:
        found['missing'].append(f'{name} ({error})')
print(json.dumps(found))
"""


def ros(patience: float = LOOPBACK) -> Iterator[Finding]:
    """Look at ROS 2: where it comes from, its middleware, and whether two processes talk.

    Parameters
    ----------
    patience : float
        For a message from process to process, s.
    """
    code = f'MESSAGES = {MESSAGES!r}\n{_ROS}'
    try:
        child = subprocess.run(
            [sys.executable, '-c', code], capture_output=True, text=True, timeout=STARTING
        )
        found: dict[str, Any] = json.loads(child.stdout.strip().rpartition('\n')[2])
    except subprocess.TimeoutExpired:
        yield Finding(
            'ROS 2',
            'problem',
            f'import rclpy did not end within {STARTING:g} s',
            'try again; if it stays so, remove what /dev/shm has of Fast DDS (fastdds shm clean)',
        )
        return
    except ValueError:  # it died, as with libraries of another ROS
        said = f'import rclpy ends with status {child.returncode}: {_last_line(child.stderr)}'
        yield Finding('ROS 2', 'problem', said, _RMW if 'RMW' in said else _ONE_ROS)
        return
    wheels = _wheels()
    if found['rclpy'] is None:
        yield _no_ros(found['error'], wheels)
        return
    yield _origin(found['rclpy'], wheels)
    if found['missing']:
        yield Finding(
            'messages',
            'problem',
            'missing: ' + ', '.join(found['missing']),
            'pip install "ros_pad[ros]", or rosdep install --from-paths src --ignore-src',
        )
        return
    yield Finding('messages', 'ok', f'{len(MESSAGES)} packages')
    if found['error']:
        yield Finding('middleware', 'problem', found['error'], _RMW)
        return
    yield Finding('middleware', 'ok', f'{found["rmw"]}; {_settings()}')
    yield from shared_memory()
    yield loopback(patience)


_ONE_ROS = (
    'one ROS 2 at a time: open a new shell and either source /opt/ros/jazzy/setup.bash or'
    ' activate .venv, not both'
)
_RMW = (
    'unset RMW_IMPLEMENTATION, or install what it names'
    f' (sudo apt install ros-{DISTRIBUTION}-rmw-cyclonedds-cpp)'
)


def _no_ros(error: str, wheels: str | None) -> Finding:
    if wheels or 'No module' not in error:
        return Finding('ROS 2', 'problem', f'import rclpy: {error}', _ONE_ROS)
    installed = sorted(str(path) for path in pathlib.Path('/opt/ros').glob('*/setup.bash'))
    advice = (
        f'source {installed[0]}, in a Python that it knows'
        if installed
        else 'pip install "ros_pad[ros]", or install ROS 2 from apt'
    )
    return Finding(
        'ROS 2',
        'warning',
        'no rclpy here: no nodes and no bags of them; pad run needs --no-ros, the rest works',
        advice,
    )


def _wheels() -> str | None:
    """Return the ROS 2 distribution whose rclpy is installed here as a wheel."""
    for each in metadata.distributions():
        name = str(each.metadata['Name']).replace('_', '-')
        if match := re.fullmatch(r'ros-([a-z]+)-rclpy', name):
            return match[1]
    return None


def _origin(path: str, wheels: str | None) -> Finding:
    """Say which ROS 2 this is; two in one environment are a problem."""
    own = pathlib.Path(path).is_relative_to(sys.prefix) and sys.prefix != '/usr'
    sourced = os.environ.get('ROS_DISTRO', '')
    prefixes = [
        each
        for name in ('AMENT_PREFIX_PATH', 'LD_LIBRARY_PATH', 'PYTHONPATH')
        for each in os.environ.get(name, '').split(os.pathsep)
        if each.startswith('/opt/ros/')
    ]
    if own and (prefixes or (sourced and sourced != wheels)):
        other = prefixes[0] if prefixes else f'ROS_DISTRO={sourced}'
        return Finding('ROS 2', 'problem', f'wheels in {sys.prefix}, and {other}', _ONE_ROS)
    if not own and wheels:
        return Finding(
            'ROS 2', 'problem', f'{path}, and wheels of {wheels} in {sys.prefix}', _ONE_ROS
        )
    distribution = (wheels if own else sourced) or 'of no known distribution'
    kind = 'wheels' if own else 'installed'
    text = f'{distribution}, {kind}: {pathlib.Path(path).parent}'
    if distribution != DISTRIBUTION:
        advice = f'not tested; {DISTRIBUTION} is (QUALITY_DECLARATION.md says what was seen)'
        return Finding('ROS 2', 'warning', text, advice)
    return Finding('ROS 2', 'ok', text)


def _settings() -> str:
    own = [
        f'{name}={os.environ[name]}'
        for name in (
            'ROS_DOMAIN_ID',
            'ROS_AUTOMATIC_DISCOVERY_RANGE',
            'ROS_STATIC_PEERS',
            'ROS_LOCALHOST_ONLY',
            'ROS_DISCOVERY_SERVER',
            'FASTRTPS_DEFAULT_PROFILES_FILE',
            'FASTDDS_DEFAULT_PROFILES_FILE',
            'CYCLONEDDS_URI',
        )
        if os.environ.get(name)
    ]
    return ', '.join(own) or 'domain 0, discovery as it comes: open to the whole subnet'


def shared_memory(folder: pathlib.Path = pathlib.Path('/dev/shm')) -> Iterator[Finding]:
    """Look for room in shared memory, and for what dead processes left in it."""
    if not folder.is_dir():
        return
    stale = stale_segments(folder)
    free = shutil.disk_usage(folder).free
    found = f'{folder}: {free / 1e6:.0f} MB free, {len(stale)} segments of dead processes'
    if free < SHARED_MEMORY:
        yield Finding(
            'shared memory',
            'problem',
            found,
            'fastdds shm clean removes what dead processes left; in a container: --shm-size 256m',
        )
    elif stale:
        yield Finding(
            'shared memory',
            'warning',
            found,
            'left by processes that were killed; they can keep others from a port: when no node'
            ' runs, fastdds shm clean',
        )
    else:
        yield Finding('shared memory', 'ok', found)


def stale_segments(folder: pathlib.Path) -> list[str]:
    """Return the segments of Fast DDS whose process is gone.

    A process holds a lock on the file ``..._el`` of its segment as long as it lives; that is what
    ``fastdds shm clean`` goes by.
    """
    import fcntl

    found = []
    for path in sorted(folder.glob('fast*_el')):
        if not re.fullmatch(r'(fastrtps|fastdds)_[0-9a-z]{16}_el', path.name):
            continue
        with contextlib.suppress(OSError), path.open('rb') as lock:  # another user's, or locked
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            found.append(path.name.removesuffix('_el'))
    return found


def loopback(patience: float = LOOPBACK) -> Finding:
    """Send a message from one process to another, with the ROS settings of this one.

    Parameters
    ----------
    patience : float
        How long it may take once both are there, s.
    """
    topic, word = f'/ros_pad_doctor_{uuid.uuid4().hex}', uuid.uuid4().hex
    seconds = str(STARTING + patience)
    children = [
        subprocess.Popen(
            [
                *(sys.executable, '-m', 'ros_pad.nodes.loopback', end),
                *(topic, word, '--seconds', seconds),
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, sys.path))},
        )
        for end in ('hear', 'say')
    ]
    # One that hangs, say on a lock that a dead process left, says nothing for ever.
    limit = threading.Timer(STARTING, _kill, [children])
    limit.start()
    try:
        for child in children:
            assert child.stdout is not None
            if child.stdout.readline() != 'ready\n':
                _end([child])
                assert child.stderr is not None
                said = _last_line(child.stderr.read())
                return Finding(
                    'loopback',
                    'problem',
                    f'a node does not start: {said}',
                    f'{_silence()}; {_RMW}',
                )
        limit.cancel()
        started = time.monotonic()
        if children[0].wait(patience) == 0:
            return Finding(
                'loopback',
                'ok',
                'a message from process to process after'
                f' {time.monotonic() - started:.1f} s, at most {patience:g} s are all right',
            )
    except subprocess.TimeoutExpired:
        pass
    finally:
        limit.cancel()
        _end(children)
    return Finding(
        'loopback',
        'problem',
        f'no message from one process to another within {patience:g} s: nodes of their own do not'
        ' find one another (pad run without --live does not need it)',
        _silence(),
    )


def _kill(children: Sequence[subprocess.Popen[str]]) -> None:
    for child in children:
        child.kill()


def _end(children: Sequence[subprocess.Popen[str]]) -> None:
    """End processes; first in peace, so that they leave nothing in shared memory."""
    for child in children:
        child.terminate()
    for child in children:
        try:
            child.wait(5.0)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()


def _domain() -> int | None:
    """Return the number of the domain; None where it is set to none that there is."""
    text = os.environ.get('ROS_DOMAIN_ID') or '0'
    return int(text) if text.isdecimal() and int(text) <= 101 else None


def _silence() -> str:
    """Return what most often keeps nodes on one machine apart, what is seen here first."""
    hints = []
    domain = _domain()
    if domain is None:
        text = os.environ['ROS_DOMAIN_ID']
        hints.append(f'ROS_DOMAIN_ID={text}: a number from 0 to 101 is needed')
    reach = os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE', '')
    if reach.upper() == 'OFF':
        hints.append('ROS_AUTOMATIC_DISCOVERY_RANGE=OFF keeps processes apart: LOCALHOST')
    elif not reach:
        hints.append(
            'no multicast on this network (VPN, container): export'
            ' ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST'
        )
    if os.environ.get('ROS_LOCALHOST_ONLY'):
        hints.append(
            'unset ROS_LOCALHOST_ONLY: it overrules the range, and wants multicast on lo'
            ' (sudo ip link set lo multicast on)'
        )
    for name in ('FASTRTPS_DEFAULT_PROFILES_FILE', 'CYCLONEDDS_URI', 'ROS_DISCOVERY_SERVER'):
        if os.environ.get(name):
            hints.append(f'unset {name}, which changes discovery')
    with contextlib.suppress(OSError, ValueError):
        size = int(pathlib.Path('/proc/sys/net/core/rmem_max').read_text())
        if size < BUFFER:
            hints.append(f'sudo sysctl -w net.core.rmem_max={BUFFER}: it is {size}')
    if domain is not None:
        port = 7400 + 250 * domain  # as DDS has it
        hints.append(f'let the firewall pass UDP {port} to {port + 249} on the loopback')
    hints.append('fastdds shm clean, when no node runs')
    if domain is not None:
        hints.append('ROS_DOMAIN_ID must be the same everywhere')
    return '; '.join(hints)


def serial_ports(ports: Sequence[str] | None = None) -> Iterator[Finding]:
    """Look for serial ports, and whether they may be opened.

    Parameters
    ----------
    ports : sequence of str, optional
        Device files; those that are plugged in, when left out.
    """
    if ports is None:
        try:
            from serial.tools import list_ports
        except ImportError as error:
            advice = 'pip install pyserial, or sudo apt install python3-serial'
            yield Finding('serial ports', 'problem', str(error), advice)
            return
        ports = sorted(port.device for port in list_ports.comports())
    if not ports:
        yield Finding('serial ports', 'ok', 'none is plugged in')
    for port in ports:
        if os.access(port, os.R_OK | os.W_OK):
            yield Finding('serial port', 'ok', f'{port} may be opened')
        elif not os.path.exists(port):
            yield Finding('serial port', 'warning', f'{port} is gone', 'plug it in again')
        else:
            group = _group(port)
            yield Finding(
                'serial port',
                'warning',
                f'{port} may not be opened: it belongs to the group {group}',
                f'sudo usermod -aG {group} $USER, then log out and in',
            )


def _group(path: str) -> str:
    import grp

    try:
        return grp.getgrgid(os.stat(path).st_gid).gr_name
    except (KeyError, OSError):
        return 'dialout'


def folders(here: pathlib.Path = pathlib.Path()) -> Iterator[Finding]:
    """Look whether bags and logs can be written, and how much room there is."""
    runs = here / 'runs'
    place = runs if runs.exists() else here
    if trouble := _unwritable(place):
        advice = 'go to a folder of your own, or give --out'
        yield Finding('runs/', 'problem', f'{place.resolve()}: {trouble}', advice)
    else:
        free = shutil.disk_usage(place).free
        found = f'{runs.resolve()}: {free / 1e9:.1f} GB free'
        status = (
            'problem' if free < ROOM_NEEDED else 'warning' if free < ROOM_WANTED else 'ok'
        )  # fmt: skip
        advice = 'a minute of six legs takes 10 to 20 MB: make room, or give --out on another disk'
        yield Finding('runs/', status, found, '' if status == 'ok' else advice)
    home = os.environ.get('ROS_HOME') or '~/.ros'
    logs = pathlib.Path(os.environ.get('ROS_LOG_DIR') or f'{home}/log').expanduser()
    if trouble := _unwritable(logs):
        advice = 'export ROS_LOG_DIR=/tmp/ros_log, or mend its permissions: no node starts without'
        yield Finding('logs', 'problem', f'{logs}: {trouble}', advice)
    else:
        yield Finding('logs', 'ok', f'{logs}')


def _unwritable(folder: pathlib.Path) -> str:
    """Return why nothing can be written there, or empty; the folder need not be there yet."""
    while not folder.exists() and folder.parent != folder:
        folder = folder.parent
    try:
        with tempfile.TemporaryFile(dir=folder):
            return ''
    except OSError as error:
        return str(error.strerror)


def terminal() -> Iterator[Finding]:
    """Look whether progress bars can be drawn."""
    encoding = (sys.stderr.encoding or 'ascii').lower()
    if not sys.stderr.isatty():
        yield Finding('terminal', 'ok', 'none: progress bars come as lines')
    elif 'utf' not in encoding:
        advice = 'export LANG=C.UTF-8: bars are drawn with #, units may not be printed'
        yield Finding('terminal', 'warning', f'encoding {encoding}', advice)
    else:
        columns = shutil.get_terminal_size().columns
        yield Finding('terminal', 'ok', f'{columns} columns, {encoding}')


def _last_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else 'it said nothing'
