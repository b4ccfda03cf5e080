# SPDX-License-Identifier: Apache-2.0
"""The ``pad`` command.

Its commands import much, which takes a second: only the one that is asked for is imported.
"""

from __future__ import annotations

import argparse
import importlib
import os
import signal
import sys
import threading
from collections.abc import Sequence
from typing import Any

import ros_pad
from ros_pad.commands.command import INTERRUPTED
from ros_pad.commands.command import Help
from ros_pad.commands.command import complain
from ros_pad.errors import BagError
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.errors import PadError

COMMANDS = {
    'run': 'walk a scene in closed loop: bag, report, comparison of policies',
    'scenes': 'list the scenes',
    'sweep': 'walk scenes x policies x seeds x parameters on all cores or a cluster',
    'report': "write the page of a bag, of a sweep, or of the thesis' figures",
    'replay': 'feed a bag through estimators and controller once more, and compare',
    'bag': 'say what is in a bag, or repair one',
    'contact': 'shape, ring of liquid and force limits of one pad',
    'calibrate': 'fit a foot to what was measured',
    'design': 'pads on a sole: how many, what they carry, at which pressure',
    'wet': 'liquid round a meshed pad: rise, pressure and pull',
    'chart': 'measure time and error of every method, here and now',
    'emulate': 'a pressure regulator that is not there, on a pseudo-terminal',
    'doctor': 'check Python, ROS 2, serial ports and folders, and say what to do',
}
"""The modules of ``ros_pad.commands``, with what ``pad --help`` says of them, in its order."""

_DESCRIPTION = (
    'Shape-changing feet for legged robots: simulate, record, look. '
    'All values are in SI units; pressures are gauge.'
)
_EPILOG = """\
exit status:
  0    done
  1    a failure at run time, or a difference: no such shape, a silent device, a full disk;
       a replay that differs, trials that failed, a problem that pad doctor found
  2    bad usage or input: an option, scene, foot, table or bag that is not there, or is none
  130  stopped by Ctrl-C or SIGTERM

example:
  pad run hexapod_patches --seed 3

pad COMMAND --help says more, with examples."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status.

    Returns
    -------
    int
        0 done, 1 a failure at run time or a difference, 2 bad usage or input, 130 stopped by
        Ctrl-C.
    """
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _stop)
    try:
        if '_ARGCOMPLETE' in os.environ:
            return _complete()
        words = sys.argv[1:] if arguments is None else arguments
        options = parser(_command_in(words)).parse_args(words)
        return int(options.command(options))
    except BrokenPipeError:
        # Whoever read the output has seen enough; Python must not complain of it at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (ConfigError, InvalidInput) as error:
        return complain(error, 2)
    except BagError as error:
        # A bag that cannot be read is bad input; one that the system refuses to write or to open
        # is a failure.
        return complain(error, 1 if isinstance(error.__cause__, OSError) else 2)
    except (PadError, OSError) as error:
        return complain(error, 1)
    except KeyboardInterrupt:
        return complain('stopped', INTERRUPTED)


def parser(command: str | None = None) -> argparse.ArgumentParser:
    """Return the parser of the command line.

    Parameters
    ----------
    command : str, optional
        The only one whose arguments are wanted; of the others the names are there.
    """
    top = argparse.ArgumentParser(
        prog='pad', description=_DESCRIPTION, epilog=_EPILOG, formatter_class=Help
    )
    top.add_argument('--version', action='version', version=f'ros_pad {ros_pad.__version__}')
    commands = top.add_subparsers(title='commands', required=True, metavar='COMMAND')
    for name, summary in COMMANDS.items():
        if name == command:
            importlib.import_module(f'ros_pad.commands.{name}').add(commands)
        else:
            commands.add_parser(name, help=summary)
    return top


def _command_in(words: Sequence[str]) -> str | None:
    return next((word for word in words if word in COMMANDS), None)


def _complete() -> int:
    """Answer a shell that asks how the line may go on."""
    import argcomplete

    from ros_pad.commands import completion

    line = os.environ['COMP_LINE'][: int(os.environ['COMP_POINT'])]
    before = line.split()[1:] if line.endswith(' ') else line.split()[1:-1]
    top = parser(_command_in(before))
    completion.attach(top)
    argcomplete.autocomplete(top, always_complete_options='long')
    return 0


def _stop(number: int, frame: Any) -> None:
    raise KeyboardInterrupt


if __name__ == '__main__':
    sys.exit(main())
