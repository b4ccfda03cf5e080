# SPDX-License-Identifier: Apache-2.0
"""``pad explore``: a foot designed by looking, on a page in the browser."""

from __future__ import annotations

import argparse
import socket
from typing import Any

from ros_pad.commands.command import Commands, add_command
from ros_pad.configuration import integer
from ros_pad.contact import Foot
from ros_pad.errors import InvalidInput


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    text = (
        'Show a foot on a page in the browser: dome, sole, grip, force limit and switching time'
        ' follow the sliders. The page is served to this machine alone, until Ctrl-C.'
    )
    part = add_command(commands, 'explore', run, text, 'pad explore\npad explore small217')
    add = part.add_argument
    foot: dict[str, Any] = {'metavar': 'FOOT', 'nargs': '?', 'default': 'large37'}
    add('foot', help='to begin with: a name in config/feet or YAML file (large37)', **foot)
    add('--port', type=int, metavar='N', help='number of the TCP port (default: a free one)')
    add('--no-browser', action='store_true', help='do not open a browser')


def run(options: argparse.Namespace) -> int:
    """Serve the page; return the exit status."""
    foot = Foot.load(options.foot)
    from ros_pad.reports.explore_page import HOST, serve

    serve(foot, _port(HOST, options.port), not options.no_browser)
    return 0


def _port(host: str, wanted: int | None) -> int:
    """Return the port if it is free, or a free one."""
    if wanted is not None:
        integer('--port', wanted, 1, 65535)
    with socket.socket() as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind((host, wanted or 0))
        except OSError as error:
            raise InvalidInput(
                f'--port {wanted}: {error.strerror}: give another number, or none'
            ) from error
        return int(trial.getsockname()[1])
