# SPDX-License-Identifier: Apache-2.0
# PYTHON_ARGCOMPLETE_OK: argcomplete, where it completes all commands, looks for this here
"""``pad`` as a shell starts it: Ctrl-C leaves no traceback, also while it is being imported."""

from __future__ import annotations

import sys

INTERRUPTED = 130  # exit status after Ctrl-C, as shells have it


def main() -> int:
    """Run the command line; return the exit status, see :func:`ros_pad.cli.main`."""
    try:
        from ros_pad import cli

        return cli.main()
    except KeyboardInterrupt:
        print('pad: stopped', file=sys.stderr)
        return INTERRUPTED


if __name__ == '__main__':
    sys.exit(main())
