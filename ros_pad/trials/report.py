# SPDX-License-Identifier: Apache-2.0
"""The report of a trial: one HTML file with its pictures and the walk to be looked at again."""

from __future__ import annotations

import html
import math
import os
from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np

from ros_pad.estimation import DOUBTS
from ros_pad.trials import animation
from ros_pad.trials import conditions
from ros_pad.trials import pictures
from ros_pad.trials.label import promise
from ros_pad.trials.metrics import stance_ends
from ros_pad.trials.page import BLACK
from ros_pad.trials.page import BLUE
from ros_pad.trials.page import GREEN
from ros_pad.trials.page import PALE
from ros_pad.trials.page import PAPER_STYLE
from ros_pad.trials.page import STANCE
from ros_pad.trials.page import STYLE
from ros_pad.trials.page import VERMILION
from ros_pad.trials.page import WET
from ros_pad.trials.page import Drawn
from ros_pad.trials.page import embedded
from ros_pad.trials.page import legend
from ros_pad.trials.page import page
from ros_pad.trials.page import refuse
from ros_pad.trials.page import rendered
from ros_pad.trials.page import save
from ros_pad.trials.page import table
from ros_pad.trials.pictures import POLICY_NAMES
from ros_pad.trials.pictures import lead_picture
from ros_pad.trials.trial import Trial
from ros_pad.trials.trial import told
from ros_pad.trials.view import View
from ros_pad.trials.view import view_of

Progress = Callable[[float], None]

_POLICY_TEXTS = (
    'Always flat and always dome never change shape; adaptive feet decide at each lift-off by '
    'what they have felt; the oracle sees the ground where each foot will stand next.'
)


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


_GOAL = 'time to the goal'


def _number_or_dash(value: float | None) -> str:
    return '–' if value is None else f'{value:.1f}'


# Of each metric: name, unit, what it means, and its number as text.
_METRICS: tuple[tuple[str, str, str, Callable[[dict[str, Any]], str]], ...] = (
    ('advance per cycle', 'mm', 'Way of the body along x in a gait cycle.',
     lambda m: f'{1e3 * m["distance_per_cycle_m"]:.1f}'),
    ('distance', 'm', 'Way of the body along x.', lambda m: f'{m["distance_m"]:.2f}'),
    ('duration', 's', 'Time of the trial.', lambda m: f'{m["duration_s"]:.1f}'),
    (_GOAL, 's', 'From the first step until the body was there.',
     lambda m: _number_or_dash(m.get('time_to_goal_s'))),
    ('gait cycles', '', 'Cycles walked.', lambda m: f'{m["cycles"]:.1f}'),
    ('slip path', 'm', 'Way that a foot slid under load, mean of the feet.',
     lambda m: f'{_mean(m["slip_path_m"]):.2f}'),
    ('work lost in slip', 'J', 'Friction times way and moment times turn, all feet together.',
     lambda m: f'{m["dissipation_j"]:.2f}'),
    ('sideways drift', 'mm', 'Place of the body along y at the end.',
     lambda m: f'{1e3 * m["lateral_drift_m"]:z.1f}'),
    ('heading drift', '°', 'Heading of the body at the end, positive to the left.',
     lambda m: f'{math.degrees(m["yaw_drift_rad"]):z.2f}'),
    ('changes of shape', '', 'Between flat and dome, all feet together.',
     lambda m: f'{sum(m["switches"])}'),
    ('overload', 's', 'Time that domes were pressed past their force limit, mean of the feet.',
     lambda m: f'{_mean(m["overload_s"]):.2f}'),
    ('ground judged right', '%',
     'Flat stances at whose end P(wet) was on the right side of one half; domes do not count, '
     'because wet and dry ground feel alike to them.',
     lambda m: '–' if m['wet_accuracy'] is None else f'{100.0 * m["wet_accuracy"]:.1f}'),
)  # fmt: skip


def _result(view: View) -> str:
    """Return the outcome in a sentence or two."""
    trial = view.trial
    if trial.metrics is None:
        body = trial.body[np.isfinite(trial.body).all(axis=1), :2]
        if not len(body):
            return 'The bag has neither metrics nor poses of the body.'
        way = float(np.hypot(*(body[-1] - body[0])))
        lasted = trial.time[-1] - trial.time[0]
        return f'From start to end the body moved by {way:.2f} m in {lasted:.1f} s.'
    own = trial.metrics
    name = POLICY_NAMES.get(trial.policy, trial.policy)
    text = (
        f'{name[:1].upper()}{name[1:]} feet: the robot walked {own.distance_m:.2f} m in '
        f'{own.cycles:.0f} gait cycles, {1e3 * own.distance_per_cycle_m:.0f} mm a cycle'
    )
    for row in view.rows:
        advance = row['distance_per_cycle_m']
        if row['policy'] == trial.policy or not advance > 0.0:
            continue
        gain = 100.0 * (own.distance_per_cycle_m / advance - 1.0)
        other = POLICY_NAMES.get(row['policy'], row['policy'])
        other = f'the {other}' if other == 'oracle' else other
        if abs(gain) < 0.5:
            text += f'; as far as {other}'
        else:
            text += f'; {abs(gain):.0f} % {"further" if gain > 0.0 else "less far"} than {other}'
        text += f' ({1e3 * advance:.0f} mm)'
    text += '.'
    if own.time_to_goal_s is not None:
        text += f' It was at the goal of {own.goal_m:g} m after {own.time_to_goal_s:.1f} s.'
    elif own.goal_m is not None:
        text += f' It did not get to the goal of {own.goal_m:g} m.'
    if own.verdict:
        text += f' The walk is not valid: {own.verdict}.'
    return text


def _doubts(trial: Trial, load_gate: float) -> str:
    """Return in words at how many stance ends feet knew the ground, and why others did not."""
    if not len(trial.doubt):
        return ''
    ends = [
        trial.doubt[np.maximum(rows - 1, 0), column]
        for column, rows in enumerate(stance_ends(trial, load_gate))
    ]
    places, counts = np.unique(np.concatenate(ends), return_counts=True)
    stances = dict(zip(places.tolist(), counts.tolist(), strict=True))
    total = sum(stances.values())
    if not total or set(stances) == {-1}:
        return ''
    others = sorted(((count, place) for place, count in stances.items() if place), reverse=True)
    why = ', '.join(
        f'{DOUBTS[place] if place > 0 else "not told"} {100.0 * count / total:.0f} %'
        for count, place in others
    )
    known = (
        f'At the end of {stances.get(0, 0)} of {total} stances a foot knew the ground below it.'
    )
    return known + (f' The others could not know: {why}.' if why else '')


def _metrics_tables(view: View) -> str:
    if not view.rows:
        return '<p>This bag has no metrics: they need a simulated floor, or one that is known.</p>'
    names = [POLICY_NAMES.get(row['policy'], row['policy']) for row in view.rows]
    head = ['', 'unit', *(html.escape(name) for name in names), 'meaning']
    body = []
    for name, unit, meaning, number in _METRICS:
        if name == _GOAL and view.trial.metrics and view.trial.metrics.goal_m is None:
            continue
        values = [
            f'<b>{text}</b>' if row['policy'] == view.trial.policy else text
            for row in view.rows
            for text in [number(row).replace('-', '\N{MINUS SIGN}')]
        ]
        body.append([name, unit, *values, meaning])
    text = table(head, body, range(2, 2 + len(names)))
    if len(names) > 1:
        text += f'<p class="note">{_POLICY_TEXTS}</p>'
    own = view.trial.metrics
    if own is None or len(view.order) == 1:
        return text
    legs = [view.trial.legs[column] for column in view.order]
    per_leg = [
        ('slip path', 'mm', [f'{1e3 * own.slip_path_m[k]:.0f}' for k in view.order]),
        ('changes of shape', '', [str(own.switches[k]) for k in view.order]),
        ('overload', 's', [f'{own.overload_s[k]:.2f}' for k in view.order]),
    ]
    text += '<h3>Leg by leg</h3>' + table(
        ['', 'unit', *(f'leg {leg}' for leg in legs)],
        [[name, unit, *values] for name, unit, values in per_leg],
        range(2, 2 + len(legs)),
    )
    return text


def _omitted_table(omitted: Sequence[dict[str, Any]]) -> str:
    if not omitted:
        return '<p>No simulation is on record for this trial.</p>'
    rows = [
        [
            html.escape(str(each['term'])),
            'not known' if each['bound'] is None else f'≤ {100.0 * each["bound"]:.1f} %',
            html.escape(str(each['reason'])),
        ]
        for each in omitted
    ]
    head = ['left out', 'bound on its effect', 'of what, and where it comes from']
    return table(head, rows, range(1, 2))


def _facts(trial: Trial) -> str:
    """Return the line below the title."""
    facts = [
        f'policy {POLICY_NAMES.get(trial.policy, trial.policy)}' if trial.policy else '',
        f'seed {trial.seed}' if trial.scene else '',
        f'simulation {trial.fidelity}' if trial.fidelity else '',
        f'recorded {trial.settings["recorded"]}' if 'recorded' in trial.settings else '',
        f'{trial.real_time_factor:.1f} times real time' if trial.real_time_factor else '',
        f'ros_pad {trial.settings["version"]}' if 'version' in trial.settings else '',
    ]
    return html.escape(' · '.join(fact for fact in facts if fact))


# Figures of the page; the first stands above the metrics.
_ORDER = ('comparison', 'path', 'trial', 'window', 'reserves', 'reliability')


def write(
    trial: Trial,
    path: str | os.PathLike[str],
    others: Iterable[Trial] = (),
    progress: Progress | None = None,
    force: bool = False,
) -> None:
    """Write the report of a trial: one HTML file that needs no other file and no network.

    Parameters
    ----------
    trial : Trial
        From the loop or from a bag; what it does not know is left out of the report.
    path : path
        HTML file to write.
    others : iterable of Trial
        To compare with, besides those in ``trial.settings['comparison']``: other policies on
        the same ground.
    progress : callable or None
        Called with the share that is done, 0 to 1.
    force : bool
        Replace a file that is there.

    Raises
    ------
    PadError
        When the file exists or cannot be written.
    """
    refuse(path, force)
    view = view_of(trial, others)
    figures = pictures.draw(view, progress and (lambda share: progress(0.5 * share)))
    name = trial.scene or 'Recorded trial'
    parts = [
        f'<h1>{html.escape(name)}</h1><p class="facts">{_facts(trial)}</p>',
        f'<p class="result">{html.escape(_result(view))}</p>',
        *(f'<p class="warning">{html.escape(warning)}</p>' for warning in _warnings(trial)),
    ]

    def figure(name: str) -> None:
        if name in figures:
            each = figures[name]
            parts.append(f'<h2>{html.escape(each.title)}</h2>')
            parts.append(embedded(each.figure, each.alt, html.escape(each.caption)))
        if progress:
            progress(0.5 + 0.5 * _ORDER.index(name) / len(_ORDER))

    with matplotlib.rc_context(PAPER_STYLE):
        figure('comparison')
        parts.append('<h2>Metrics</h2>' + _metrics_tables(view))
        parts.append('<h2>The walk from above</h2>' + animation.element(view))
        for each in _ORDER[1:]:
            figure(each)
    if words := _doubts(trial, view.load_gate):
        parts.append(f'<h2>What the feet knew</h2><p>{html.escape(words)}</p>')
    parts.append('<h2>What the model leaves out</h2>')
    if 'fidelity_note' in view.settings:
        note = html.escape(promise(view.trial))
        parts.append(
            f'<p>{note[:1].upper()}{note[1:]}. What is promised is the largest error against the '
            'top rung with short steps, on random scenes with such a reserve of grip, and a '
            'margin.</p>'
        )
    parts.append(_omitted_table(view.settings.get('omitted', [])))
    parts.append('<h2>Conditions</h2>')
    cells = [[html.escape(text) for text in row] for row in conditions.rows(trial)]
    parts.append(table(['', ''], cells, range(0)))
    save(path, page(f'{name}: ros_pad', parts).encode())
    if progress:
        progress(1.0)


def drawn(
    trial: Trial, others: Iterable[Trial] = (), progress: Progress | None = None
) -> dict[str, Drawn]:
    """Draw the figures of a trial's report, by name, for a paper.

    They are as wide as one column (85 mm) or both (175 mm), with type of 8 points;
    :func:`ros_pad.trials.page.write_figures` writes them. Parameters are those of :func:`write`.
    """
    return pictures.draw(view_of(trial, others), progress)


def _warnings(trial: Trial) -> list[str]:
    found = []
    if trial.settings.get('interrupted'):
        found.append('The trial was cut short: its metrics are of what was walked until then.')
    found += [f'Fault on the schedule: {fault}' for fault in trial.settings.get('faults', ())]
    if trial.metrics is not None:
        found += [f'Meant to be a dome but stayed flat, {why}' for why in trial.metrics.refusals]
        found += told(trial.metrics.faults)
    if trial.settings.get('repaired'):
        found.append(
            'The bag was repaired: its recorder was cut off, and what came at the end is missing.'
        )
    if lost := trial.settings.get('lost'):
        words = ', '.join(f'{count} on {topic}' for topic, count in sorted(lost.items()))
        found.append(f'Messages were lost on the way to the recorder: {words}.')
    if trial.settings.get('problem'):
        found.append(str(trial.settings['problem']))
    return found


# What others draw with lives in ros_pad.trials.page.
__all__ = [
    'BLACK', 'BLUE', 'GREEN', 'PALE', 'PAPER_STYLE', 'STANCE', 'STYLE', 'VERMILION', 'WET',
    'drawn', 'embedded', 'lead_picture', 'legend', 'page', 'rendered', 'save', 'table', 'write',
]  # fmt: skip
