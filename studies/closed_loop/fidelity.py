# SPDX-License-Identifier: Apache-2.0
"""Bound the errors of the fidelity levels, check the bounds, and write what ros_pad reads.

Walks random scenes of each robot on every level, on the top one (L2 with steps of 0.5 ms, the rail
leg with 0.2 ms), and with 5 % more friction. A line is fitted to the logarithm of each level's
error. It is calibrated by the errors of scenes that a fit left out, a fifth at a time
(cross-conformal prediction). The share that the bounds keep is counted on other scenes.
config/fidelity.yaml has the lines, docs/charts/fidelity.json the shares and every error that was
held out, fidelity.png draws them.

Walks are kept in a file of the folder of --store: a run that was stopped goes on there.
"""

from __future__ import annotations

import json
import math
import operator
import pathlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import yaml

from ros_pad import configuration
from ros_pad.commands.folder import new_folder
from ros_pad.reports.files import save
from ros_pad.simulation.fidelity import (
    FRICTION,
    LEAST,
    STICKING,
    Promises,
    answer,
    choose,
    sticking_distance,
)
from ros_pad.simulation.margin import features
from ros_pad.simulation.scene import RAIL_LEG, Scene, is_bench
from studies import command
from studies.closed_loop import conformal
from studies.closed_loop.fidelity_chart import figure
from studies.closed_loop.random_scenes import BASES, Walk, draw, listed, ranges, walks
from studies.machine import machine
from studies.samples import share_interval

CONFIG = command.ROOT / 'config'
PAGE = command.ROOT / 'docs' / 'model' / 'fidelity.md'
MARKS = '<!-- made by python -m studies fidelity -->', '<!-- end -->'
PROMISE = 0.95
FOLDS = 5

HELD_OUT = 200000
"""Seed from which on scenes are held out; those of the scenes of the fit begin at 0. Scenes from
100000 on were held out once, and the method was changed on them: they may only be fitted."""

# Errors are relative to distance or slip, or to these shares of the distance without slip if that
# is more: a robot that slips all the time hardly advances, and feet that stick do not slip.
LEAST_SHARES = {'distance': 0.5, 'slip': 0.02}

GROUPS: dict[str, Any] = {
    'grip margin below 0.7': lambda row: row['margin'] < math.log(0.7),
    'grip margin 0.7 to 1.5': lambda row: row['near'] and row['margin'] >= math.log(0.7),
    'grip margin from 1.5': lambda row: not row['near'],
    'towing': lambda row: 'climbed' in row and row['dragged'] > 0.0,
    'slopes': lambda row: row.get('climbed', 0.0) > 0.0,
    'patches': lambda row: 0.0 < row['wet'] < 1.0,
    'more than ten cycles': lambda row: row['cycles'] > 10,
}


def errors(scene: Scene, found: dict[str, Walk]) -> dict[str, float]:
    """Return the errors of a scene's walks, by level and metric.

    Infinite where only the top walk ended with a verdict; none for a walk that did.
    """
    top = found['top']
    rows: dict[str, Walk] = {**found, STICKING: (sticking_distance(scene), 0.0, 0.0)}
    best = found['L0' if scene.robot == RAIL_LEG else 'L2']
    result = {}
    for name, walk in rows.items():
        reference = best if name == FRICTION else top
        if name == 'top' or walk is None:
            continue
        for place, (metric, share) in enumerate(LEAST_SHARES.items()):
            if name == STICKING and metric == 'slip':
                continue
            if reference is None:
                result[f'{name} {metric}'] = math.inf
                continue
            least = share * scene.gait.stride * scene.cycles
            off = abs(walk[place] - reference[place])
            result[f'{name} {metric}'] = off / max(abs(reference[place]), least)
    return result


def table(robot: str, stored: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return seed, features, errors and times of stored walks of a robot, by rising seed."""
    rows = []
    for each in sorted(stored, key=operator.itemgetter('seed')):
        if each['robot'] != robot:
            continue
        scene, policy = draw(robot, each['seed'])
        times = {name: walk and walk[2] / scene.duration for name, walk in each['walks'].items()}
        row = {'seed': each['seed'], 'cycles': scene.cycles, 'seconds': times}
        row |= {'features': features(scene, policy), 'errors': errors(scene, each['walks'])}
        rows.append(row)
    return rows


def _arrays(rows: Sequence[dict[str, Any]], name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return features and errors of the rows that have an error of this name."""
    own = [row for row in rows if name in row['errors']]
    known = np.array([[*row['features'].values()] for row in own])
    return known, np.array([row['errors'][name] for row in own])


def fitted(rows: Sequence[dict[str, Any]], name: str) -> dict[str, Any] | None:
    """Fit and calibrate the line of one level and metric; None if there are too few scenes.

    A scene is calibrated by a line that was fitted without it and others of its fifth.
    """
    known, errors = _arrays(rows, name)
    if len(errors) < 30:
        return None
    line = conformal.fit(known, errors)
    apart = np.empty_like(errors)
    for fold in range(FOLDS):
        own = np.arange(len(errors)) % FOLDS == fold
        other = conformal.fit(known[~own], errors[~own]) - line
        # On the line, this error is as high as the true one is on the other line.
        factor = np.exp(-other[0] - known[own] @ other[1:])
        apart[own] = (errors[own] + LEAST) * factor - LEAST
    line[0] += conformal.shift(line, known, apart, PROMISE)
    return None if math.isinf(line[0]) else {'line': line, 'scenes': len(errors)}


def _within(rows: Sequence[dict[str, Any]], spans: dict[str, tuple[float, float]]) -> list[Any]:
    """Return the rows whose features are within those of the scenes of the fit."""
    return [
        row
        for row in rows
        if all(low <= row['features'][name] <= high for name, (low, high) in spans.items())
    ]


def checked(model: dict[str, Any], rows: Sequence[dict[str, Any]], name: str) -> dict[str, Any]:
    """Return what the bound of one level and metric does on scenes that are held out."""
    known, found = _arrays(rows, name)
    if not len(found):
        return {'held_out': 0}
    limits = conformal.bounds(model['line'], known)
    own = [row['features'] | {'cycles': row['cycles']} for row in rows if name in row['errors']]
    groups = {}
    for group, belongs in GROUPS.items():
        inside = np.array([belongs(row) for row in own], dtype=bool)
        if inside.any():
            groups[group] = _share(found[inside] <= limits[inside])
    return _share(found <= limits) | {
        'scenes': model['scenes'],
        'median_error': float(np.median(found)),
        'median_bound': float(np.median(limits)),
        'groups': groups,
    }


def _share(kept: np.ndarray) -> dict[str, Any]:
    low, high = share_interval(int(kept.sum()), len(kept))
    return {
        'held_out': len(kept),
        'kept': round(float(kept.mean()), 4),
        'interval': [round(low, 4), round(high, 4)],
    }


def judged(stored: Sequence[dict[str, Any]]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what config/fidelity.yaml and docs/charts/fidelity.json say of each robot."""
    config, document = {}, {}
    for robot in BASES:
        rows = table(robot, stored)
        tuning = [row for row in rows if row['seed'] < HELD_OUT]
        others = [row for row in rows if row['seed'] >= HELD_OUT]
        if not tuning:
            continue
        spans = {
            name: (min(values), max(values))
            for name in tuning[0]['features']
            for values in [[row['features'][name] for row in tuning]]
        }
        inside = _within(others, spans)
        names = {name: None for row in rows for name in row['errors']}
        models = {name: fitted(tuning, name) for name in names}
        known = {name: model for name, model in models.items() if model is not None}
        if not known:
            continue
        config[robot] = {
            'ranges': ranges(robot),
            'features': spans,
            'bounds': {
                name: dict(zip(['constant', *spans], map(float, model['line']), strict=True))
                for name, model in known.items()
            },
        }
        document[robot] = {
            'tuning': len(tuning),
            'held_out': len(others),
            'outside': len(others) - len(inside),
            'bounds': {name: checked(model, inside, name) for name, model in known.items()},
            'walks': listed(inside),
        }
    return config, document


def text_of(config: dict[str, Any], scenes: dict[str, int]) -> str:
    """Return the text of fidelity.yaml."""
    robots: dict[str, Any] = {}
    for robot, parts in config.items():
        slopes = {
            name: {key: float(f'{value:.5g}') for key, value in line.items()}
            for name, line in parts['bounds'].items()
        }
        spans = {
            part: {name: list(map(float, ends)) for name, ends in parts[part].items()}
            for part in ('ranges', 'features')
        }
        robots[robot] = spans | {'bounds': slopes}
    values = {'machine': machine(), 'scenes': scenes, 'robots': robots}
    return (
        '# Made by python -m studies fidelity. Bound of the error of a level and metric: exp of\n'
        '# constant + slopes times features, less 1e-4; at least 1e-4. The promise: the error of\n'
        '# 95 of 100 scenes drawn in these ranges is within it. Scenes: of fit and calibration.'
        f'\n{yaml.safe_dump(values, default_flow_style=None, sort_keys=False, width=1000)}'
    )


def summary(document: dict[str, Any]) -> str:
    """Return shares, intervals and sharpness as text, and the shares of all robots together."""
    rows = [
        {'robot': robot, 'level, metric': name, **row}
        for robot, part in document['robots'].items()
        for name, row in part['bounds'].items()
        if row['held_out']
    ]
    for words, levels in (('cheapest level', ('L0', 'L1')), ('L2', ('L2',))):
        for metric in LEAST_SHARES:  # a scene counts once
            own = [
                row for row in rows if row['level, metric'] in [f'{x} {metric}' for x in levels]
            ]
            kept = sum(round(row['held_out'] * row['kept']) for row in own)
            count = sum(row['held_out'] for row in own)
            share = {'held_out': count, 'kept': kept / count if count else None}
            share['interval'] = share_interval(kept, count)
            rows.append({'robot': 'all', 'level, metric': f'{words} {metric}', **share})
    return command.listed(rows)


def shipped() -> str:
    """Return which shipped scenes take which level, as a table in Markdown."""
    lines = ['| scene | asks for | takes | bound | cheaper ones |']
    lines.append('|---' * 5 + '|')
    promises = Promises.load()
    for name in configuration.names('scenes'):
        if is_bench(name):
            continue
        scene = Scene.load(name)
        choice = answer(scene) or choose(scene)
        levels = (STICKING, 'L0') if scene.robot == RAIL_LEG else (STICKING, 'L1', 'L2')
        bounds = {each: promises.bound(each, scene) for each in levels}
        cheaper = [
            f'{each} {_percent(bounds[each])}'
            for each in levels[: levels.index(choice.level)]
            if bounds[each] < math.inf
        ]
        cells = [
            f'`{name}`',
            f'{scene.metric}, {_percent(scene.accuracy)}',
            choice.level,
            _percent(choice.bound) if choice.bound < math.inf else 'none',
            ', '.join(cheaper) or '–',
        ]
        lines.append(f'| {" | ".join(cells)} |')
    return '\n'.join(lines)


def _percent(share: float) -> str:
    """Return a share in per cent: three digits from 10 % on, two below."""
    percent = 100.0 * share
    return f'{float(f"{percent:.3g}" if percent >= 10.0 else f"{percent:.2g}"):g} %'


def pasted(page: str) -> str:
    """Return the text of a page with another table of the shipped scenes between its marks."""
    return command.pasted(page, MARKS, shipped())


def measure(
    path: pathlib.Path, wanted: Sequence[tuple[str, int]], processes: int
) -> list[dict[str, Any]]:
    """Walk the scenes that a file of walks lacks, add them to it, and return all its walks."""
    path.parent.mkdir(parents=True, exist_ok=True)
    stored = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    done = {(each['robot'], each['seed']) for each in stored}
    cases = [(*case, str(path)) for case in wanted if case not in done]
    stored += command.in_processes(stored_walks, cases, processes, 'fidelity', 'scene')
    return stored


def stored_walks(robot: str, seed: int, path: str) -> dict[str, Any]:
    """Walk a scene on all levels, and add a line about it to a file."""
    row = {'robot': robot, 'seed': seed, 'walks': walks(robot, seed)}
    with open(path, 'a', encoding='utf-8') as file:
        file.write(json.dumps(row) + '\n')  # one write: lines of processes do not mix
    return row


def main(words: Sequence[str]) -> int:
    """Walk, fit, check; write the files, and print the table."""
    parser = command.parser('fidelity', __doc__)
    command.add_count(parser, '--scenes', 260, 'scenes of each robot to fit and to calibrate')
    command.add_count(parser, '--held-out', 300, 'scenes of each robot to check')
    parser.add_argument(
        '--robots', default=','.join(BASES), metavar='LIST', help='robots (default: %(default)s)'
    )
    parser.add_argument(
        '--store', type=pathlib.Path, metavar='DIR', help='folder of walks (default: a new one)'
    )
    parser.add_argument(
        '--config',
        type=pathlib.Path,
        default=CONFIG,
        metavar='DIR',
        help='where fidelity.yaml goes',
    )
    command.add_processes(parser)
    command.add_out(parser)
    options = parser.parse_args(words)
    store = options.store or new_folder(None, 'fidelity')
    wanted = [
        (robot, start + seed)
        for seed in range(max(options.scenes, options.held_out))
        for robot in options.robots.split(',')
        for start, count in ((0, options.scenes), (HELD_OUT, options.held_out))
        if seed < count
    ]
    stored = measure(store / 'walks.jsonl', wanted, options.processes)
    config, robots = judged(stored)
    text = text_of(config, {robot: part['tuning'] for robot, part in robots.items()})
    assert yaml.safe_load(text)['robots'].keys() == config.keys()
    save(options.config / 'fidelity.yaml', text.encode())
    document = {'promise': PROMISE, 'robots': robots}
    if options.out == command.CHARTS and options.config == CONFIG:
        Promises.load.cache_clear()
        save(PAGE, pasted(PAGE.read_text(encoding='utf-8')).encode())
    command.write(options.out, 'fidelity', document, {'fidelity': figure(document)})
    command.show(options, document, summary(document))
    return 0
