# SPDX-License-Identifier: Apache-2.0
"""Compare the adaptive policy with fixed shapes, rivals of the literature and the oracle.

Walks variants of ``hexapod_patches`` with full dynamics (L2). Everything was tuned on the tuning
grounds (``--tune``, at most nine settings a policy) and is compared on
grounds that differ from them in a condition: patch length, wet share, film, towed load,
friction of the feet. Then on grounds where adapting cannot win, or where the foot's file is
wrong, and with fixed shapes at slower gaits. Every gain has a 95 % bootstrap interval over floors,
the main one over conditions, too. Writes policies.json and .png, and the tables of
docs/model/policies.md.
"""

from __future__ import annotations

import itertools
import statistics
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ros_pad.contact.resistance import Foot
from ros_pad.control import MorphologyController, adaptive, first_morphologies, policy_named
from ros_pad.control.policies import IsWet, Policy
from ros_pad.simulation import Scene
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.terrain import patch_lengths
from ros_pad.trials.loop import ClosedLoop
from studies import command
from studies.closed_loop import loops, rivals
from studies.drawing import BLUE, GREEN, STYLE
from studies.samples import bootstrap

BETTER = 'better fixed shape'
SCENE = 'hexapod_patches'
LEVEL = 'L2'
FIRST_SEED = 80_000
SLOWER = (1.0, 1.5, 2.0, 3.0)

Changes = Mapping[str, Any]

TUNING: dict[str, Changes] = {
    'as shipped': {},
    'patches of 0.5 m': {'floor': {'patch_length': 0.5}},
    'patches of 1 m': {'floor': {'patch_length': 1.0}},
    'patches of 3 m': {'floor': {'patch_length': 3.0}},
    '30 % wet': {'floor': {'wet_fraction': 0.3}},
    '65 % wet': {'floor': {'wet_fraction': 0.65}},
    '90 % wet': {'floor': {'wet_fraction': 0.9}},
    '7 N towed': {'tow': {'weight': 7.0}},
}


def _drawn(count: int) -> dict[str, Changes]:
    """Return conditions in which all is changed at once, most of it beyond what was tuned on."""
    rng = np.random.default_rng(34)
    conditions: dict[str, Changes] = {}
    for _ in range(count):
        wet = float(rng.uniform(0.1, 0.95))
        low, high = (0.3, 5e-5, 3.0, 0.8), (min(6.0, patch_lengths(wet)[1]), 1e-3, 13.0, 1.6)
        length, film, weight, cycle = np.exp(rng.uniform(np.log(low), np.log(high))).tolist()
        name = f'{length:.1f} m, {wet:.0%}, {1e3 * film:.2f} mm, {weight:.1f} N, {cycle:.2f} s'
        floor = {'patch_length': length, 'wet_fraction': wet, 'film_thickness': film}
        conditions[name] = {'floor': floor, 'tow': {'weight': weight}, 'gait': {'cycle': cycle}}
    return conditions


HELD_OUT: dict[str, Changes] = {
    'patches of 0.4 m': {'floor': {'patch_length': 0.4}},
    'patches of 2.2 m': {'floor': {'patch_length': 2.2}},
    'patches of 4 m': {'floor': {'patch_length': 4.0}},
    '15 % wet': {'floor': {'wet_fraction': 0.15}},
    '55 % wet': {'floor': {'wet_fraction': 0.55}},
    '80 % wet': {'floor': {'wet_fraction': 0.8}},
    'film of 0.1 mm': {'floor': {'film_thickness': 1e-4}},
    'film of 1 mm': {'floor': {'film_thickness': 1e-3}},
    '4 N towed': {'tow': {'weight': 4.0}},
    '13 N towed': {'tow': {'weight': 13.0}},
    'cycle of 0.8 s': {'gait': {'cycle': 0.8}},
    'cycle of 1.6 s': {'gait': {'cycle': 1.6}},
    **(DRAWN := _drawn(12)),
}
AGAINST: dict[str, Changes] = {
    'quadruped of 15 kg': {'scene': 'quadruped_patches'},
    'patches of 0.3 m': {'floor': {'patch_length': 0.3}},
    'wet all over': {'floor': {'kind': 'wet'}},
    'dry all over': {'floor': {'kind': 'dry'}},
    'nothing towed': {'tow': {'weight': 0.0}},
    # Without adhesion, flat feet have the same friction on dry ground as domes.
    'no adhesion': {'foot': {'friction': 0.41, 'shear_strength': 0.0}},
    'no adhesion, not known, tuned': {
        'foot': {'friction': 0.41, 'shear_strength': 0.0},
        'file': {},
    },
    'a third of the adhesion, not known': {'foot': {'shear_strength': 1600.0}, 'file': {}},
    'adhesion 1.4 times less than known': {'file': {'shear_strength': 1.4 * 4700.0}},
    'wet friction half of what is known': {'foot': {'boundary_friction': 0.06}, 'file': {}},
    'domes a third as dry, not known': {'foot': {'critical_film': 1e-7}, 'file': {}},
    'domes never dry, not known': {'foot': {'critical_film': 1e-8}, 'file': {}},
}
"""Grounds: changes to floor, towed load, gait and foot of the scene, or another scene. ``file``:
estimators and controller know another foot, that of the scene with these changes."""

FRICTION: dict[str, Changes] = {'as shipped': {}} | {
    f'{key.replace("_", " ")} {word}': {
        'foot': {key: factor * getattr(Scene.load(SCENE).foot, key)},
        'file': {},
    }
    for key in ('friction', 'shear_strength', 'conforming_pressure', 'boundary_friction',
                'critical_film', 'film_exponent')
    for word, factor in (('halved', 0.5), ('doubled', 2.0))
}  # fmt: skip
"""Numbers that decide the friction of feet, all of them assumed; the foot's file is as shipped."""

GROUNDS = {**TUNING, **HELD_OUT, **AGAINST, **FRICTION}
SETTINGS: dict[str, list[tuple[Any, ...]]] = {
    'count': [(2,), (4,), (8,), (16,)],
    'adaptive': [(0.6,), (0.7,), (0.75,), (0.8,), (0.85,), (0.9,)],
    'pomdp': [*itertools.product((0.1, 0.3, 1.0), (0.75, 1.5))],
    'discounted_ucb': [*itertools.product((0.8, 0.9, 0.95), (0.05, 0.2, 0.5))],
}
"""Settings that are tried on the tuning grounds; of the adaptive policy, ``probe_below``."""

RIVALS: dict[str, tuple[str, tuple[Any, ...]]] = {
    'each 8 steps': ('count', (8,)),
    'POMDP': ('pomdp', (1.0, 1.5)),
    'discounted UCB': ('discounted_ucb', (0.8, 0.05)),
}
"""Rivals with the settings that were best on the tuning grounds."""

POLICIES = ('flat', 'dome', 'adaptive', *RIVALS, 'oracle')
PAGE = command.ROOT / 'docs' / 'model' / 'policies.md'
MARKS = '<!-- tables: python -m studies policies -->', '<!-- end of tables -->'
MAIN = ('flat', 'dome', 'adaptive', 'each 8 steps', 'oracle')
THREE = MAIN[:3]


@dataclass(frozen=True)
class Job:
    """One walk: ground, policy, factor on the gait cycle (``slower``), and seed of the floor."""

    ground: str
    policy: str
    slower: float
    seed: int
    cycles: int


def ground(name: str, cycles: int, slower: float = 1.0) -> tuple[Scene, Foot | None]:
    """Return the scene of a ground, and the foot that the robot knows if it is another."""
    changes = GROUNDS[name]
    scene = replace(Scene.load(changes.get('scene', SCENE)), cycles=cycles)
    known = replace(scene.foot, **changes['file']) if 'file' in changes else None
    for part in ('floor', 'tow', 'foot', 'gait'):
        if part in changes:
            scene = replace(scene, **{part: replace(getattr(scene, part), **changes[part])})
    assert isinstance(scene.gait, WalkingGait)
    gait = replace(scene.gait, cycle=scene.gait.cycle * slower)
    return replace(scene, gait=gait), known


def rival(kind: str, settings: Sequence[Any]) -> Policy:
    """Return a rival for one walk."""
    made: Policy = getattr(rivals, kind)(*settings)
    return made


def _policy(name: str, is_wet: IsWet) -> Policy:
    return rival(*RIVALS[name]) if name in RIVALS else policy_named(name, is_wet)


def walk(job: Job) -> tuple[float, int, str | None]:
    """Return distance a cycle, m, number of switches, and the verdict, None for a valid walk."""
    scene, known = ground(job.ground, job.cycles, job.slower)
    policy = _policy(job.policy, scene.floor.build(job.seed).wet)
    first = 'adaptive' if job.policy in RIVALS else job.policy
    loop = _walk(scene, known, policy, first, job.seed)
    switches = sum(loop.controller.switches.values())
    return loop.robot.body[0] / scene.cycles, switches, loop.robot.verdict


def _walk(scene: Scene, known: Foot | None, policy: Policy, first: str, seed: int) -> ClosedLoop:
    """Return a loop that has walked; ``first`` names the policy by which feet begin."""
    loop = ClosedLoop(scene, first, seed, LEVEL)
    controller = MorphologyController(
        known or scene.foot,
        scene.legs,
        policy,
        scene.expected_load,
        start=first_morphologies(first, scene.legs),
        fixed_pressure=scene.dome_pressure,
    )
    loop.connect(controller, known)
    loops.walk(loop)
    return loop


# --- statistics ----------------------------------------------------------------------------------


def ratio(distances: Sequence[float], others: Sequence[float]) -> dict[str, float]:
    """Return the ratio of mean distances on the same floors, and its 95 % bootstrap interval.

    ``least`` is the ratio on the worst floor, ``behind`` the share of floors on which the first is
    more than 0.5 % behind. For the interval, floors are drawn with replacement, each with the
    walks of the two policies. (The mean of the ratios of floors has no meaning if a policy makes
    no progress on some floor.)
    """
    ours, theirs = np.array(distances), np.array(others)
    low, high = bootstrap(list(zip(distances, others, strict=True)), 10_000)
    return {
        'of_means': round(float(ours.mean() / theirs.mean()), 4),
        'low': round(low, 4),
        'high': round(high, 4),
        'least': round(float((ours / theirs).min()), 4),
        'behind': round(float((ours < 0.995 * theirs).mean()), 3),
    }


def _compared(rows: Mapping[str, Any]) -> dict[str, Any]:
    """Return ratios of each policy to oracle and better fixed shape, and of the adaptive to it."""
    each = {name: row['each_mm'] for name, row in rows.items()}
    better = [max(pair) for pair in zip(each['flat'], each['dome'], strict=True)]
    return {
        name: {
            **({'oracle': ratio(own, each['oracle'])} if 'oracle' in each else {}),
            BETTER: ratio(own, better),
            'adaptive to it': ratio(each['adaptive'], own),
        }
        for name, own in each.items()
    }


def _row(results: Sequence[Any], jobs: Sequence[Job]) -> dict[str, Any]:
    distances = [1e3 * distance for distance, _, _ in results]
    return {
        'mm_a_cycle': round(statistics.fmean(distances), 2),
        'switches': round(statistics.fmean(each for _, each, _ in results), 1),
        'seeds': [job.seed for job in jobs],
        'each_mm': [round(distance, 2) for distance in distances],
        'verdicts': sorted({verdict for _, _, verdict in results if verdict}),
    }


def _part(
    grounds: Mapping[str, Changes], policies: Sequence[str], results: Mapping[Job, Any]
) -> dict[str, Any]:
    """Return the results on some grounds: of each ground, and of all floors together."""
    part: dict[str, Any] = {'grounds': {}}
    whole: dict[str, list[Job]] = {policy: [] for policy in policies}
    for name in grounds:
        rows = {}
        for policy in policies:
            jobs = [
                job
                for job in results
                if (job.ground, job.policy, job.slower) == (name, policy, 1.0)
            ]
            whole[policy] += jobs
            rows[policy] = _row([results[job] for job in jobs], jobs)
        part['grounds'][name] = {**rows, 'ratios': _compared(rows)}
    rows = {policy: _row([results[job] for job in jobs], jobs) for policy, jobs in whole.items()}
    part['all'] = {**rows, 'ratios': _compared(rows)}
    return part


def clustered(grounds: Mapping[str, Any], names: Sequence[str]) -> dict[str, float]:
    """Return the gain of the adaptive policy, and its 95 % interval over conditions."""
    pairs = []
    for rows in map(grounds.__getitem__, names):
        better = map(max, rows['flat']['each_mm'], rows['dome']['each_mm'])
        pairs.append((sum(rows['adaptive']['each_mm']), sum(better)))
    ours, theirs = map(sum, zip(*pairs, strict=True))
    low, high = bootstrap(pairs, 10_000)
    return {'of_means': round(ours / theirs, 4), 'low': round(low, 4), 'high': round(high, 4)}


def measure(floors: int, cycles: int, processes: int) -> dict[str, Any]:
    """Walk everything and return the document that is saved."""
    started = time.perf_counter()
    few = range(FIRST_SEED, FIRST_SEED + max(2, floors // 2))
    slow = [
        Job('as shipped', policy, slower, seed, cycles)
        for slower in reversed(SLOWER)
        for policy in ('flat', 'dome', *(('adaptive',) if slower == 1.0 else ()))
        for seed in few
    ]
    jobs = list(slow)
    # Each condition has floors of its own.
    for place, name in enumerate((*HELD_OUT, *AGAINST)):
        first = FIRST_SEED + 100 * (place + 1)
        # On short patches the sign of the gain is not clear, so they have more floors.
        many = floors if name in HELD_OUT else max(1, floors // 2)
        many = 2 * floors if name == 'patches of 0.3 m' else many
        for policy in POLICIES if name in HELD_OUT else MAIN:
            jobs += [Job(name, policy, 1.0, first + k, cycles) for k in range(many)]
    # All of these have the same floors.
    seeds = range(FIRST_SEED, FIRST_SEED + floors)
    jobs += [Job(g, p, 1.0, k, cycles) for g, p, k in itertools.product(FRICTION, THREE, seeds)]
    found = command.in_processes(walk, [(job,) for job in jobs], processes, 'policies')
    results = dict(zip(jobs, found, strict=True))
    document: dict[str, Any] = {
        'scene': SCENE,
        'cycles': cycles,
        'rivals': {name: list(setting) for name, setting in RIVALS.items()},
        'changes': {**HELD_OUT, **AGAINST},
        'held out': _part(HELD_OUT, POLICIES, results),
        'against': _part(AGAINST, MAIN, results),
        'friction': _part(FRICTION, THREE, results),
        'slower': [],
    }
    held = document['held out']['grounds']
    document['clusters'] = {
        f'all {len(HELD_OUT)} conditions': clustered(held, [*HELD_OUT]),
        'one change': clustered(held, [name for name in HELD_OUT if name not in DRAWN]),
        'five changes, drawn': clustered(held, [*DRAWN]),
    }
    for policy, slower in dict.fromkeys((job.policy, job.slower) for job in slow):
        jobs = [job for job in slow if (job.policy, job.slower) == (policy, slower)]
        row = _row([results[job] for job in jobs], jobs)
        speed = round(row['mm_a_cycle'] / slower, 2)
        document['slower'].append({'slower': slower, 'policy': policy, 'mm_per_s': speed, **row})
    document['wall_s'] = round(time.perf_counter() - started, 1)
    return document


# --- tuning --------------------------------------------------------------------------------------


def _tuning_walk(kind: str, settings: tuple[Any, ...], name: str, seed: int, cycles: int) -> float:
    scene, _ = ground(name, cycles)
    policy = adaptive(probe_below=settings[0]) if kind == 'adaptive' else rival(kind, settings)
    return _walk(scene, None, policy, 'adaptive', seed).robot.body[0] / cycles


def tune(floors: int, cycles: int, processes: int) -> dict[str, Any]:
    """Return the mean distance of every setting on the tuning grounds."""
    tried = [(kind, setting) for kind, settings in SETTINGS.items() for setting in settings]
    places = [(name, seed) for name in TUNING for seed in range(floors)]
    cases = [(*one, *place, cycles) for one in tried for place in places]
    walked = command.in_processes(_tuning_walk, cases, processes, 'tuning')
    rows = []
    for index, (kind, setting) in enumerate(tried):
        own = [1e3 * each for each in walked[index * len(places) : (index + 1) * len(places)]]
        row: dict[str, Any] = {'policy': kind, 'settings': list(setting)}
        row['mm_a_cycle'] = round(statistics.fmean(own), 2)
        rows.append(row | {'each_mm': [round(each, 2) for each in own]})
    return {'grounds': TUNING, 'seeds': list(range(floors)), 'cycles': cycles, 'tried': rows}


# --- tables --------------------------------------------------------------------------------------


def interval(part: Mapping[str, float]) -> str:
    """Return a ratio and its interval as text."""
    return f'{part["of_means"]:.3f} ({part["low"]:.3f} to {part["high"]:.3f})'


def overall(document: Mapping[str, Any]) -> str:
    """Return the table of docs/model/policies.md."""
    whole = document['held out']['all']
    lines = [
        f'{document["scene"]}, {LEVEL}, {document["cycles"]} cycles,'
        f' {len(whole["flat"]["seeds"])} held-out floors of {len(HELD_OUT)} conditions:',
        '',
        '| policy | mm a cycle | switches | adaptive to it | to the oracle | to the better'
        ' fixed shape of each floor | worst floor, to that | floors more than 0.5 % behind that |',
        '|' + '---|' * 8,
    ]
    for name in (name for name in POLICIES if name in whole):
        row, ratios = whole[name], whole['ratios'][name]
        better = ratios[BETTER]
        lines.append(
            f'| {name} | {row["mm_a_cycle"]:.1f} | {row["switches"]:.0f} |'
            f' {interval(ratios["adaptive to it"]) if name != "adaptive" else ""} |'
            f' {interval(ratios["oracle"]) if name != "oracle" else ""} |'
            f' {interval(better)} | {better["least"]:.3f} | {better["behind"]:.0%} |'
        )
    clusters = (f'{name} {interval(each)}' for name, each in document['clusters'].items())
    wrong = {
        name: row['ratios']['adaptive'][BETTER]['of_means']
        for name, row in document['friction']['grounds'].items()
    }
    lines += [
        '',
        'Gain of the adaptive policy over the better fixed shape of each floor, with an interval'
        f' over conditions: {"; ".join(clusters)}. On four floors of `{SCENE}` as shipped'
        f' {wrong.pop("as shipped"):.3f}; with one assumed number of friction halved or doubled'
        f' {min(wrong.values()):.3f} to {max(wrong.values()):.3f}.',
    ]
    return '\n'.join(lines)


# --- picture -------------------------------------------------------------------------------------

_LOOKS = ((BETTER, GREEN, -0.15), ('oracle', BLUE, 0.15))
_PARTS = {
    'friction': 'assumed friction wrong, not known, on the same floors',
    'held out': 'held out: one change, or patches, wet share, film, tow, cycle',
    'against': 'another robot, little to win, or foot file wrong',
}


def draw(document: Mapping[str, Any]) -> Figure:
    """Draw the adaptive policy against the better fixed shape and the oracle, ground by ground.

    First, for all held-out grounds together, the interval of chance, then what wrong assumptions
    on friction do.
    """
    with rc_context(STYLE):
        figure = Figure(figsize=(8.4, 11.0), layout='constrained')
        panel = figure.subplots()
        names, heads = ['how sure the gain is'], [0]
        for name, row in document['clusters'].items():
            _ratio(panel, len(names), row, GREEN)
            names.append(f'chance: {name}')
        for part, heading in _PARTS.items():
            heads.append(len(names))
            names.append(heading)
            for name, row in document[part]['grounds'].items():
                for other, colour, shift in _LOOKS:
                    if other in row['ratios']['adaptive']:
                        ratio = row['ratios']['adaptive'][other]
                        _ratio(panel, len(names) + shift, ratio, colour)
                names.append(f'{name} ({len(row["flat"]["seeds"])})')
        panel.axvline(1.0, color='0.6', linewidth=0.8, zorder=0)
        panel.set_yticks(range(len(names)), names)
        for head in heads:
            panel.get_yticklabels()[head].set_fontweight('bold')
        panel.tick_params(axis='y', length=0)
        panel.minorticks_off()
        panel.set(
            ylim=(len(names) - 0.5, -0.5), xlabel='ratio of mean distances, 95 % interval',
            xscale='log', xticks=(ticks := (0.9, 1.0, 1.1, 1.2, 1.5, 2.0, 2.5)), xticklabels=ticks,
            title='distance of feet that adapt (floors)',
        )  # fmt: skip
        handles = [
            Line2D([], [], color=colour, marker='o', ms=4, label=f'to the {name}')
            for name, colour, _ in _LOOKS
        ]
        figure.legend(handles=handles, loc='outside lower right', ncols=3)
    return figure


def _ratio(panel: Axes, place: float, row: Mapping[str, float], colour: str) -> None:
    """Draw a ratio and its interval."""
    panel.plot([row['low'], row['high']], [place, place], color=colour, lw=1.2)
    panel.plot(row['of_means'], place, 'o', color=colour, ms=4)


def main(words: Sequence[str]) -> int:
    """Measure, save, and print the table."""
    parser = command.parser('policies', __doc__)
    command.add_count(
        parser, '--floors', 4, 'floors of each ground held out, half of them elsewhere'
    )
    command.add_count(parser, '--cycles', 60, 'gait cycles of a walk')
    parser.add_argument('--tune', action='store_true', help='try settings on tuning grounds')
    command.add_processes(parser)
    command.add_out(parser)
    options = parser.parse_args(words)
    given = options.floors, options.cycles, options.processes
    if options.tune:
        document = command.write(options.out, 'policies_tuning', tune(*given))
        lines = [
            f'{row["policy"]} {row["settings"]}: {row["mm_a_cycle"]:.2f} mm a cycle'
            for row in document['tried']
        ]
        command.show(options, document, '\n'.join(lines))
        return 0
    document = measure(*given)
    document = command.write(options.out, 'policies', document, {'policies': draw(document)})
    if options.out == command.CHARTS:
        PAGE.write_text(command.pasted(PAGE.read_text(), MARKS, overall(document)))
    command.show(options, document, overall(document))
    return 0
