# SPDX-License-Identifier: Apache-2.0
"""What adapting is worth: policies on the same floors, and the other remedy, a slower gait.

Walks ``hexapod_patches`` with full dynamics (L2) under every policy, on floors that nothing was
chosen on; with other patches; where a fixed shape cannot be beaten; and with fixed shapes at
slower gaits. Prints distance a cycle (mm) and speed (mm/s), with ratios and their 95 % confidence
intervals over floors, and writes docs/charts/policies.json and .png.
"""

from __future__ import annotations

import argparse
import datetime
import json
import multiprocessing
import pathlib
import platform
import statistics
import sys
import time
from collections.abc import Iterable
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from tqdm import tqdm

from ros_pad.contact.resistance import Foot
from ros_pad.control import MorphologyController
from ros_pad.control import first_shapes
from ros_pad.ladders.ladder import processor
from ros_pad.simulation import Scene
from ros_pad.trials.log import TrialLog
from ros_pad.trials.loop import ClosedLoop
from ros_pad.trials.loop import policy_for

CHARTS = pathlib.Path(__file__).resolve().parent.parent / 'docs' / 'charts'
SCENE = 'hexapod_patches'
RUNG = 'L2'
FIRST_SEED = 100
SLOWER = (1.0, 1.5, 2.0, 3.0)

# Policies by the names they have here; probes of `adaptive` are planned by value.
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
    'flat': ('#D55E00', 's'),
    'dome': ('#0072B2', '^'),
    'adaptive': ('#009E73', 'o'),
    'oracle': ('#000000', 'D'),
}


@dataclass(frozen=True)
class Ground:
    """A scene, and the foot that the controller believes in if it is not the scene's."""

    scene: Scene
    told: Foot | None = None


@dataclass(frozen=True)
class Job:
    """One walk: on which ground, under which policy, with how slow a gait, on which floor."""

    ground: str
    policy: str
    slower: float
    seed: int


def grounds(cycles: int) -> dict[str, Ground]:
    """Return all grounds by name."""
    scene = replace(Scene.load(SCENE), cycles=cycles)

    def floor(**changes: Any) -> Ground:
        return Ground(replace(scene, floor=replace(scene.floor, **changes)))

    # Without adhesion all dry contact has the friction of a dome.
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
        'the same, but not known': Ground(replace(scene, foot=plain), told=scene.foot),
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
    """Return how many floors are walked elsewhere, and with slower gaits."""
    return max(2, floors // 3)


def jobs(floors: int) -> list[Job]:
    """Return every walk; ``floors`` on the ground as shipped, a third of them elsewhere."""
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


class _NoLog(TrialLog):
    """Keeps nothing: only the way counts here."""

    def __init__(self) -> None:
        pass

    def sample(self, *_: Any) -> None:
        pass

    def control(self, *_: Any) -> None:
        pass


def walk(ground: Ground, job: Job) -> tuple[float, int, str | None]:
    """Return distance a cycle, m, the number of switches, and the verdict if it ended early."""
    gait = ground.scene.gait
    scene = replace(ground.scene, gait=replace(gait, cycle=gait.cycle * job.slower))
    policy, parameters = POLICIES[job.policy]
    loop = ClosedLoop(scene, policy, job.seed, RUNG, policy_parameters=parameters)
    if ground.told:
        loop.controller = MorphologyController(
            ground.told,
            scene.legs,
            policy_for(policy, loop.floor, parameters),
            scene.expected_load,
            start=first_shapes(policy, scene.legs),
            fixed_pressure=scene.dome_pressure,
        )
    log = _NoLog()
    try:
        for _ in range(round(scene.duration * 1e9) // loop.period_ns):
            loop.tick(log)
            if loop.robot.verdict:
                break
    finally:
        loop.close()
    switches = sum(loop.controller.switches.values())
    return loop.robot.body[0] / scene.cycles, switches, loop.robot.verdict


_GROUNDS: dict[str, Ground] = {}


def _start_worker(named: dict[str, Ground]) -> None:
    _GROUNDS.update(named)


def _run(job: Job) -> tuple[Job, tuple[float, int, str | None]]:
    return job, walk(_GROUNDS[job.ground], job)


def ratio(ways: Sequence[float], others: Sequence[float]) -> dict[str, float]:
    """Return the ratio of mean ways on the same floors, and its 95 % bootstrap interval.

    Floors are drawn anew, both policies with them. (The mean of ratios says nothing where a policy
    is stuck on some floor.)
    """
    ours, theirs = np.array(ways), np.array(others)
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
    todo = jobs(floors)
    # Slow gaits take longest: first.
    todo.sort(key=lambda job: -job.slower)
    walked: dict[Job, tuple[float, int, str | None]] = {}
    with multiprocessing.Pool(processes, _start_worker, (named,)) as pool:
        runs: Iterable[Any] = pool.imap_unordered(_run, todo)
        walked.update(tqdm(runs, total=len(todo), unit='walk', file=sys.stderr))

    def result(
        ground: str, policy: str, slower: float = 1.0, count: int = floors
    ) -> dict[str, Any]:
        own = {
            job.seed: walked[job]
            for job in sorted(walked, key=lambda job: job.seed)
            if (job.ground, job.policy, job.slower) == (ground, policy, slower)
            and job.seed < FIRST_SEED + count
        }
        ways = [1e3 * way for way, _, _ in own.values()]
        cycle = named[ground].scene.gait.cycle * slower
        return {
            'mm_a_cycle': round(statistics.fmean(ways), 2),
            'mm_per_s': round(statistics.fmean(ways) / cycle, 2),
            'switches': round(statistics.fmean(each for _, each, _ in own.values()), 1),
            'seeds': list(own),
            'each_mm': [round(way, 2) for way in ways],
            'verdicts': sorted({verdict for _, _, verdict in own.values() if verdict}),
        }

    document: dict[str, Any] = {
        'scene': SCENE,
        'cycles': cycles,
        'machine': f'{processor()}, Python {platform.python_version()}',
        'date': datetime.date.today().isoformat(),
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
    """Return the tables as docs/model.md has them."""
    shipped = document['grounds']['as shipped']
    count = len(shipped['adaptive']['seeds'])
    lines = [
        f'{document["scene"]}, {RUNG}, {document["cycles"]} cycles, {count} floors from seed'
        f' {FIRST_SEED}; ratio of mean distances, adaptive to each, with 95 % bootstrap interval',
        '',
        '| policy | mm a cycle | least, most | switches | adaptive to it | on the worst floor |',
        '|---|---|---|---|---|---|',
    ]
    for policy in POLICIES:
        row = shipped[policy]
        own = shipped['ratios'].get(policy)
        ratios = f'{interval(own)} | {own["least"]:.3f}' if own else ' | '
        lines.append(
            f'| {policy} | {row["mm_a_cycle"]:.1f} | {min(row["each_mm"]):.0f},'
            f' {max(row["each_mm"]):.0f} | {row["switches"]:.0f} | {ratios} |'
        )
    lines += [
        '',
        '| ground | flat | dome | adaptive | oracle | adaptive/flat | /dome | /oracle |',
        '|---|---|---|---|---|---|---|---|',
    ]
    for ground, row in document['grounds'].items():
        ways = [
            f'{row[policy]["mm_a_cycle"]:.1f}' if policy in row else ''
            for policy in ('flat', 'dome', 'adaptive', 'oracle')
        ]
        ratios = [
            interval(row['ratios'][policy]) if policy in row else ''
            for policy in ('flat', 'dome', 'oracle')
        ]
        lines.append('| ' + ' | '.join((ground, *ways, *ratios)) + ' |')
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


def draw(document: dict[str, Any], path: pathlib.Path) -> None:
    """Draw each floor's walks, paired, and distance a cycle against speed of slower gaits."""
    shipped = document['grounds']['as shipped']
    with rc_context({'font.size': 9, 'axes.spines.top': False, 'axes.spines.right': False}):
        figure = Figure(figsize=(9.0, 3.8), layout='constrained')
        floors, speeds = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
        order = sorted(
            range(len(shipped['dome']['each_mm'])), key=shipped['dome']['each_mm'].__getitem__
        )
        for place, index in enumerate(order):
            own = [shipped[policy]['each_mm'][index] for policy in LOOKS]
            floors.plot([place, place], [min(own), max(own)], color='0.8', linewidth=1.0, zorder=1)
        for policy, (colour, marker) in LOOKS.items():
            ways = [shipped[policy]['each_mm'][index] for index in order]
            hollow = policy == 'oracle'
            floors.plot(
                range(len(order)), ways, marker, color=colour, markersize=5,
                markerfacecolor='none' if hollow else colour, label=policy, zorder=2 + hollow,
            )  # fmt: skip
        floors.set_xticks(
            range(len(order)), [str(shipped['dome']['seeds'][index]) for index in order]
        )
        floors.set_xlabel('floor (seed)')
        floors.set_ylabel('distance a cycle, mm')
        floors.set_ylim(0.0, 145.0)
        floors.legend(frameon=False, loc='lower left')
        floors.set_title('Every policy on the same floors', fontsize=9)
        for policy in ('flat', 'dome'):
            colour, marker = LOOKS[policy]
            rows = [row for row in document['slower'] if row['policy'] == policy]
            speeds.plot(
                [row['mm_per_s'] for row in rows],
                [row['mm_a_cycle'] for row in rows],
                marker=marker, color=colour, markersize=5, linewidth=1.2, label=policy,
            )  # fmt: skip
            for row in rows:
                speeds.annotate(
                    f'{row["slower"]:g}×', (row['mm_per_s'], row['mm_a_cycle']),
                    xytext=(0, -14) if policy == 'flat' else (5, 5), textcoords='offset points',
                    ha='center' if policy == 'flat' else 'left', fontsize=8, color=colour,
                )  # fmt: skip
        colour, marker = LOOKS['adaptive']
        (row,) = (row for row in document['slower'] if row['policy'] == 'adaptive')
        speeds.plot(
            row['mm_per_s'], row['mm_a_cycle'], marker,
            color=colour, markersize=7, label='adaptive', zorder=3,
        )  # fmt: skip
        speeds.set_xlim(0.0, 150.0)
        speeds.set_ylim(0.0, 145.0)
        speeds.set_xlabel('speed, mm/s')
        speeds.set_ylabel('distance a cycle, mm')
        speeds.legend(frameon=False, loc='lower left')
        speeds.set_title('Slower gaits: cycle time 1 to 3 times', fontsize=9)
        figure.savefig(path, dpi=150)


def main() -> None:
    """Measure, save, and print tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--json', action='store_true', help='print the document instead')
    parser.add_argument('--floors', type=int, default=12, help='seeds as shipped (default: 12)')
    parser.add_argument('--cycles', type=int, default=60, help='gait cycles (default: 60)')
    parser.add_argument('--processes', type=int, default=2, help='at once (default: 2)')
    parser.add_argument('--out', type=pathlib.Path, default=CHARTS, help='folder for .json, .png')
    options = parser.parse_args()
    if options.floors < 2 or options.cycles < 1 or options.processes < 1:
        parser.error('at least 2 floors, 1 cycle and 1 process are needed')
    document = measure(options.floors, options.cycles, options.processes)
    options.out.mkdir(parents=True, exist_ok=True)
    text = json.dumps(document, indent=1, ensure_ascii=False)
    (options.out / 'policies.json').write_text(text + '\n', encoding='utf-8')
    draw(document, options.out / 'policies.png')
    print(text if options.json else table(document))


if __name__ == '__main__':
    main()
