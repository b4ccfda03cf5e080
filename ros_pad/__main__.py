# SPDX-License-Identifier: Apache-2.0
# PYTHON_ARGCOMPLETE_OK: argcomplete searches for this marker if it completes all commands
"""Start ``pad`` from a shell, so that Ctrl-C leaves no traceback even during the imports."""

from __future__ import annotations

import io
import sys

from ros_pad.signals import INTERRUPTED, STOP


def main() -> int:
    """Run the command line; return the exit status, see :func:`ros_pad.cli.main`."""
    STOP.install('pad: stopped\n')
    if isinstance(sys.stdout, io.TextIOWrapper):
        # As on stderr: a terminal without m³ shows its code instead of a traceback.
        sys.stdout.reconfigure(errors='backslashreplace')
    try:
        from ros_pad import cli

        return cli.main()
    except KeyboardInterrupt:  # after the command had ended
        return INTERRUPTED


if __name__ == '__main__':
    sys.exit(main())
