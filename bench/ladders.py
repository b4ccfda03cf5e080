# SPDX-License-Identifier: Apache-2.0
"""Measure every ladder on this machine and write its chart and table to docs/charts.

Run ``python bench/ladders.py``; it is ``pad chart all --out docs/charts``.
"""

from __future__ import annotations

import pathlib
import sys

from ros_pad import cli

CHARTS = pathlib.Path(__file__).resolve().parent.parent / 'docs' / 'charts'

if __name__ == '__main__':
    sys.exit(cli.main(['chart', 'all', '--out', str(CHARTS), *sys.argv[1:]]))
