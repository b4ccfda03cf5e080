# SPDX-License-Identifier: Apache-2.0
"""The report of a trial: one HTML file with its figures."""

from __future__ import annotations

import html
import math
import os
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import matplotlib
import numpy as np

from ros_pad.configuration import refuse
from ros_pad.estimation import DOUBTS
from ros_pad.reports import pictures
from ros_pad.reports.files import save
from ros_pad.reports.page import heading, page, plain_table, section, table, warning
from ros_pad.reports.pictures import POLICY_NAMES
from ros_pad.reports.style import PAPER_STYLE, Drawn
from ros_pad.reports.view import View, view_of
from ros_pad.trials import conditions
from ros_pad.trials.bag_notes import promise
from ros_pad.trials.metrics import stance_ends
from ros_pad.trials.trial import Trial, fault_lines

_POLICY_TEXTS = (
    'Always flat and always dome never change; adaptive feet decide at each lift-off by their '
    'estimates; the oracle uses the true ground where each foot will stand next.'
)
_GOAL = 'time to the goal'


def _number(value: float | None, form: str = '.1f', scale: float = 1.0) -> str:
    return '–' if value is None else format(scale * value, form)


# Name, unit and meaning of each metric, and the function that returns its value as text.
_METRICS: tuple[tuple[str, str, str, Callable[[dict[str, Any]], str]], ...] = (
    ('advance per cycle', 'mm', 'Distance of the body along x in a gait cycle.',
     lambda m: _number(m['distance_per_cycle_m'], scale=1e3)),
    ('distance', 'm', 'Distance of the body along x.', lambda m: _number(m['distance_m'], '.2f')),
    ('duration', 's', 'Time of the trial.', lambda m: _number(m['duration_s'])),
    (_GOAL, 's', 'Time from the first step to the goal.',
     lambda m: _number(m.get('time_to_goal_s'))),
    ('gait cycles', '', 'Cycles walked.', lambda m: _number(m['cycles'])),
    ('slip path', 'm', 'Length of all slip of a foot, mean of the feet.',
     lambda m: _number(float(np.mean(m['slip_path_m'])), '.2f')),
    ('work lost in slip', 'J',
     'Friction force times slip, and yaw moment times rotation, all feet together.',
     lambda m: _number(m['dissipation_j'], '.2f')),
    ('sideways drift', 'mm', 'Position of the body along y at the end.',
     lambda m: _number(m['lateral_drift_m'], 'z.1f', 1e3)),
    ('heading drift', '°', 'Heading of the body at the end, positive to the left.',
     lambda m: _number(math.degrees(m['yaw_drift_rad']), 'z.2f')),
    ('morphology changes', '', 'Between flat and dome, all feet together.',
     lambda m: str(sum(m['switches']))),
    ('overload', 's', 'Time for which a dome was above its force limit, mean of the feet.',
     lambda m: _number(float(np.mean(m['overload_s'])), '.2f')),
    ('wetness accuracy', '%',
     'Flat stances at whose end P(wet) was on the correct side of 0.5; domes do not count, '
     'because wet and dry ground give the same forces on them.',
     lambda m: _number(m['wet_accuracy'], scale=100.0)),
)  # fmt: skip


def _name(policy: str) -> str:
    return POLICY_NAMES.get(policy, policy)


def _result(view: View) -> str:
    """Return the result of the trial in one or more sentences."""
    trial, own = view.trial, view.trial.metrics
    if own is None:
        body = trial.body[np.isfinite(trial.body).all(axis=1), :2]
        if not len(body):
            return 'The bag has neither metrics nor poses of the body.'
        distance = float(np.hypot(*(body[-1] - body[0])))
        duration = trial.time[-1] - trial.time[0]
        return f'From start to end the body moved by {distance:.2f} m in {duration:.1f} s.'
    text = (
        f'{_name(trial.policy).capitalize()} feet: the robot walked {own.distance_m:.2f} m in '
        f'{own.cycles:.0f} gait cycles, {1e3 * own.distance_per_cycle_m:.0f} mm a cycle'
    )
    for row in view.rows:
        advance = row['distance_per_cycle_m']
        if row['policy'] != trial.policy and advance > 0.0:
            gain = 100.0 * (own.distance_per_cycle_m / advance - 1.0)
            text += f'; {gain:+z.0f} % against {_name(row["policy"])} ({1e3 * advance:.0f} mm)'
    text += '.'
    if own.verdict:
        text += f' The walk is not valid: {own.verdict}.'
    return text


def unobservable_shares(trial: Trial, load_gate: float) -> str:
    """Return sentences: at how many stance ends the ground was observable, and why not at others.

    A foot stands with more than ``load_gate`` newtons. Empty where no doubts are on record.
    """
    ends = [
        trial.slow['doubt'][np.maximum(rows - 1, 0), column]
        for column, rows in enumerate(stance_ends(trial, load_gate))
    ]
    stances = Counter(np.concatenate(ends).tolist())
    if set(stances) <= {-1}:
        return ''
    total = stances.total()
    text = f'At the end of {stances[0]} of {total} stances the ground was observable.'
    why = ', '.join(
        f'{DOUBTS[place] if place > 0 else "not on record"} {100.0 * count / total:.0f} %'
        for place, count in stances.most_common()
        if place
    )
    return text + (f' Reasons at the other ends: {why}.' if why else '')


def _metrics_tables(view: View) -> str:
    own = view.trial.metrics
    if not view.rows:
        return '<p>This bag has no metrics: they need a floor whose true ground is known.</p>'
    names = [html.escape(_name(row['policy'])) for row in view.rows]
    body = []
    for name, unit, meaning, number in _METRICS:
        if name == _GOAL and own and own.goal_m is None:
            continue
        values = [number(row).replace('-', '\N{MINUS SIGN}') for row in view.rows]
        body.append([name, unit, *values, meaning])
    text = table(['', 'unit', *names, 'meaning'], body, range(2, 2 + len(names)))
    if len(names) > 1:
        text += f'<p class="note">{_POLICY_TEXTS}</p>'
    if own is None or len(view.order) == 1:
        return text
    legs = [
        ['slip path', 'mm', *(f'{1e3 * own.slip_path_m[k]:.0f}' for k in view.order)],
        ['morphology changes', '', *(str(own.switches[k]) for k in view.order)],
        ['overload', 's', *(f'{own.overload_s[k]:.2f}' for k in view.order)],
    ]
    head = ['', 'unit', *(f'leg {view.trial.legs[k]}' for k in view.order)]
    return text + '<h3>Leg by leg</h3>' + table(head, legs, range(2, len(head)))


def _terms_table(settings: Mapping[str, Any]) -> str:
    """Return a table of the terms that the model leaves out, and of those that it has."""
    terms = [*settings.get('omitted', ()), *settings.get('taken', ())]
    if not terms:
        return '<p>No simulation is on record for this trial.</p>'
    rows = []
    for each in terms:
        often = ' in 95 of 100 scenes' if each.get('kind') == 'promise' else ''
        bound = each['bound']
        most = 'not known' if bound is None else f'≤ {100.0 * bound:.1f} %{often}'
        effect, share = each.get('effect'), 'not known'
        if effect is not None:
            share = f'≈ {100.0 * effect:.1f} %' if effect <= 1.0 else 'all of it'
        if each.get('exceeds'):
            share += ', exceeds the accuracy required'
        taken = 'yes' if each.get('taken') else 'no'
        cells = (str(each['term']), taken, most, share, str(each['reason']))
        rows.append([html.escape(cell) for cell in cells])
    head = ['term', 'modelled', 'bound', 'effect on the result', 'quantity, and source']
    return table(head, rows, range(2, 4))


def _facts(trial: Trial) -> list[str]:
    """Return the parts of the line below the title; some may be empty."""
    settings = trial.settings
    return [
        f'policy {_name(trial.policy)}' if trial.policy else '',
        f'seed {trial.seed}' if trial.scene else '',
        f'simulation {trial.fidelity}' if trial.fidelity else '',
        *(f'{key} {settings[key]}' for key in ('sensing', 'recorded') if settings.get(key)),
        f'{trial.real_time_factor:.1f} times real time' if trial.real_time_factor else '',
        f'ros_pad {settings["version"]}' if 'version' in settings else '',
    ]


def write(
    trial: Trial, path: str | os.PathLike[str], others: Iterable[Trial] = (), force: bool = False
) -> None:
    """Write the report of a trial: one HTML file that needs no other file and no network.

    Parameters
    ----------
    trial : Trial
        Trial from the loop or from a bag; figures whose data are missing are left out.
    path : path
        HTML file to write.
    others : iterable of Trial
        Trials of other policies on the same ground to compare with, in addition to
        ``trial.settings['comparison']``.
    force : bool
        Whether to replace an existing file.

    Raises
    ------
    InvalidInput
        When the file exists and ``force`` is False.
    PadError
        When the file cannot be written.
    """
    refuse(path, force)
    view = view_of(trial, others)
    with matplotlib.rc_context(PAPER_STYLE):
        sections = {key: section(drawn) for key, drawn in pictures.draw(view).items()}
    name = trial.scene or 'Recorded trial'
    note = ''
    if 'fidelity_note' in trial.settings:
        promised = html.escape(promise(trial))
        note = f'<p>{promised[:1].upper()}{promised[1:]}.</p>'
    parts = [
        heading(name, _facts(trial)),
        f'<p class="result">{html.escape(_result(view))}</p>',
        *map(warning, _warnings(trial)),
        sections.pop('comparison', ''),
        '<h2>Metrics</h2>' + _metrics_tables(view),
        *sections.values(),
    ]
    if words := unobservable_shares(trial, view.load_gate):
        parts.append(f'<h2>Where the ground was observable</h2><p>{html.escape(words)}</p>')
    parts += [
        '<h2>What the model has and leaves out</h2>' + note + _terms_table(trial.settings),
        '<h2>Conditions</h2><p>In SI units; pressures gauge.</p>',
        plain_table(conditions.rows(trial)),
    ]
    save(path, page(f'{name}: ros_pad', parts).encode())


def drawn(trial: Trial, others: Iterable[Trial] = ()) -> dict[str, Drawn]:
    """Draw the figures of a trial's report, by name, for a paper.

    They are 85 mm (one column) or 175 mm (two columns) wide, with type of 8 points;
    :func:`ros_pad.reports.files.write_figures` writes them. Parameters are as for :func:`write`.
    """
    return pictures.draw(view_of(trial, others))


def _warnings(trial: Trial) -> list[str]:
    settings, own = trial.settings, trial.metrics
    found = [f'Scheduled fault: {fault}' for fault in settings.get('faults', ())]
    if own is not None:
        found += [f'A foot that should be a dome stayed flat: {why}' for why in own.refusals]
        found += fault_lines(own.faults)
    if settings.get('interrupted'):
        found.append('The trial was stopped early: its metrics are those of the part before.')
    if settings.get('repaired'):
        found.append('The bag was repaired: its last messages are missing.')
    if lost := settings.get('lost'):
        counts = ', '.join(f'{count} on {topic}' for topic, count in sorted(lost.items()))
        found.append(f'Messages were lost before the recorder received them: {counts}.')
    found += [f'{line}.' for line in settings.get('late', ())]
    return found + ([str(settings['problem'])] if settings.get('problem') else [])
