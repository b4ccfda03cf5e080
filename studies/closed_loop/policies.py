# SPDX-License-Identifier: Apache-2.0
"""Compare policies on the same floors, and the adaptive policy with fixed ones at slower gaits.

Walks ``hexapod_patches`` with full dynamics (L2) under every policy on floors that were not used
to choose any parameter; under fewer policies with other patches and on ground where one fixed
morphology is the optimum; and with fixed morphologies at slower gaits. Prints distance a cycle
(mm) and speed (mm/s), with ratios and their 95 % confidence intervals over floors, and writes
policies.json and .png.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ros_pad.contact.resistance import Foot
from ros_pad.control import MorphologyController
from ros_pad.control import first_morphologies
from ros_pad.control import policy_named
from ros_pad.simulation import Scene
from ros_pad.simulation.gait import WalkingGait
from ros_pad.trials.loop import ClosedLoop
from studies import command
from studies.closed_loop import loops
from studies.drawing import BLUE
from studies.drawing import GREEN
from studies.drawing import STYLE
from studies.drawing import VERMILION

SCENE = 'hexapod_patches'
LEVEL = 'L2'
FIRST_SEED = 100
SLOWER = (1.0, 1.5, 2.0, 3.0)

# Name in this study: policy and its parameters. `adaptive` without parameters plans probes by
# their value, the three after it by other rules.
POLICIES: dict[str, tuple[str, dict[str, Any]]] = {
    'flat': ('flat', {}),
    'dome': ('dome', {}),
    'adaptive': ('adaptive', {}),
    'threshold': ('adaptive', {'probing': 'threshold'}),
    'count 20': ('adaptive', {'probing': 'count', 'probe_every': 20}),
    'count 4': ('adaptive', {'probing': 'count', 'probe_every': 4}),
    'oracle': ('oracle', {}),
}
LOOKS = {
    'flat': (VERMILION, 's'),
    'dome': (BLUE, '^'),
    'adaptive': (GREEN, 'o'),
    'oracle': ('#000000', 'D'),
}


@dataclass(frozen=True)
class Ground:
    """A scene, and the foot that the controller is configured for if the scene has another."""

    scene: Scene
    configured: Foot | None = None


@dataclass(frozen=True)
class Job:
    """One walk: ground, policy, factor on the gait cycle (``slower``), and seed of the floor."""

    ground: str
    policy: str
    slower: float
    seed: int


def grounds(cycles: int) -> dict[str, Ground]:
    """Return all grounds by name."""
    scene = replace(Scene.load(SCENE), cycles=cycles)

    def floor(**changes: Any) -> Ground:
        return Ground(replace(scene, floor=replace(scene.floor, **changes)))

    # Without adhesion, flat feet have the same friction on dry ground as domes.
    plain = replace(scene.foot, friction=0.41, shear_strength=0.0)
    return {
        'as shipped': Ground(scene),
        'patches of 0.5 m': floor(patch_length=0.5),
        'patches of 1 m': floor(patch_length=1.0),
        'patches of 3 m': floor(patch_length=3.0),
        '20 % wet': floor(wet_fraction=0.2),
        '70 % wet': floor(wet_fraction=0.7),
        'wet all over': floor(kind='wet'),
        'dry all over': floor(kind='dry'),
        'nothing towed': Ground(replace(scene, tow=replace(scene.tow, weight=0.0))),
        'flat no better than dome': Ground(replace(scene, foot=plain)),
        'the same, but not known': Ground(replace(scene, foot=plain), configured=scene.foot),
    }


PATCHES = ('patches of 0.5 m', 'patches of 1 m', 'patches of 3 m', '20 % wet', '70 % wet')
UNBEATABLE = (
    'wet all over',
    'dry all over',
    'nothing towed',
    'flat no better than dome',
    'the same, but not known',
)


def fewer(floors: int) -> int:
    """Return the number of floors for all other grounds, and for slower gaits."""
    return max(2, floors // 3)


def jobs(floors: int) -> list[Job]:
    """Return every walk: ``floors`` on the shipped ground, fewer on others and at slower gaits."""
    seeds = range(FIRST_SEED, FIRST_SEED + floors)
    few = seeds[: fewer(floors)]
    todo = [Job('as shipped', policy, 1.0, seed) for policy in POLICIES for seed in seeds]
    for ground in (*PATCHES, *UNBEATABLE):
        for policy in ('flat', 'dome', 'adaptive', *(('oracle',) if ground in PATCHES else ())):
            todo += [Job(ground, policy, 1.0, seed) for seed in few]
    for slower in SLOWER[1:]:
        for policy in ('flat', 'dome'):
            todo += [Job('as shipped', policy, slower, seed) for seed in few]
    return todo


def walk(ground: Ground, job: Job) -> tuple[float, int, str | None]:
    """Return distance a cycle, m, number of switches, and the verdict, None for a valid walk."""
    gait = ground.scene.gait
    assert isinstance(gait, WalkingGait)
    scene = replace(ground.scene, gait=replace(gait, cycle=gait.cycle * job.slower))
    policy, parameters = POLICIES[job.policy]
    loop = ClosedLoop(scene, policy, job.seed, LEVEL, policy_parameters=parameters)
    if ground.configured:
        controller = MorphologyController(
            ground.configured,
            scene.legs,
            policy_named(policy, loop.floor.wet, parameters),
            scene.expected_load,
            start=first_morphologies(policy, scene.legs),
            fixed_pressure=scene.dome_pressure,
        )
        loop.connect(controller=controller)
    loops.walk(loop, scene)
    switches = sum(loop.controller.switches.values())
    return loop.robot.body[0] / scene.cycles, switches, loop.robot.verdict


def ratio(distances: Sequence[float], others: Sequence[float]) -> dict[str, float]:
    """Return the ratio of mean distances on the same floors, and its 95 % bootstrap interval.

    ``least`` and ``most`` are the extreme ratios of single floors. For the interval, floors are
    drawn with replacement, each with the walks of the two policies. (The mean of the ratios of
    floors has no meaning if a policy makes no progress on some floor.)
    """
    ours, theirs = np.array(distances), np.array(others)
    drawn = np.random.default_rng(0).integers(len(ours), size=(10_000, len(ours)))
    low, high = np.percentile(ours[drawn].mean(axis=1) / theirs[drawn].mean(axis=1), (2.5, 97.5))
    return {
        'of_means': round(float(ours.mean() / theirs.mean()), 4),
        'low': round(float(low), 4),
        'high': round(float(high), 4),
        'least': round(float((ours / theirs).min()), 4),
        'most': round(float((ours / theirs).max()), 4),
    }


def measure(floors: int, cycles: int, processes: int) -> dict[str, Any]:
    """Walk everything and return the document that is saved."""
    started = time.perf_counter()
    named = grounds(cycles)
    # Slow gaits take longest, so they are started first.
    todo = sorted(jobs(floors), key=lambda job: -job.slower)
    walks = [(named[job.ground], job) for job in todo]
    walked = dict(zip(todo, command.in_processes(walk, walks, processes, 'policies'), strict=True))

    def result(
        ground: str, policy: str, slower: float = 1.0, count: int = floors
    ) -> dict[str, Any]:
        own = {
            job.seed: walked[job]
            for job in sorted(walked, key=lambda job: job.seed)
            if (job.ground, job.policy, job.slower) == (ground, policy, slower)
            and job.seed < FIRST_SEED + count
        }
        distances = [1e3 * distance for distance, _, _ in own.values()]
        cycle = named[ground].scene.gait.cycle * slower
        return {
            'mm_a_cycle': round(statistics.fmean(distances), 2),
            'mm_per_s': round(statistics.fmean(distances) / cycle, 2),
            'switches': round(statistics.fmean(each for _, each, _ in own.values()), 1),
            'seeds': list(own),
            'each_mm': [round(distance, 2) for distance in distances],
            'verdicts': sorted({verdict for _, _, verdict in own.values() if verdict}),
        }

    document: dict[str, Any] = {
        'scene': SCENE,
        'cycles': cycles,
        'grounds': {
            ground: {
                policy: result(ground, policy)
                for policy in POLICIES
                if any((job.ground, job.policy) == (ground, policy) for job in todo)
            }
            for ground in named
        },
        'slower': [
            {
                'slower': slower,
                'policy': policy,
                **result('as shipped', policy, slower, fewer(floors)),
            }
            for policy in ('flat', 'dome', 'adaptive')
            for slower in (SLOWER if policy != 'adaptive' else SLOWER[:1])
        ],
    }
    for policies in document['grounds'].values():
        policies['ratios'] = {
            other: ratio(policies['adaptive']['each_mm'], policies[other]['each_mm'])
            for other in policies
            if other != 'adaptive'
        }
    document['wall_s'] = round(time.perf_counter() - started, 1)
    return document


def interval(part: dict[str, float]) -> str:
    """Return a ratio and its interval as text."""
    return f'{part["of_means"]:.3f} ({part["low"]:.3f} to {part["high"]:.3f})'


def table(document: dict[str, Any]) -> str:
    """Return the tables of docs/model/policies.md."""
    shipped = document['grounds']['as shipped']
    count = len(shipped['adaptive']['seeds'])
    lines = [
        f'{document["scene"]}, {LEVEL}, {document["cycles"]} cycles, {count} floors from seed'
        f' {FIRST_SEED}; ratio of mean distances, adaptive to each, with 95 % bootstrap interval',
        '',
        '| policy | mm a cycle | least, most | switches | adaptive to it | on the worst floor |',
        '|---|---|---|---|---|---|',
    ]
    for policy in POLICIES:
        row = shipped[policy]
        own = shipped['ratios'].get(policy)
        against = f'{interval(own)} | {own["least"]:.3f}' if own else ' | '
        lines.append(
            f'| {policy} | {row["mm_a_cycle"]:.1f} | {min(row["each_mm"]):.0f},'
            f' {max(row["each_mm"]):.0f} | {row["switches"]:.0f} | {against} |'
        )
    lines += [
        '',
        '| ground | flat | dome | adaptive | oracle | adaptive/flat | /dome | /oracle |',
        '|---|---|---|---|---|---|---|---|',
    ]
    for ground, row in document['grounds'].items():
        distances = [
            f'{row[policy]["mm_a_cycle"]:.1f}' if policy in row else ''
            for policy in ('flat', 'dome', 'adaptive', 'oracle')
        ]
        ratios = [
            interval(row['ratios'][policy]) if policy in row else ''
            for policy in ('flat', 'dome', 'oracle')
        ]
        lines.append('| ' + ' | '.join((ground, *distances, *ratios)) + ' |')
    lines += [
        '',
        f'On the first {len(document["slower"][0]["seeds"])} floors as shipped; adaptive at full'
        f' speed {document["slower"][-1]["mm_a_cycle"]:.1f} mm a cycle',
        '',
        '| gait slower by | flat mm a cycle | flat mm/s | dome mm a cycle | dome mm/s |',
        '|---|---|---|---|---|',
    ]
    slow = {(row['policy'], row['slower']): row for row in document['slower']}
    for slower in SLOWER:
        cells = [
            f'{slow[policy, slower][key]:.1f}'
            for policy in ('flat', 'dome')
            for key in ('mm_a_cycle', 'mm_per_s')
        ]
        lines.append(f'| {slower:g} | ' + ' | '.join(cells) + ' |')
    return '\n'.join(lines)


def draw(document: dict[str, Any]) -> Figure:
    """Draw distance a cycle of every policy by floor, and over speed at slower gaits."""
    with rc_context(STYLE):
        figure = Figure(figsize=(9.0, 3.8), layout='constrained')
        floors, speeds = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
        _draw_floors(floors, document['grounds']['as shipped'])
        _draw_speeds(speeds, document['slower'])
        for panel in (floors, speeds):
            panel.set_ylim(0.0, 145.0)
            panel.set_ylabel('distance a cycle, mm')
            panel.legend(frameon=False, loc='lower left')
    return figure


def _draw_floors(panel: Axes, shipped: dict[str, Any]) -> None:
    domes = shipped['dome']['each_mm']
    order = sorted(range(len(domes)), key=domes.__getitem__)
    for place, index in enumerate(order):
        own = [shipped[policy]['each_mm'][index] for policy in LOOKS]
        panel.plot([place, place], [min(own), max(own)], color='0.8', linewidth=1.0, zorder=1)
    for policy, (colour, marker) in LOOKS.items():
        distances = [shipped[policy]['each_mm'][index] for index in order]
        hollow = policy == 'oracle'
        panel.plot(
            range(len(order)), distances, marker, color=colour, markersize=5,
            markerfacecolor='none' if hollow else colour, label=policy, zorder=2 + hollow,
        )  # fmt: skip
    seeds = shipped['dome']['seeds']
    panel.set_xticks(range(len(order)), [str(seeds[index]) for index in order])
    panel.set_xlabel('floor (seed)')
    panel.set_title('Every policy on the same floors')


def _draw_speeds(panel: Axes, slower: Sequence[dict[str, Any]]) -> None:
    for policy in ('flat', 'dome'):
        colour, marker = LOOKS[policy]
        rows = [row for row in slower if row['policy'] == policy]
        points = [(row['mm_per_s'], row['mm_a_cycle']) for row in rows]
        panel.plot(
            *zip(*points, strict=True), marker=marker, color=colour,
            markersize=5, linewidth=1.2, label=policy,
        )  # fmt: skip
        for row, point in zip(rows, points, strict=True):
            panel.annotate(
                f'{row["slower"]:g}×', point,
                xytext=(0, -14) if policy == 'flat' else (5, 5), textcoords='offset points',
                ha='center' if policy == 'flat' else 'left', fontsize=8, color=colour,
            )  # fmt: skip
    colour, marker = LOOKS['adaptive']
    (row,) = (row for row in slower if row['policy'] == 'adaptive')
    panel.plot(
        row['mm_per_s'], row['mm_a_cycle'], marker,
        color=colour, markersize=7, label='adaptive', zorder=3,
    )  # fmt: skip
    panel.set_xlim(0.0, 150.0)
    panel.set_xlabel('speed, mm/s')
    panel.set_title('Slower gaits: cycle time 1 to 3 times')


def main(words: Sequence[str]) -> int:
    """Measure, save, and print tables."""
    parser = command.parser('policies', __doc__)
    command.add_count(parser, '--floors', 12, 'shipped floors, each with its seed', least=2)
    command.add_count(parser, '--cycles', 60, 'gait cycles of a walk')
    command.add_processes(parser)
    command.add_out(parser)
    options = parser.parse_args(words)
    document = measure(options.floors, options.cycles, options.processes)
    document = command.write(options.out, 'policies', document, {'policies': draw(document)})
    command.show(options, document, table(document))
    return 0
