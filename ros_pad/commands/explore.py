# SPDX-License-Identifier: Apache-2.0
"""Show a foot on a page in the browser.

Dome, sole, grip, force limit and switching time follow the sliders. The page is served to this
machine alone, until Ctrl-C.

For example:
  pad explore
  pad explore small217
"""

from __future__ import annotations

import argparse
import socket
from typing import Any

from ros_pad.commands.command import Commands, add_command
from ros_pad.contact import Foot


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'explore', run, __doc__)
    add = part.add_argument
    foot: dict[str, Any] = {'metavar': 'FOOT', 'nargs': '?', 'default': 'large37'}
    add('foot', help='to begin with: a name in config/feet or YAML file (large37)', **foot)
    add('--no-browser', action='store_true', help='do not open a browser')


def run(options: argparse.Namespace) -> int:
    """Serve the page; return the exit status."""
    foot = Foot.load(options.foot)
    from ros_pad.reports.explore_page import HOST, serve

    with socket.create_server((HOST, 0)) as free:
        port = int(free.getsockname()[1])
    serve(foot, port, not options.no_browser)
    return 0
