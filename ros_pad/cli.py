# SPDX-License-Identifier: Apache-2.0
"""The ``pad`` command."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
from typing import Any

import ros_pad
from ros_pad.commands import bag
from ros_pad.commands import calibrate
from ros_pad.commands import chart
from ros_pad.commands import contact
from ros_pad.commands import design
from ros_pad.commands import emulate
from ros_pad.commands import replay
from ros_pad.commands import report
from ros_pad.commands import run
from ros_pad.commands import scenes
from ros_pad.commands import sweep
from ros_pad.commands import wet
from ros_pad.commands.command import INTERRUPTED
from ros_pad.commands.command import complain
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.errors import PadError

# In the order in which ``pad --help`` lists them.
COMMANDS = (
    run,
    scenes,
    sweep,
    report,
    replay,
    bag,
    contact,
    calibrate,
    design,
    wet,
    chart,
    emulate,
)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit status.

    Returns
    -------
    int
        0 done, 1 a failure at run time, 2 bad usage or input, 130 stopped by Ctrl-C.
    """
    parser = _parser()
    options = parser.parse_args(arguments)
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _stop)
    try:
        return int(options.command(options))
    except BrokenPipeError:
        # Whoever read the output has seen enough; Python must not complain of it at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (ConfigError, InvalidInput) as error:
        return complain(error, 2)
    except (PadError, OSError) as error:
        return complain(error, 1)
    except KeyboardInterrupt:
        return complain('stopped', INTERRUPTED)


def _stop(number: int, frame: Any) -> None:
    raise KeyboardInterrupt


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='pad',
        description='Shape-changing feet for legged robots: simulate, record, look. '
        'All values are in SI units; pressures are gauge.',
    )
    parser.add_argument('--version', action='version', version=f'ros_pad {ros_pad.__version__}')
    commands = parser.add_subparsers(title='commands', required=True, metavar='COMMAND')
    for module in COMMANDS:
        module.add(commands)
    return parser


if __name__ == '__main__':
    sys.exit(main())
