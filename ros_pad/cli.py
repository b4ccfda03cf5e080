# SPDX-License-Identifier: Apache-2.0
"""Feet with inflatable pads for legged robots: simulate, record, analyse.

All values are in SI units; pressures are gauge.

exit status: 0 done; 1 a failure at run time, a replay that differs, failed trials, or a problem
that pad doctor found; 2 bad usage or input; 130 stopped by Ctrl-C or SIGTERM

For example:
  pad run hexapod_patches --seed 3

pad COMMAND --help shows details and examples.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence

import ros_pad
from ros_pad.commands.command import Help, exit_status, prose
from ros_pad.signals import STOP, interrupt

COMMANDS = {
    'run': 'walk a scene in closed loop: bag, report, comparison of policies',
    'scenes': 'list the scenes',
    'sweep': 'run scenes x policies x seeds x parameters on all cores or a cluster',
    'report': "write the page of a bag, of a sweep, or of the thesis' figures",
    'replay': 'run estimators and controller again on a bag, and compare',
    'bag': 'list the content of a bag, or repair one',
    'contact': 'compute shape, ring of liquid and force limits of one pad',
    'calibrate': 'fit a foot to measurements',
    'design': 'compute number, pressure and load of the pads on a sole',
    'mould': 'make moulds, drawing, parts list and steps of a foot',
    'explore': 'show a foot on a page in the browser, with sliders',
    'wet': 'compute rise, pressure and force of the liquid round a meshed pad',
    'chart': 'measure time and error of every method on this machine',
    'emulate': 'emulate a pressure regulator on a pseudo-terminal',
    'doctor': 'check this machine, or the sensors of a robot, and advise',
}
"""Summary of each command, by the name of its module in ``ros_pad.commands``, in the order of
``pad --help``."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status.

    Returns
    -------
    int
        0 done; 1 a failure at run time, or a replay that differs; 2 bad usage or input; 130
        stopped by Ctrl-C or SIGTERM.
    """
    words = sys.argv[1:] if arguments is None else arguments

    def run() -> int:
        command = next((word for word in words if word in COMMANDS), None)
        options = parser(command).parse_args(words)
        with STOP.during(interrupt):
            return int(options.command(options))

    return exit_status(run)


def parser(command: str | None = None) -> argparse.ArgumentParser:
    """Return the parser of the command line.

    Importing all commands takes about a second, so only the module of one is imported.

    Parameters
    ----------
    command : str, optional
        Command whose arguments are added; the others get only name and summary.
    """
    description, epilog = prose(__doc__).split('\n\nexit', 1)
    top = argparse.ArgumentParser(
        prog='pad', description=description, epilog=f'exit{epilog}', formatter_class=Help
    )
    top.add_argument('--version', action='version', version=f'ros_pad {ros_pad.__version__}')
    commands = top.add_subparsers(title='commands', required=True, metavar='COMMAND')
    for name, summary in COMMANDS.items():
        if name == command:
            importlib.import_module(f'ros_pad.commands.{name}').add(commands)
        else:
            commands.add_parser(name, help=summary)
    return top
