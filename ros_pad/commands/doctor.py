# SPDX-License-Identifier: Apache-2.0
"""``pad doctor``: find problems of this machine, and advise what to do.

ROS 2 and extras are imported only in separate processes, and dependencies only when they are
checked, so that the checks continue to the end whatever is broken.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import uuid
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import metadata
from typing import NamedTuple

from ros_pad.commands.command import Commands, add_command, complain

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

_DESCRIPTION = f"""\
Check Python, packages, configuration, ROS 2, its middleware, serial ports and disk;
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
For example:
  pad doctor
  pad doctor --json
  pad doctor --robot go2 --mapping go2
  pad doctor --robot my_robot.urdf --feet lf_foot rf_foot lh_foot rh_foot --bag my_bag"""
_INSTALL = 'pip install --editable . in the folder of ros_pad, or rosdep install'
_ONE_ROS = (
    'one ROS 2 at a time: open a new shell and either source /opt/ros/jazzy/setup.bash or'
    ' activate .venv, not both; unset RMW_IMPLEMENTATION, or install what it names'
)
_DISCOVERY = (
    'ROS_DOMAIN_ID, 0 to 101, must be the same in all processes; without multicast (VPN,'
    ' container) export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST, and never OFF; unset other'
    ' variables above; let UDP pass the firewall on loopback; run fastdds shm clean when no node'
    ' runs'
)
_DISCOVERY_VARIABLES = (  # that can keep nodes from connecting
    'RMW_IMPLEMENTATION', 'ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_STATIC_PEERS',
    'ROS_LOCALHOST_ONLY', 'ROS_DISCOVERY_SERVER', 'CYCLONEDDS_URI',
    'FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE',
)  # fmt: skip


class Finding(NamedTuple):
    """Result of a check.

    ``status`` is ``ok``, ``warning`` or ``problem``; ``advice`` may be empty.
    """

    what: str
    status: str
    found: str
    advice: str = ''


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'doctor', run, f'{_DESCRIPTION}\n\n{_EXAMPLES}')
    part.add_argument('--json', action='store_true', help='print one JSON object')
    group = part.add_argument_group('sensors of a robot')
    group.add_argument(
        '--robot',
        metavar='FILE',
        help='check IMU, joints and foot forces of this robot instead of the machine: a shipped'
        ' name, or a .yaml or .urdf file',
    )
    group.add_argument(
        '--feet', nargs='+', default=[], metavar='LINK', help='links of the feet in a URDF file'
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
    if options.robot:
        from ros_pad.commands.robot_check import findings

        found = [Finding(*each) for each in findings(options)]
    else:
        found = list(examine())
    counts = {
        f'{status}s': sum(each.status == status for each in found)
        for status in ('problem', 'warning')
    }
    if options.json:
        print(json.dumps(counts | {'findings': [each._asdict() for each in found]}))
    else:
        for each in found:
            print(f'{each.status:8} {each.what}: {each.found}')
            if each.advice:
                print(f'{"":9}-> {each.advice}')
        print('\n' + ', '.join(f'{status}: {count}' for status, count in counts.items()))
    return 1 if counts['problems'] else 0


def examine() -> Iterator[Finding]:
    """Run all checks one after the other, and yield their findings."""
    for check in (python, packages, extras, config_folder, ros, serial_ports, folders):
        yield from tried(check)


def tried(check: Callable[[], Iterator[Finding]]) -> Iterator[Finding]:
    """Run a check; whatever a broken package raises is a problem of its own."""
    try:
        yield from check()
    except Exception as error:
        what = check.__name__.replace('_', ' ')
        yield Finding(what, 'problem', f'{type(error).__name__}: {error}', _INSTALL)


def python(version: Sequence[int | str] = sys.version_info) -> Iterator[Finding]:
    """Check the version of Python."""
    status = 'ok' if (3, 11) <= tuple(version[:2]) <= (3, 13) else 'warning'
    text = f'{".".join(map(str, version[:3]))} (tested: 3.11 to 3.13), {sys.executable}'
    yield Finding('Python', status, text)


_IMPORT = """
import importlib, json, sys
sys.path[:], wrong = PATH, {}
for name in NAMES:
    try:
        importlib.import_module(name)
    except Exception as error:
        wrong[name] = f'{type(error).__name__}: {error}'
print('\\n' + json.dumps(wrong))
"""


def imports(names: Sequence[str]) -> dict[str, str]:
    """Import modules in a process of their own; return the errors by name."""
    code = _IMPORT.replace('PATH', repr(sys.path)).replace('NAMES', repr(names))
    try:
        child = subprocess.run(
            [sys.executable, '-c', code], stdin=subprocess.DEVNULL, capture_output=True, text=True,
            errors='replace', timeout=STARTING,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return {names[0]: f'its import did not end within {STARTING:g} s'}
    if child.returncode:
        text = f'its import ends with status {child.returncode}: {_last_line(child.stderr)}'
        return {names[0]: text}
    return json.loads(_last_line(child.stdout))


def packages(names: Sequence[str] = NEEDED) -> Iterator[Finding]:
    """Check that the dependencies of ros_pad can be imported, and report its version."""
    if wrong := imports(names):
        text = ', '.join(f'{name} ({error})' for name, error in wrong.items())
        yield Finding('packages', 'problem', f'not usable: {text}', _INSTALL)
        return
    yield Finding('packages', 'ok', ', '.join(names))
    from ros_pad.trials import bag_notes

    made_with = bag_notes.made_with()
    git = made_with.get('git', 'not a checkout of its repository')
    yield Finding('ros_pad', 'ok', f'{made_with["ros_pad"]}, git: {git}')


def extras(names: Sequence[str] = tuple(EXTRAS)) -> Iterator[Finding]:
    """Check the packages that only some users need; a broken one may end its process."""
    with ThreadPoolExecutor() as pool:
        errors = list(pool.map(lambda name: imports([name]).get(name), names))
    for name, error in zip(names, errors, strict=True):
        extra, purpose = EXTRAS[name]
        if error:
            advice = f'pip install "ros_pad[{extra}]", in a checkout: pip install -e ".[{extra}]"'
            yield Finding(name, 'warning', f'{purpose}: {error}', advice)
        else:
            with contextlib.suppress(metadata.PackageNotFoundError):
                purpose = f'{metadata.version(name)}: {purpose.partition(";")[0]}'
            yield Finding(name, 'ok', purpose)


def config_folder() -> Iterator[Finding]:
    """Check that the folder of the shipped configuration is found; count its files."""
    from ros_pad import configuration

    folder = configuration.shared_folder()
    kinds = ('scenes', 'feet', 'materials', 'robots', 'mappings')
    counts = [f'{len(configuration.names(kind))} {kind}' for kind in kinds]
    yield Finding('config folder', 'ok', f'{folder}: {", ".join(counts)}')


def ros() -> Iterator[Finding]:
    """Check ROS 2: where it comes from, its middleware, and a message between two processes."""
    wrong, sources = imports(ROS_MODULES), ros_sources()
    if 'No module' in wrong.get('rclpy', '') and not sources:
        text = 'no rclpy: nodes cannot run, and pad run needs --no-ros; all other commands work'
        advice = 'pip install "ros_pad[ros]", or install ROS 2 from apt and source its setup.bash'
        yield Finding('ROS 2', 'warning', text, advice)
        return
    if 'rclpy' not in wrong:
        spec = importlib.util.find_spec('rclpy')
        yield which_ros(str(spec and spec.origin), sources)
    if wrong:
        what = 'ROS 2' if 'rclpy' in wrong else 'messages'
        text = ', '.join(f'{name} ({error})' for name, error in wrong.items())
        yield Finding(what, 'problem', text, f'{_INSTALL}; {_ONE_ROS}')
        return
    settings = [
        f'{each}={os.environ[each]}' for each in _DISCOVERY_VARIABLES if each in os.environ
    ]
    text = ', '.join(settings) or 'default, domain 0, discovery in the whole subnet'
    yield Finding('middleware', 'ok', text)
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
        return Finding('ROS 2', 'warning', text, f'ros_pad is tested with {DISTRIBUTION}')
    return Finding('ROS 2', 'ok', text)


def loopback(patience: float = LOOPBACK) -> Finding:
    """Send a message from one process to another, within ``patience`` s once both have started."""
    start = [sys.executable, '-m', 'ros_pad.nodes.loopback']
    words = [f'/ros_pad_doctor_{uuid.uuid4().hex}', uuid.uuid4().hex]
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, sys.path))}
    publisher = subprocess.Popen(
        [*start, 'publisher', *words, f'{STARTING + patience}'],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        env=environment,
    )  # fmt: skip
    try:
        heard = subprocess.run(
            [*start, 'subscriber', *words, f'{patience}'], stdin=subprocess.DEVNULL,
            capture_output=True, text=True, env=environment, timeout=STARTING + patience,
        )  # fmt: skip
    except subprocess.TimeoutExpired:  # at a lock that a killed process has left, for example
        text = f'a node does not start within {STARTING:g} s'
        return Finding('loopback', 'problem', text, f'{_DISCOVERY}; {_ONE_ROS}')
    finally:
        publisher.terminate()  # so that it leaves nothing in shared memory
        try:
            publisher.wait(5.0)
        except subprocess.TimeoutExpired:
            publisher.kill()
            publisher.wait()
    if heard.returncode == 0:
        text = f'a message went from process to process within {patience:g} s'
        return Finding('loopback', 'ok', text)
    if 'ready' not in heard.stdout:
        text = f'a node does not start: {_last_line(heard.stderr)}'
        return Finding('loopback', 'problem', text, f'{_DISCOVERY}; {_ONE_ROS}')
    text = f'no message from one process to another within {patience:g} s: separate nodes do not'
    text += ' find one another (pad run without --live does not need it)'
    return Finding('loopback', 'problem', text, _DISCOVERY)


def serial_ports(ports: Sequence[str] | None = None) -> Iterator[Finding]:
    """Check that device files can be opened; None checks those of all serial ports."""
    if ports is None:
        from serial.tools import list_ports

        ports = sorted(port.device for port in list_ports.comports())
    if not ports:
        yield Finding('serial ports', 'ok', 'none is plugged in')
    for port in ports:
        if os.access(port, os.R_OK | os.W_OK):
            yield Finding('serial port', 'ok', f'{port} may be opened')
        else:
            advice = 'sudo usermod -aG dialout $USER, then log out and in'
            yield Finding('serial port', 'warning', f'{port} may not be opened by you', advice)


def folders(here: pathlib.Path = pathlib.Path()) -> Iterator[Finding]:
    """Check that bags and logs can be written, and that the disk has enough space for bags."""
    home = os.environ.get('ROS_HOME') or '~/.ros'
    logs = pathlib.Path(os.environ.get('ROS_LOG_DIR') or f'{home}/log').expanduser()
    runs = here / 'runs'
    for name, folder, advice in (
        ('runs/', runs, 'give --out: a minute of six legs takes 10 to 20 MB'),
        ('logs', logs, 'export ROS_LOG_DIR=/tmp/ros_log, or fix its permissions'),
    ):
        place = folder
        while not place.exists() and place.parent != place:
            place = place.parent
        try:
            with tempfile.TemporaryFile(dir=place):
                free = shutil.disk_usage(place).free
        except OSError as error:
            yield Finding(name, 'problem', f'{place.resolve()}: {error.strerror}', advice)
            continue
        text = f'{folder.resolve()}: {free / 1e9:.1f} GB free'
        status = 'ok' if free > 1e9 or name == 'logs' else 'warning' if free > 1e8 else 'problem'
        yield Finding(name, status, text, '' if status == 'ok' else advice)


def _last_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else 'no message'
