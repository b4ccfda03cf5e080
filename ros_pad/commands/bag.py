# SPDX-License-Identifier: Apache-2.0
"""List the content of a bag, or repair an incomplete one.

info: list topics with types, numbers of messages, rates, gaps and losses; repair: copy the
messages that can be read from an incomplete bag (recorder killed, disk full) into a new bag.

For example:
  pad bag info runs/hexapod_patches_adaptive_seed0/bag
  pad bag repair my_trial --out my_trial_repaired
"""

from __future__ import annotations

import argparse
import json
import pathlib
import warnings
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from ros_pad.bags import BagReader, recovery
from ros_pad.commands.command import FOLDER, Commands, add_command, complain, print_table
from ros_pad.commands.progress import bar
from ros_pad.errors import BagError, InvalidInput
from ros_pad.pace import Progress, part
from ros_pad.trials import bag_notes
from ros_pad.trials.recorded import late

_LOSSES = {
    'unread_bytes': 'bytes at the end cannot be read',
    'damaged_chunks': 'damaged chunks were left out',
    'lost_messages': 'messages were left out: their topic was defined in a damaged chunk',
}


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'bag', run, __doc__)
    add = part.add_argument
    add('action', choices=('info', 'repair'), help='see above')
    add('bag', type=pathlib.Path, metavar='BAG', help='folder of a bag, or one MCAP file')
    add('--out', help='new folder for the repaired bag (default: BAG_repaired)', **FOLDER)
    add('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """List the content of the bag, or repair it; return the exit status."""
    if options.action == 'repair':
        return _repair(options)
    if options.out:
        raise InvalidInput('--out is only for pad bag repair: pad bag info writes nothing')
    with warnings.catch_warnings(), bar('reading', 1.0, 'bag') as progress:
        warnings.simplefilter('ignore')  # the problem is reported below
        found = _content(options.bag, progress)
    problem = found['problem']
    if options.json:
        print(json.dumps(found))
        return 1 if problem else 0
    _show(found)
    return complain(f'{problem}: repair it with pad bag repair', 1) if problem else 0


def _repair(options: argparse.Namespace) -> int:
    source: pathlib.Path = options.bag
    with bar('reading', 1.0, 'bag') as progress:
        found = recovery.inspect(source, progress)
    written: pathlib.Path | None = None
    if not found.sound:
        # . and .. are no names for a folder
        place = source if source.name.strip('.') else source.resolve()
        name = place.stem if place.is_file() else place.name
        written = options.out or place.with_name(f'{name}_repaired')
        with bar('writing', 1.0, 'bag') as progress:
            found = recovery.repair(source, written, progress)
    if options.json:
        repaired = None if written is None else str(written)
        print(json.dumps({'bag': str(source), 'repaired': repaired} | asdict(found)))
    elif written is None:
        print(f'{source} is complete, {found.messages} messages; nothing was written')
    else:
        print(f'{written}: {found.messages} messages recovered')
        _show_losses(asdict(found))
        if found.closed and not found.described:
            print('metadata.yaml was missing, or did not match the files')
    return 0


def _content(bag: pathlib.Path, progress: Progress) -> dict[str, Any]:
    """Return what JSON has of a bag."""
    reader = BagReader(bag, part(progress, 0.0, 0.4))

    def custom(key: str) -> dict[str, Any]:
        try:
            return dict(json.loads(reader.custom_data.get(key, '{}')))
        except (TypeError, ValueError) as error:
            raise BagError(
                f'{reader.path}: custom data {key!r} is not as ros_pad writes them: {error}'
            ) from error

    problem, times, slow = reader.problem, {}, []
    try:
        times = reader.log_times(part(progress, 0.4, 0.7))
        slow = late(reader, part(progress, 0.7, 1.0))
    except BagError as error:  # what does not depend on single messages is listed all the same
        problem = problem or str(error)
    return {
        'bag': str(bag),
        'start_ns': reader.start,
        'duration_s': (reader.end - reader.start) * 1e-9,
        'messages': reader.message_count,
        'recorded_at': reader.custom_data.get(bag_notes.RECORDED_AT),
        'topics': {
            name: {'type': kind, 'messages': reader.counts[name]} | _timing(times.get(name))
            for name, kind in reader.topics.items()
        },
        'lost': custom(bag_notes.LOST),
        'late': slow,
        'problem': problem,
        'repair': custom(recovery.KEY),
        'trial': custom(bag_notes.KEY),
        'made_with': custom(bag_notes.MADE_WITH),
        'parameters': custom(bag_notes.PARAMETERS),
    }


def _timing(times: np.ndarray | None) -> dict[str, float | None]:
    """Return mean rate and longest gap of messages with these log times, ns."""
    steps = np.diff(np.sort(times)) * 1e-9 if times is not None else np.empty(0)
    known = bool(steps.sum() > 0.0)
    return {
        'rate_hz': float(len(steps) / steps.sum()) if known else None,
        'longest_gap_s': float(steps.max()) if known else None,
    }


def _show(found: Mapping[str, Any]) -> None:
    print(f'{found["bag"]}: {found["messages"]} messages in {found["duration_s"]:.2f} s')
    trial, made_with, repair = found['trial'], found['made_with'], found['repair']
    if trial:
        words = (f'{name} {trial.get(name, "unknown")}' for name in ('scene', 'policy', 'seed'))
        print(', '.join(words))
    if made_with:
        print('made with', ', '.join(f'{name} {version}' for name, version in made_with.items()))
    if found['recorded_at']:
        print('recorded at the', found['recorded_at'])
    if repair:
        print('repaired from', repair.get('source', 'a broken bag'))
        _show_losses(repair)
    for line in found['late']:
        print(line)
    lost = dict(found['lost'])
    rows = [
        [name, topic['type'], str(topic['messages'])]
        + [
            '-' if topic[key] is None else f'{topic[key]:.4g} {unit}'
            for key, unit in (('rate_hz', 'Hz'), ('longest_gap_s', 's'))
        ]
        + [str(lost.pop(name, ''))]
        for name, topic in sorted(found['topics'].items())
    ]
    print_table(['topic', 'type', 'messages', 'mean rate', 'longest gap', 'lost'], rows, texts=2)
    for name, count in sorted(lost.items()):
        print(f'{count} batches lost: {name}')


def _show_losses(found: Mapping[str, Any]) -> None:
    for name, words in _LOSSES.items():
        if found.get(name):
            print(f'{found[name]:8d}  {words}')
