# SPDX-License-Identifier: Apache-2.0
"""Turn or mirror the axes of forces or positions, and count the stances until that is found.

The readings of a walk are recorded once, and each fault is put into what the estimators get. The
feet of a robot share the fault, and hear each other. On the honest readings no axes may be in
doubt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ros_pad.estimation import doubt
from ros_pad.estimation.stage import EstimationStage
from ros_pad.records import Block
from ros_pad.simulation.faults import Fault
from ros_pad.simulation.scene import Scene
from ros_pad.trials.log import TrialLog
from ros_pad.trials.loop import ClosedLoop
from ros_pad.trials.node_settings import tuning_for
from ros_pad.trials.series import Records
from studies.closed_loop import loops
from studies.samples import runs
from studies.work_precision.estimator.walks import LOADED, SETTLED, Flags, full

CYCLES = 8
ASKED = 3  # stances within which turned axes are to be found
SHORTEST = 0.1  # s: a shorter one is a bounce

Matrix = tuple[tuple[float, float, float], ...]
STRAIGHT: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _axes(names: str) -> Matrix:
    """Return the matrix that reads the named axes as x, y and z, as in ``-y x z``."""
    rows = [[float(axis == name[-1]) for axis in 'xyz'] for name in names.split()]
    signs = [-1.0 if name[0] == '-' else 1.0 for name in names.split()]
    return tuple((s * a, s * b, s * c) for s, (a, b, c) in zip(signs, rows, strict=True))


FAULTS: dict[str, tuple[Matrix, Matrix, str]] = {
    'force turned by 90° about z': (_axes('-y x z'), STRAIGHT, 'by about 90°'),
    'force turned by -90° about z': (_axes('y -x z'), STRAIGHT, 'by about -90°'),
    'force turned by 180° about z': (_axes('-x -y z'), STRAIGHT, 'about 180°'),
    'x of the force mirrored': (_axes('-x y z'), STRAIGHT, 'x of force or position'),
    'y of the force mirrored': (_axes('x -y z'), STRAIGHT, 'y of force or position'),
    'x and y of the force exchanged': (_axes('y x z'), STRAIGHT, 'are exchanged'),
    'position turned by 90° about z': (STRAIGHT, _axes('-y x z'), 'by about -90°'),
    'x of the position mirrored': (STRAIGHT, _axes('-x y z'), 'x of force or position'),
    'y of the position mirrored': (STRAIGHT, _axes('x -y z'), 'y of force or position'),
    'normal force along x': (_axes('z y x'), STRAIGHT, 'along x'),
    'normal force along y': (_axes('x z -y'), STRAIGHT, 'along y'),
    'sign of the force turned': (_axes('-x -y -z'), STRAIGHT, 'sign of the force'),
    'z of the position mirrored': (STRAIGHT, _axes('x y -z'), 'z of the position'),
}
"""Matrices of force and position, from the true axes to those that are read, and words of the
doubt."""

SCENES = (
    'hexapod_patches', 'quadruped_patches', 'hexapod_dry_slow', 'hexapod_smooth_dry_flat',
    'hexapod_smooth_wet_flat', 'hexapod_smooth_wet_dome', 'hexapod_rough_dry_flat',
    'hexapod_rough_wet_flat', 'hexapod_rough_wet_dome',
)  # fmt: skip
RAIL = ('leg_dry_flat', 'leg_wet_flat', 'leg_wet_dome_60')
FLOORS = {'tuned on': (31, 32), 'held out': (121, 122, 123)}
SENSOR_FAULTS = (
    '{kind: force_dead, legs: [2], start: 4.0}',
    '{kind: force_frozen, legs: [2], start: 4.0}',
    '{kind: force_offset, legs: [2], start: 0.0, load: 2.0}',
    '{kind: force_range, legs: [2], start: 4.0, load: 5.0}',
    '{kind: marker_frozen, legs: [2], start: 4.0}',
    '{kind: stuck_valve, legs: [2]}',
    '{kind: leak, legs: [2], start: 4.0, conductance: 1.0e-8}',
    '{kind: sensor_drift, legs: [2], start: 4.0, offset: 5000.0}',
    '{kind: silence, legs: [2], start: 4.0}',
    '{kind: supply_loss, start: 4.0}',
    '{kind: imu_silent, start: 4.0, end: 6.0}',
    '{kind: joints_silent, start: 4.0, end: 6.0}',
)


SLOPES = (-0.1, 0.1)  # rad
JOINED = 0.1  # s: a foot that lifts for less has not stepped


class Walk(NamedTuple):
    """What the estimator of a walk got, and what it doubted.

    Attributes
    ----------
    settings : tuple
        Arguments of :class:`ros_pad.estimation.stage.EstimationStage`.
    records : Records
        The samples and pressures that it got.
    touch_downs : list of list of float
        For each leg, times at which stances began after the first second, s.
    doubted : list of str
        Doubts about axes during the walk.
    """

    settings: tuple[Any, ...]
    records: Records
    touch_downs: list[list[float]]
    doubted: list[str]


@dataclass(frozen=True)
class Found:
    """How a fault was found on a scene; by foot.

    Attributes
    ----------
    scene, sensing, part, fault : str
        ``part`` is that of the floors: tuned on or held out.
    feet, within, never, named : int
        Number of feet, of those with a doubt before their fourth stance, with none, and of those
        whose doubt names the fault in the end.
    median, most : int or None
        Stances until the doubt, of feet that have one.
    """

    scene: str
    sensing: str
    part: str
    fault: str
    feet: int
    within: int
    never: int
    named: int
    median: float | None
    most: int | None


@dataclass(frozen=True)
class Honest:
    """Walks in right axes: their stances, and the doubts about axes."""

    what: str
    walks: int
    stances: int
    doubts: list[str]


def recorded(scene: Scene, policy: str, seed: int, level: str, sensing: str) -> Walk:
    """Walk once."""
    loop = ClosedLoop(scene, policy, seed, level, sensing=sensing)
    log = TrialLog(scene, policy, seed, level, sensing)
    loads = [loop.robot.contacts[:, 2].tolist() for _ in loops.samples(loop, scene, log)]
    period = loop.period_ns * 1e-9
    stands = np.array(loads) > LOADED * scene.expected_load
    tuning = tuning_for(scene, sensing)
    settings = (scene.foot, scene.expected_load, tuning, scene.legs, loop.period_ns)
    doubted = {each for row in _doubts(log.records.estimate.rows) for each in row if each}
    begins = [_begins(each, period) for each in stands.T]
    return Walk(settings, log.records, begins, sorted(doubted))


def _doubts(rows: np.ndarray) -> list[list[str]]:
    """Return the doubts about axes in each estimate, for each foot; empty if there is none."""
    texts = [
        [doubt.text(code, *detail) for code, detail in zip(codes, details, strict=True)]
        for codes, details in zip(rows['doubt'].tolist(), rows['detail'].tolist(), strict=True)
    ]
    return [[text if text.startswith('axes') else '' for text in row] for row in texts]


def _begins(stands: Flags, period: float) -> list[float]:
    return [
        begin * period
        for begin, end in runs(stands, round(JOINED / period))
        if begin * period > SETTLED and (end - begin) * period > SHORTEST
    ]


def misread(rows: np.ndarray, fault: str) -> np.ndarray:
    """Return rows of samples as they are read with a fault."""
    forces, positions = (np.transpose(each) for each in FAULTS[fault][:2])
    rows = rows.copy()
    rows['force'] = rows['force'] @ forces
    rows['position'] = rows['position'] @ positions
    rows['velocity'] = rows['velocity'] @ positions[:2, :2]
    return rows


def stances_until(walk: Walk, fault: str) -> list[tuple[int | None, bool]]:
    """Return for each foot the stances until its axes are in doubt, None if they never are.

    Beside them, whether the doubt names the fault in the end.
    """
    stamps, rows = walk.records.sample
    records = walk.records._replace(sample=Block(stamps, misread(rows, fault)))
    estimate = loops.estimated(EstimationStage(*walk.settings), records)
    found: list[tuple[int | None, bool]] = []
    of_feet = zip(*_doubts(estimate.rows), strict=True)
    for begun, doubts in zip(walk.touch_downs, of_feet, strict=True):
        times = (1e-9 * estimate.stamps[[bool(each) for each in doubts]]).tolist()
        count = sum(at <= times[0] for at in begun) if times else None
        found.append((count, FAULTS[fault][2] in doubts[-1]))
    return found


Case = tuple[str, str, str, int]


def cases(count: int | None) -> list[Case]:
    """Return scene, sensing, part of the floors and seed of each walk.

    ``count`` is the number of floors, and of scenes with markers and with joints; None for all.
    """
    plan = [(scene, 'markers') for scene in SCENES[:count]]
    plan += [(scene, 'joints') for scene in SCENES[:2][:count]]
    return [
        (scene, sensing, part, seed)
        for part, seeds in FLOORS.items()
        for scene, sensing in plan
        for seed in seeds[:count]
    ]


def search(scene: str, sensing: str, part: str, seed: int) -> dict[str, Any]:
    """Walk once, and return what :func:`stances_until` does for each fault."""
    walked = replace(Scene.load(scene), cycles=CYCLES)
    walk = recorded(walked, walked.policy, seed, full(), sensing)
    return {fault: stances_until(walk, fault) for fault in FAULTS}


def found_of(all_cases: Sequence[Case], results: Sequence[dict[str, Any]]) -> list[Found]:
    """Return the counts of all walks with the same scene, sensing and part."""
    rows = []
    for names in dict.fromkeys(case[:3] for case in all_cases):
        mine = [each for case, each in zip(all_cases, results, strict=True) if case[:3] == names]
        for fault in FAULTS:
            feet = [foot for each in mine for foot in each[fault]]
            counts = [count for count, _ in feet if count is not None]
            rows.append(
                Found(
                    *names, fault, len(feet), sum(count <= ASKED for count in counts),
                    len(feet) - len(counts), sum(named for _, named in feet),
                    float(np.median(counts)) if counts else None, max(counts, default=None),
                )
            )  # fmt: skip
    return rows


def honest_cases(count: int | None) -> list[tuple[str, str, str, float, str, int]]:
    """Return scene, level, sensing, slope, fault and seed of walks in right axes.

    With a ``count`` of floors one of eight of them, None for all.
    """
    plan = [
        (scene, level, 'markers', 0.0, '') for scene in SCENES for level in dict.fromkeys(
            ('L1', full())
        )
    ]  # fmt: skip
    plan += [(scene, 'auto', 'markers', 0.0, '') for scene in RAIL]
    for scene in SCENES[:2]:
        plan += [(scene, full(), 'markers', slope, '') for slope in SLOPES]
        plan += [(scene, full(), 'joints', slope, '') for slope in (0.0, *SLOPES)]
        plan += [
            (scene, full(), sensing, 0.0, fault)
            for fault in SENSOR_FAULTS
            for sensing in (('joints',) if 'silent,' in fault else ('markers', 'joints'))
        ]
    seeds = [seed for each in FLOORS.values() for seed in each][:count]
    found = [(*each, seed) for each in plan for seed in seeds]
    return found[::8] if count else found


def check(
    name: str, level: str, sensing: str, slope: float, fault: str, seed: int
) -> tuple[int, list[str]]:
    """Walk once in right axes; return the number of stances, and the doubts about axes."""
    scene = replace(Scene.load(name), cycles=CYCLES)
    scene = replace(
        scene,
        floor=replace(scene.floor, slope=slope or scene.floor.slope),
        faults=(Fault.parse(fault),) if fault else (),
    )
    walk = recorded(scene, scene.policy, seed, level, sensing)
    return sum(map(len, walk.touch_downs)), walk.doubted


def honest_of(
    all_cases: Sequence[tuple[Any, ...]], results: Sequence[tuple[int, list[str]]]
) -> list[Honest]:
    """Return stances and doubts by level, sensing, slope and fault."""
    rows: dict[str, list[tuple[int, list[str]]]] = {}
    for (_, level, sensing, slope, fault, _), result in zip(all_cases, results, strict=True):
        kind = Fault.parse(fault).kind if fault else ''
        of = ', '.join(filter(None, (level, sensing, f'slope {slope:g}' if slope else '', kind)))
        rows.setdefault(of, []).append(result)
    return [
        Honest(
            of,
            len(each),
            sum(n for n, _ in each),
            sorted({d for _, all_of in each for d in all_of}),
        )
        for of, each in rows.items()
    ]


def table(rows: Sequence[Found]) -> str:
    """Return a table for the docs: faults, and for each scene what was found."""
    lines = []
    for part in dict.fromkeys(row.part for row in rows):
        mine = {(row.scene, row.sensing, row.fault): row for row in rows if row.part == part}
        columns = list(dict.fromkeys((scene, sensing) for scene, sensing, _ in mine))
        heads = []
        for column in columns:
            feet = mine[(*column, next(iter(FAULTS)))].feet
            name = column[0].replace('_', ' ')
            heads.append(f'{name}{", joints" * (column[1] == "joints")} ({feet})')
        lines += [f'| fault, {part} | {" | ".join(heads)} |', '|---' * (len(heads) + 1) + '|']
        for fault in FAULTS:
            cells = [_cell(mine[(*column, fault)]) for column in columns]
            lines.append(f'| {fault} | {" | ".join(cells)} |')
        lines.append('')
    return '\n'.join(lines[:-1])


def _cell(row: Found) -> str:
    if row.never == row.feet:
        return 'never'
    never = f', never {100 * row.never / row.feet:.0f}' if row.never else ''
    return f'{100 * row.within / row.feet:.0f}, {row.most}{never}'


def honest_table(rows: Sequence[Honest]) -> str:
    """Return a line for the docs about walks in right axes."""
    walks, stances = sum(row.walks for row in rows), sum(row.stances for row in rows)
    bad = [f'{row.what}: {"; ".join(row.doubts)}' for row in rows if row.doubts]
    doubts = f'in doubt: {" | ".join(bad)}' if bad else 'never in doubt'
    return f'Right axes, {walks} walks and {stances} stances: {doubts}.'
