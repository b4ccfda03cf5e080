# SPDX-License-Identifier: Apache-2.0
"""Start ``pad`` from a shell, so that Ctrl-C leaves no traceback even during the imports."""

from __future__ import annotations

import io
import sys

from ros_pad.signals import STOP


def main() -> int:
    """Run the command line; return the exit status, see :func:`ros_pad.cli.main`."""
    STOP.install('pad: stopped\n')
    if isinstance(sys.stdout, io.TextIOWrapper):
        # As on stderr: a terminal without m³ shows its code instead of a traceback.
        sys.stdout.reconfigure(errors='backslashreplace')
    from ros_pad import cli

    return cli.main()


if __name__ == '__main__':
    sys.exit(main())
