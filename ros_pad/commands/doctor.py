# SPDX-License-Identifier: Apache-2.0
"""``pad doctor``: find problems of this machine, and advise what to do.

ROS 2 and extras are imported only in separate processes, and dependencies only when they are
checked, so that the checks continue to the end whatever is broken.
"""

from __future__ import annotations

import argparse
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
import textwrap
import threading
import time
import uuid
import webbrowser
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from importlib import metadata

from ros_pad.commands.command import WIDEST, Commands, add_command, complain
from ros_pad.pace import Progress

OLDEST, NEWEST = (3, 11), (3, 13)  # versions of Python with which ros_pad is tested
DISTRIBUTION = 'jazzy'  # distribution of ROS 2 with which ros_pad is tested
NEEDED = ('numpy', 'scipy', 'yaml', 'tqdm', 'mcap', 'rosbags', 'serial')
# Optional modules, each with the extra of ros_pad that installs it, and its purpose.
EXTRAS = {
    'matplotlib': ('plot', 'pictures and reports; without it, pad run writes no report'),
    'mujoco': ('mujoco', 'robots with joints, L2; without it, L1 is used'),
    'numba': ('fast', 'compiled L1; without it, L1 is ten times slower, with the same results'),
    'distributed': ('sweep', 'sweeps on a Dask cluster'),
    'pyarrow': ('sweep', 'Parquet tables of sweeps'),
    'meshio': ('mesh', 'meshes of pads from files, for pad wet'),
    'nicegui': ('explore', 'feet designed in the browser, with pad explore'),
    'sphinx': ('docs', 'the site, with make docs'),
}
# Modules of ROS 2 that the nodes import.
ROS_MODULES = (
    *('rclpy', 'builtin_interfaces.msg', 'diagnostic_msgs.msg', 'geometry_msgs.msg'),
    *('lifecycle_msgs.msg', 'rcl_interfaces.msg', 'rosgraph_msgs.msg', 'sensor_msgs.msg'),
    *('std_msgs.msg', 'std_srvs.srv', 'visualization_msgs.msg'),
)
LOOPBACK = 10.0  # s, longest time of a message from one process to another
STARTING = 30.0  # s, longest time to import rclpy or an extra, which is slow at first
KINDS = ('scenes', 'feet', 'materials', 'robots', 'mappings')  # of shipped files
ROOM_NEEDED, ROOM_WANTED = 0.1e9, 1e9  # free bytes below which there is a problem, a warning

_DESCRIPTION = f"""\
Check Python, packages, shipped files, ROS 2, its middleware, serial ports and disk;
advise what to do.
One check sends a message between two processes with the ROS settings of this shell; the
message must arrive within {LOOPBACK:g} s.

  ok       as it should be
  warning  something does not work that not everybody needs
  problem  fix this; the exit status is then 1

With --robot, look at the sensors of a robot instead, live or in a bag: what is
missing, rates, stamps, units, axes and signs of IMU, joints and foot forces.
Let the robot stand for two seconds, then walk some steps."""
_EXAMPLES = """\
pad doctor
pad doctor --json
pad doctor --robot go2 --mapping go2
pad doctor --robot my_robot.urdf --feet lf_foot rf_foot lh_foot rh_foot --bag my_bag"""
_ONE_ROS = (
    'one ROS 2 at a time: open a new shell and either source /opt/ros/jazzy/setup.bash or'
    ' activate .venv, not both'
)
_RMW = (
    'unset RMW_IMPLEMENTATION, or install the middleware that it names'
    f' (sudo apt install ros-{DISTRIBUTION}-rmw-cyclonedds-cpp)'
)
_RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
_OVERRIDES = (  # variables that change discovery, and can keep nodes from connecting
    'ROS_STATIC_PEERS', 'ROS_LOCALHOST_ONLY', 'ROS_DISCOVERY_SERVER', 'CYCLONEDDS_URI',
    'FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE',
)  # fmt: skip


@dataclass(frozen=True)
class Finding:
    """Result of a check.

    ``status`` is ``ok``, ``warning`` or ``problem``; ``advice`` is empty if the status is ``ok``.
    """

    what: str
    status: str
    found: str
    advice: str = ''


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'doctor', run, _DESCRIPTION, _EXAMPLES)
    part.add_argument('--json', action='store_true', help='print one JSON object')
    _add_robot(part)


def _add_robot(part: argparse.ArgumentParser) -> None:
    """Add the arguments for the sensors of a robot."""
    group = part.add_argument_group('sensors of a robot')
    group.add_argument(
        '--robot',
        metavar='FILE',
        help='check IMU, joints and foot forces of this robot instead of the machine: a shipped'
        ' name, or a .yaml or .urdf file',
    )
    group.add_argument(
        '--feet',
        nargs='+',
        default=[],
        metavar='LINK',
        help='the links of the feet in a URDF file',
    )
    group.add_argument('--imu', default='', metavar='LINK', help='the link of the IMU in it')
    group.add_argument(
        '--foot-radius', type=float, metavar='M', help='radius with which the feet roll, m, 0 to 1'
    )
    group.add_argument(
        '--mapping',
        default='default',
        metavar='NAME',
        help='what the messages mean: a shipped name, or a .yaml file (default: default)',
    )
    group.add_argument(
        '--bag',
        type=pathlib.Path,
        metavar='PATH',
        help='folder of a bag, or one MCAP file, instead of live topics',
    )
    group.add_argument('--namespace', default='', help='namespace of the topics, such as /robot_1')
    group.add_argument(
        '--seconds',
        type=float,
        default=10.0,
        metavar='S',
        help='how long to look, s, 1 to 60 (default: 10)',
    )


def run(options: argparse.Namespace) -> int:
    """Run all checks and print their findings; return the exit status."""
    if options.bag and not options.robot:
        return complain('--bag needs --robot: the robot whose sensors are in it', 2)
    found = _robot(options) if options.robot else _machine()
    counts = {
        f'{status}s': sum(each.status == status for each in found)
        for status in ('problem', 'warning')
    }
    if options.json:
        print(json.dumps(counts | {'findings': [asdict(each) for each in found]}))
    else:
        for each in found:
            _show(each)
        print('\n' + ', '.join(f'{status}: {count}' for status, count in counts.items()))
    return 1 if counts['problems'] else 0


def _machine() -> list[Finding]:
    """Check the machine."""
    try:
        from ros_pad.commands.progress import bar
    except ImportError:  # the missing package is among the findings
        return list(examine())
    with bar('checking', 1.0, 'machine') as progress:
        return list(examine(progress))


def _robot(options: argparse.Namespace) -> list[Finding]:
    """Check the sensors of a robot."""
    from ros_pad.commands.robot_check import findings

    return [Finding(*each) for each in findings(options)]


def _show(finding: Finding) -> None:
    width = min(shutil.get_terminal_size().columns, WIDEST)
    lines = [f'{finding.status:8} {finding.what}: {finding.found}']
    if finding.advice:
        lines.append(f'{"":9}-> {finding.advice}')
    for line in lines:
        # Do not break paths and settings, so that they can be copied.
        print(
            textwrap.fill(
                line, width, subsequent_indent=' ' * 12,
                break_long_words=False, break_on_hyphens=False,
            )
        )  # fmt: skip


def examine(progress: Progress | None = None) -> Iterator[Finding]:
    """Run all checks one after the other, and yield their findings."""
    checks: tuple[Callable[[], Iterator[Finding]], ...] = (
        python, packages, extras, browser, config_folder, shipped_files, ros, serial_ports,
        folders,
    )  # fmt: skip
    for number, check in enumerate(checks, 1):
        yield from check()
        if progress:
            progress(number / len(checks))


def python(version: Sequence[int | str] = sys.version_info) -> Iterator[Finding]:
    """Check the version of Python."""
    text = '.'.join(map(str, version[:3]))
    tested = f'{OLDEST[0]}.{OLDEST[1]} to {NEWEST[0]}.{NEWEST[1]}'
    if tuple(version[:2]) < OLDEST:
        yield Finding('Python', 'problem', text, f'ros_pad needs {tested}: make PYTHON=python3.12')
    elif tuple(version[:2]) > NEWEST:
        yield Finding('Python', 'warning', text, f'ros_pad is tested with {tested}')
    else:
        yield Finding('Python', 'ok', f'{text}, {sys.executable}')


def packages(names: Sequence[str] = NEEDED) -> Iterator[Finding]:
    """Check that the dependencies of ros_pad can be imported, and report its version."""
    wrong = []
    for name in names:
        try:
            importlib.import_module(name)
        except Exception as error:  # whatever a broken package raises
            wrong.append(f'{name} ({type(error).__name__}: {error})')
    if wrong:
        advice = (
            'create .venv again (make clean run), or pip install --editable . in the folder of'
            ' ros_pad, or rosdep install --from-paths src --ignore-src'
        )
        yield Finding('packages', 'problem', f'not usable: {", ".join(wrong)}', advice)
        return
    yield Finding('packages', 'ok', ', '.join(names))
    from ros_pad.trials import label

    made_with = label.made_with()
    git = made_with.get('git', 'not a checkout of its repository')
    yield Finding('ros_pad', 'ok', f'{made_with["ros_pad"]}, git: {git}')


def extras(names: Sequence[str] = tuple(EXTRAS)) -> Iterator[Finding]:
    """Check the packages that only some users need, importing each in a process of its own."""
    here = [name for name in names if importlib.util.find_spec(name)]
    with ThreadPoolExecutor(max_workers=len(here) or 1) as pool:
        errors = dict(zip(here, pool.map(_import_error, here), strict=True))
    for name in names:
        extra, purpose = EXTRAS[name]
        if name not in here:
            yield Finding(name, 'warning', f'not installed: {purpose}', _install(extra))
        elif errors[name]:
            advice = f'pip install --force-reinstall {name}, or pip uninstall {name} if not needed'
            yield Finding(name, 'warning', f'{errors[name]}; {purpose}', advice)
        else:
            with contextlib.suppress(metadata.PackageNotFoundError):
                purpose = f'{metadata.version(name)}: {purpose.partition(";")[0]}'
            yield Finding(name, 'ok', purpose)


def _install(extra: str, checkout: pathlib.Path = pathlib.Path(__file__).parents[2]) -> str:
    """Return the command that installs an extra of ros_pad."""
    if (checkout / 'setup.py').is_file():
        return f'pip install --editable "{checkout}[{extra}]"'
    return f'pip install "ros_pad[{extra}]"'


def _import_error(name: str) -> str:
    """Import a package in a separate process; return the error, or an empty text."""
    return _child(f'import sys; sys.path[:] = {sys.path!r}; import {name}', f'import {name}')[0]


def _child(code: str, what: str) -> tuple[str, str]:
    """Run Python code in a separate process; return an error (or an empty text) and its output."""
    try:
        child = subprocess.run(
            [sys.executable, '-c', code],
            stdin=subprocess.DEVNULL, capture_output=True, text=True, errors='replace',
            timeout=STARTING,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f'{what} did not end within {STARTING:g} s', ''
    if child.returncode:
        return f'{what} ends with status {child.returncode}: {_last_line(child.stderr)}', ''
    return '', child.stdout


def config_folder() -> Iterator[Finding]:
    """Check that the folder of the shipped configuration is found; count its files."""
    try:
        from ros_pad import configuration

        folder = configuration.shared_folder()
        counts = [f'{len(configuration.names(kind))} {kind}' for kind in KINDS]
        yield Finding('config folder', 'ok', f'{folder}: {", ".join(counts)}')
    except Exception as error:  # ConfigError, or any error of the import
        advice = 'source install/setup.bash of your workspace, or pip install ros_pad again'
        yield Finding('config folder', 'problem', str(error), advice)


def shipped_files() -> Iterator[Finding]:
    """Check that every shipped scene, foot, material, robot and mapping can be read."""
    wrong = []
    try:
        from ros_pad import configuration
        from ros_pad.contact import Foot, Material
        from ros_pad.robots import Robot
        from ros_pad.simulation.fidelity import Promises
        from ros_pad.simulation.scene import Scene, is_bench

        def text(kind: str, name: str) -> None:
            configuration.Table.load(configuration.locate(kind, name))

        loaders: dict[str, Callable[[str], object]] = {
            'feet': Foot.load,
            'materials': Material.load,
            'robots': Robot.load,
        }
        for kind in KINDS:
            for name in configuration.names(kind):
                try:
                    if kind == 'scenes' and not is_bench(name):
                        Scene.load(name)
                    else:
                        loaders.get(kind, partial(text, kind))(name)
                except Exception as error:
                    wrong.append(str(error))
        Promises.load()
    except Exception as error:  # of an import, of the folder, or of the bounds of the levels
        wrong.append(str(error))
    if wrong:
        advice = 'undo the changes of these files, or pip install --force-reinstall ros_pad'
        yield Finding('shipped files', 'problem', '; '.join(wrong), advice)
    else:
        yield Finding('shipped files', 'ok', 'all can be read, and the bounds of fidelity levels')


def browser() -> Iterator[Finding]:
    """Check that there is a browser for ``pad explore``, if that is installed."""
    if not importlib.util.find_spec('nicegui'):
        return
    try:
        name = webbrowser.get().name
    except webbrowser.Error:
        yield Finding(
            'browser',
            'warning',
            'none can be opened here, for the page of pad explore',
            'sudo apt install firefox, or open the address that pad explore --no-browser prints;'
            ' from another machine after ssh -L PORT:localhost:PORT HOST',
        )
    else:
        yield Finding('browser', 'ok', f'{name} opens the page of pad explore')


_ROS = """
import importlib, json
found = {'wrong': [], 'path': '', 'rmw': ''}
for name in MODULES:
    try:
        importlib.import_module(name)
    except Exception as error:
        found['wrong'].append(f'{name} ({type(error).__name__}: {error})')
if 'rclpy' not in ' '.join(found['wrong']):
    import rclpy
    found['path'] = rclpy.__file__
    try:
        found['rmw'] = rclpy.get_rmw_implementation_identifier()
    except Exception as error:
        found['wrong'].append(f'middleware ({type(error).__name__}: {error})')
print(json.dumps(found))
"""


def ros() -> Iterator[Finding]:
    """Check ROS 2: where it comes from, its middleware, and a message between two processes."""
    error, output = _child(f'MODULES = {ROS_MODULES!r}\n{_ROS}', 'import rclpy')
    sources = ros_sources()
    if error:
        advice = _RMW if 'RMW' in error else f'{_ONE_ROS}; run fastdds shm clean when no node runs'
        yield Finding('ROS 2', 'problem', error, advice)
        return
    found = json.loads(output.strip().rpartition('\n')[2])
    wrong = ', '.join(found['wrong'])
    if not found['path']:
        if sources or 'No module' not in wrong:
            yield Finding('ROS 2', 'problem', wrong, _ONE_ROS)
        else:
            yield Finding(
                'ROS 2',
                'warning',
                'no rclpy: nodes cannot run, and pad run needs --no-ros; all other commands work',
                'pip install "ros_pad[ros]", or install ROS 2 from apt and source its setup.bash',
            )
        return
    yield which_ros(found['path'], sources)
    if wrong:
        advice = 'pip install "ros_pad[ros]", or rosdep install --from-paths src --ignore-src'
        yield Finding('messages', 'problem', wrong, _RMW if 'middleware' in wrong else advice)
        return
    names = ('ROS_DOMAIN_ID', _RANGE, *_OVERRIDES)
    settings = [f'{name}={os.environ[name]}' for name in names if os.environ.get(name)]
    text = ', '.join(settings) or 'domain 0, discovery in the whole subnet'
    yield Finding('middleware', 'ok', f'{found["rmw"]}; {text}')
    yield loopback()


def ros_sources() -> dict[str, str]:
    """Return the distribution of each ROS 2 in this environment, by wheels or folder."""
    found = {}
    for each in metadata.distributions():
        name = str(each.metadata['Name']).replace('_', '-')
        if match := re.fullmatch(r'ros-([a-z]+)-rclpy', name):
            found[f'wheels in {sys.prefix}'] = match[1]
    for name in ('AMENT_PREFIX_PATH', 'LD_LIBRARY_PATH', 'PYTHONPATH'):
        for match in re.finditer(r'/opt/ros/([a-z]+)', os.environ.get(name, '')):
            found[match[0]] = match[1]
    return found


def which_ros(path: str, sources: dict[str, str]) -> Finding:
    """Report the ROS 2 whose rclpy is at a path; two in one environment are a problem."""
    if len(sources) > 1:
        return Finding('ROS 2', 'problem', ' and '.join(sources), _ONE_ROS)
    distribution = next(iter(sources.values()), os.environ.get('ROS_DISTRO') or 'unknown')
    text = f'{distribution}: {pathlib.Path(path).parent}'
    if distribution != DISTRIBUTION:
        advice = f'ros_pad is tested with {DISTRIBUTION} (see QUALITY_DECLARATION.md)'
        return Finding('ROS 2', 'warning', text, advice)
    return Finding('ROS 2', 'ok', text)


def loopback(patience: float = LOOPBACK) -> Finding:
    """Send a message from one process to another, within ``patience`` s once both have started."""
    topic, word = f'/ros_pad_doctor_{uuid.uuid4().hex}', uuid.uuid4().hex
    command = [sys.executable, '-m', 'ros_pad.nodes.loopback']
    children = [
        subprocess.Popen(
            [*command, end, topic, word, '--seconds', str(STARTING + patience)],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env={**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, sys.path))},
        )
        for end in ('subscriber', 'publisher')
    ]  # fmt: skip

    def kill() -> None:
        for child in children:
            child.kill()

    # A process may hang without output, for example at a lock that a killed process has left.
    limit = threading.Timer(STARTING, kill)
    limit.start()
    try:
        for child in children:
            assert child.stdout is not None and child.stderr is not None
            if child.stdout.readline() != 'ready\n':
                _end([child])
                error = f'a node does not start: {_last_line(child.stderr.read())}'
                return Finding('loopback', 'problem', error, f'{discovery_advice()}; {_RMW}')
        limit.cancel()
        started = time.monotonic()
        if children[0].wait(patience) == 0:
            took = time.monotonic() - started
            text = f'a message from process to process after {took:.1f} s (limit {patience:g} s)'
            return Finding('loopback', 'ok', text)
    except subprocess.TimeoutExpired:
        pass
    finally:
        limit.cancel()
        _end(children)
    return Finding(
        'loopback',
        'problem',
        f'no message from one process to another within {patience:g} s: separate nodes do not'
        ' find one another (pad run without --live does not need it)',
        discovery_advice(),
    )


def _end(children: Sequence[subprocess.Popen[str]]) -> None:
    """End processes, first by SIGTERM, so that they leave nothing in shared memory."""
    for child in children:
        child.terminate()
    for child in children:
        try:
            child.wait(5.0)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()


def discovery_advice() -> str:
    """Return what to do if nodes on one machine do not connect; causes found here come first."""
    hints = []
    domain = os.environ.get('ROS_DOMAIN_ID') or '0'
    if known := domain.isdecimal() and int(domain) <= 101:
        port = 7400 + 250 * int(domain)  # first UDP port of the domain, by default of DDS
    else:
        hints.append(f'ROS_DOMAIN_ID={domain}: a number from 0 to 101 is needed')
    reach = os.environ.get(_RANGE, '')
    if not reach:
        hints.append(f'no multicast on this network (VPN, container): export {_RANGE}=LOCALHOST')
    elif reach.upper() == 'OFF':
        hints.append(f'{_RANGE}=OFF keeps processes apart: set it to LOCALHOST')
    overrides = [name for name in _OVERRIDES if os.environ.get(name)]
    hints += [f'unset {name}, which changes discovery' for name in overrides]
    if known:
        hints.append(f'allow UDP ports {port} to {port + 249} on the loopback in the firewall')
        hints.append('ROS_DOMAIN_ID must be the same in all processes')
    return '; '.join([*hints, 'run fastdds shm clean when no node runs'])


def serial_ports(ports: Sequence[str] | None = None) -> Iterator[Finding]:
    """Check that device files can be opened; None checks those of all serial ports."""
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
            yield Finding('serial port', 'warning', f'{port} does not exist', 'plug it in again')
        else:
            try:
                group = pathlib.Path(port).group()
            except (KeyError, OSError):
                group = 'dialout'
            yield Finding(
                'serial port',
                'warning',
                f'{port} may not be opened by you: it belongs to the group {group}',
                f'sudo usermod -aG {group} $USER, then log out and in',
            )


def folders(here: pathlib.Path = pathlib.Path()) -> Iterator[Finding]:
    """Check that bags and logs can be written, and that the disk has enough space for bags."""
    runs = here / 'runs'
    place = runs if runs.exists() else here
    if error := _write_error(place):
        advice = 'change to a folder that you may write to, or give --out'
        yield Finding('runs/', 'problem', f'{place.resolve()}: {error}', advice)
    else:
        free = shutil.disk_usage(place).free
        text = f'{runs.resolve()}: {free / 1e9:.1f} GB free'
        advice = 'a minute of six legs takes 10 to 20 MB: free space, or use --out on another disk'
        if free < ROOM_WANTED:
            status = 'problem' if free < ROOM_NEEDED else 'warning'
            yield Finding('runs/', status, text, advice)
        else:
            yield Finding('runs/', 'ok', text)
    home = os.environ.get('ROS_HOME') or '~/.ros'
    logs = pathlib.Path(os.environ.get('ROS_LOG_DIR') or f'{home}/log').expanduser()
    if error := _write_error(logs):
        advice = 'export ROS_LOG_DIR=/tmp/ros_log, or fix its permissions: nodes need it to start'
        yield Finding('logs', 'problem', f'{logs}: {error}', advice)
    else:
        yield Finding('logs', 'ok', f'{logs}')


def _write_error(folder: pathlib.Path) -> str:
    """Return why nothing can be written to a folder, which may not exist yet, or an empty text."""
    while not folder.exists() and folder.parent != folder:
        folder = folder.parent
    try:
        with tempfile.TemporaryFile(dir=folder):
            return ''
    except OSError as error:
        return str(error.strerror)


def _last_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else 'no message'
