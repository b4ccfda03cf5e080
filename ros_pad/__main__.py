# SPDX-License-Identifier: Apache-2.0
# PYTHON_ARGCOMPLETE_OK: argcomplete searches for this marker if it completes all commands
"""Start ``pad`` from a shell, so that Ctrl-C leaves no traceback even during the imports."""

from __future__ import annotations

import sys

INTERRUPTED = 130  # exit status after Ctrl-C, the same as in shells


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
