# SPDX-License-Identifier: Apache-2.0
"""Make the moulds of a foot.

Writes meshes (STL and 3MF, mm), spacer (DXF), drawing (SVG, PDF), parts list, steps of the work
(making.html), the foot as it is made and the table to measure it, and the same of a test piece. It
needs the extra make: pip install 'ros_pad[make]'.

Processes:
  large     a printed bone wrapped in silicone, from pads of 1 mm radius on
  small     a body of firmer silicone under a softer sheet

Settings for --set, SI:
SETTINGS

For example:
  pad mould large37
  pad mould my_foot.yaml --out my_moulds --set tolerance=3e-5 --set mount_circle=0.024
"""

from __future__ import annotations

import argparse
import csv
import pathlib
import textwrap

from ros_pad.commands.command import FOLDER, Commands, add_command, print_table
from ros_pad.commands.progress import bar
from ros_pad.commands.sweep import pairs, typed
from ros_pad.configuration import refuse
from ros_pad.contact import Foot
from ros_pad.making.plan import PROCESSES, SETTINGS, plan


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    known = '\n'.join(
        textwrap.fill(
            f'{each.name:13} {each.description} {each.default:g} {each.unit}'.rstrip(),
            98, initial_indent='  ', subsequent_indent=' ' * 16,
        )
        for each in SETTINGS
    )  # fmt: skip
    part = add_command(commands, 'mould', run, (__doc__ or '').replace('SETTINGS', known))
    add = part.add_argument
    add('foot', metavar='FOOT', help='a name in config/feet or a YAML file')
    add('--process', choices=PROCESSES, help='see above (by the size of the pads)')
    text = 'a setting, see above; may be repeated'
    add('--set', action='append', default=[], metavar='NAME=VALUE', help=text)
    add('--out', help='folder to write (default: FOOT_moulds here)', **FOLDER)
    add('--force', action='store_true', help='replace existing files')


def run(options: argparse.Namespace) -> int:
    """Write the files; return the exit status."""
    foot = Foot.load(options.foot)
    given = {name: typed(text) for name, text in pairs('--set', options.set, '=').items()}
    made = plan(foot, options.process, given)
    folder = options.out or pathlib.Path(f'{pathlib.Path(options.foot).stem}_moulds')
    from ros_pad.making.expect import ceiling_of
    from ros_pad.reports import moulds
    from ros_pad.reports.files import save

    with bar('making moulds', 3.0, 'steps') as progress:
        found = moulds.files(made, progress)
    for name in found:
        refuse(folder / name, options.force)
    for name, data in found.items():
        save(folder / name, data)
    head, *rows = csv.reader(found['parts.csv'].decode().splitlines())
    print_table(head, rows, 3)
    print(f'\nceiling to set: {ceiling_of(made):.0f} Pa gauge')
    print(f'page to work by: {folder / "making.html"}')
    return 0
