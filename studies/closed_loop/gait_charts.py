# SPDX-License-Identifier: Apache-2.0
"""Draw the gait with balance: a cycle beside an independent walk, steps of time, and falls.

``cycle``: the shipped go2, pushed by 10 % of its weight or not, beside a walk that was simulated
outside this project, at its frequency and mean speed. FILE of ``--walk`` is that walk; without it,
its averages are taken from docs/charts. ``steps``: the go2 on ground uneven by 5 mm, with other
steps of control and physics. ``falls``: how many walks fall, by friction or slope and by pushes of
0.2 s every 3 s in random directions; robots of ``--robots`` (see ``gaits``) are beside the go2.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import json
import math
import pathlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ros_pad.contact.meniscus import GRAVITY
from ros_pad.simulation import Scene
from ros_pad.simulation.full_robot import FullRobot
from ros_pad.simulation.mujoco_model import LONGEST, RECOMMENDED
from studies import command
from studies.closed_loop.gaits import PERIOD, robots_of, scene_of, walk
from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, STYLE, VERMILION
from studies.samples import runs

SOURCE = 'quad_dry.npz: a Go2-like quadruped simulated outside this project in MuJoCo'
OTHER = 'independent, pushed'
OWN = {'go2, pushed': 0.1, 'go2': 0.0}
FREQUENCY, SPEED = 1.8, 0.32  # Hz, m/s, of that walk
START = 2.5  # s: walks are steady from then on
PHASES = np.linspace(-0.05, 0.95, 101)
LEGS = ('FL', 'FR', 'RL', 'RR')
BODY = {'height': (1e3, 'height less its mean, mm'), 'roll': (180.0 / math.pi, 'roll, °')}
BODY['pitch'] = (BODY['roll'][0], 'pitch, °')

CONTROLS = dict(zip((1, 2, 4, 8, 12, 16), 'os^DPX', strict=True))  # ms, and marker of each
COLOURS = dict(zip(CONTROLS, (BLUE, SKY, GREEN, ORANGE, VERMILION, PURPLE), strict=True))
PHYSICS = (0.25, 0.5, 1.0, 2.0, 4.0)  # ms
ERRORS = {
    'behind': (1e3, 'behind the goal at the end, mm'),
    'slip': (100.0, 'slip of the stance path, %'),
    'height': (1e3, 'height: rms off the shortest steps, mm'),
    'place': (1e3, 'place: rms off the shortest steps, mm'),
}
PUSHES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
MAPS: dict[str, tuple[str, tuple[float, ...]]] = {
    'friction': ('friction, on level ground', (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8)),
    'slope': ('slope, °, at friction 0.8', (-25, -20, -15, -10, 0, 10, 15, 20, 25)),
}


@functools.cache
def _scene(urdf: str, feet: tuple[str, ...], cycles: int) -> Scene:
    scene = scene_of(urdf, feet, 'dry', cycles)
    # Only a long walk loads the compiled controller; short ones would run in plain Python.
    FullRobot(replace(scene, cycles=100_000), scene.floor.build(0), PERIOD)
    return scene


# --- cycle ---------------------------------------------------------------------------------------


def simulated(push: float, cycles: int) -> dict[str, Any]:
    """Walk the go2 as the independent walk; return the same signals under the same names."""
    scene = _scene('go2', (), cycles)
    gait = replace(scene.legged[1], cycle=1.0 / FREQUENCY, stride=SPEED / FREQUENCY)
    scene = replace(scene, gait=gait)
    robot = FullRobot(scene, scene.floor.build(0), PERIOD)
    now = robot.data.qpos, robot.soles.contacts
    rows = [(robot.time, *map(np.copy, now)) for _ in walk(scene, robot, push, 0)]
    when, places, loads = map(np.array, zip(*rows, strict=True))
    return {
        'time': when, 'truth_base_pos': places, 'truth_base_quat_wxyz': places[:, 3:7],
        'truth_force_world': loads, 'total_mass': scene.body.mass,
    }  # fmt: skip


def averaged(name: str, part: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return figures, and mean, 5 and 95 % over cycles from touch-down to touch-down of FL."""
    when = part['time']
    steady = when > START
    a, b, c, d = part['truth_base_quat_wxyz'].T
    height = part['truth_base_pos'][:, 2]
    loads = part['truth_force_world'][:, :, 2].T / (float(part['total_mass']) * GRAVITY)
    series = {
        'height': height - height[steady].mean(),
        'roll': np.arctan2(2.0 * (a * b + c * d), 1.0 - 2.0 * (b * b + c * c)),
        'pitch': np.arcsin(2.0 * (a * c - d * b)),
        **dict(zip(LEGS, loads, strict=True)),
    }
    row: dict[str, Any] = {'walk': name, 'load in the first 12 ms': []}
    landed = []
    for load in loads:
        stances = [span for span in runs(load > 0.02, join=15) if span[1] - span[0] > 30]
        landed.append([start for start, _ in stances if steady[start]])
        first = np.median([load[start : start + 3].max() for start in landed[-1]])
        row['load in the first 12 ms'].append(round(float(first), 4))
    cycles = list(itertools.pairwise(when[landed[0]]))
    row['cycles'], curves = len(cycles), {}
    for curve, values in series.items():
        rows = [np.interp(a + PHASES * (b - a), when, values) for a, b in cycles]
        mean = np.mean(rows, axis=0)
        curves[curve] = np.round([mean, *np.quantile(rows, (0.05, 0.95), axis=0)], 6).tolist()
        row[f'{curve} rms, of mean'] = np.round([values[steady].std(), mean.std()], 6).tolist()
    return row, curves


def measure_cycle(args: argparse.Namespace) -> dict[str, Any]:
    """Return figures and averages of the independent walk, and of two of the go2."""
    if args.walk:
        rows, curves = ({OTHER: each} for each in averaged(OTHER, np.load(args.walk)))
    else:
        kept = json.loads((command.CHARTS / 'gait_cycle.json').read_text(encoding='utf-8'))
        rows, curves = {OTHER: kept['rows'][0]}, {OTHER: kept['curves'][OTHER]}
    for name in command.each([*OWN], 'walking', 'walk'):
        rows[name], curves[name] = averaged(name, simulated(OWN[name], 3 * args.cycles))
    return {'source': SOURCE, 'rows': [*rows.values()], 'curves': curves}


def draw_cycle(document: Mapping[str, Any]) -> Figure:
    """Return the picture of the two pushed walks."""
    figure = Figure(figsize=(9.0, 5.2), layout='constrained')
    panels = figure.subplot_mosaic('aaaabbbbcccc;dddeeefffggg').values()
    for name, panel in zip((*BODY, *LEGS), panels, strict=True):
        scale, label = BODY.get(name, (1.0, f'load of {name} over the weight'))
        for of, colour, line in ((OTHER, VERMILION, '--'), ('go2, pushed', BLUE, '-')):
            mean, low, high = scale * np.array(document['curves'][of][name])
            panel.fill_between(PHASES, low, high, color=colour, alpha=0.25, lw=0)
            panel.plot(PHASES, mean, line, color=colour, label=of)
        panel.set(title=label, xlim=PHASES[[0, -1]], xlabel='cycles since FL landed')
        panel.set_ylim(*((0.0, 1.05) if name in LEGS else panel.get_ylim()))
    title = 'Mean, and 5 to 95 % of the cycles'
    handles = figure.axes[0].get_legend_handles_labels()
    figure.legend(*handles, loc='outside upper center', ncols=2, title=title)
    return figure


# --- steps ---------------------------------------------------------------------------------------


def stepped(control: int, physics: float, seed: int, cycles: int) -> dict[str, Any]:
    """Walk with steps of so many ms; return figures, and the path, each 48 ms."""
    scene = _scene('go2', (), cycles)
    scene = replace(scene, floor=replace(scene.floor, unevenness=5e-3))
    settings = replace(RECOMMENDED, timestep=1e-3 * physics)
    robot = FullRobot(scene, scene.floor.build(seed), 1e-3 * control, settings)
    begun = time.process_time()
    path = [robot.data.qpos[:3].copy() for _ in walk(scene, robot, 0.0, seed)]
    gait = scene.legged[1]
    want = gait.body_advance(cycles * gait.cycle)
    return {
        'cost': (time.process_time() - begun) / robot.time, 'fell': robot.verdict is not None,
        'slip': sum(foot.slip_path for foot in robot.feet) / (len(LEGS) * gait.duty * want),
        'behind': want - robot.body[0], 'path': np.array(path[48 // control - 1 :: 48 // control]),
    }  # fmt: skip


def measure_steps(args: argparse.Namespace) -> dict[str, Any]:
    """Return the medians for each setting; the reference of a floor has the shortest steps."""
    settings = [(control, step) for control in CONTROLS for step in PHYSICS if step <= control]
    seeds = args.seeds
    cases = [(*each, seed, args.cycles) for each in settings for seed in range(seeds)]
    walks = command.in_processes(stepped, cases, args.processes, 'walking with other steps')
    rows = []
    for place, (control, physics) in enumerate(settings):
        mine = walks[place * seeds : (place + 1) * seeds]
        falls = sum(each['fell'] for each in mine)
        row = {'control_ms': control, 'physics_ms': physics, 'walks': seeds, 'falls': falls}
        for each, finest in zip(mine, walks[:seeds], strict=True):
            off = each['path'] - finest['path'][: len(each['path'])]
            each['place'] = np.sqrt(np.mean(np.sum(off[:, :2] ** 2, axis=1)))
            each['height'] = np.sqrt(np.mean(off[:, 2] ** 2))
        names = ['cost'] if falls else ['cost', *ERRORS]
        medians = np.round([np.median([each[key] for each in mine]) for key in names], 6)
        rows.append(row | dict(zip(names, medians.tolist(), strict=True)))
    return {'rows': rows}


def draw_steps(document: Mapping[str, Any]) -> Figure:
    """Return the picture: time against errors, a line for each step of control."""
    figure = Figure(figsize=(9.0, 6.0), layout='constrained')
    at = {(row['control_ms'], row['physics_ms']): row for row in document['rows']}
    shipped = at[1e3 * PERIOD, 1e3 * LONGEST]
    panels = zip(figure.subplots(2, 2).ravel(), ERRORS.items(), strict=True)
    for panel, (name, (scale, title)) in panels:
        for control, marker in CONTROLS.items():
            rows = [row for row in document['rows'] if row['control_ms'] == control]
            falls, count = (sum(row[key] for row in rows) for key in ('falls', 'walks'))
            label = f'{control} ms' + f': falls {falls} times of {count}' * bool(falls)
            x = [1e3 * row['cost'] for row in rows]
            y = [scale * row.get(name, math.nan) for row in rows]
            panel.plot(x, y, f'{marker}-', color=COLOURS[control], lw=1.0, label=label)
        ring = 1e3 * shipped['cost'], scale * shipped[name]
        panel.plot(*ring, 'o', ms=14, mfc='none', mec=BLACK)
        panel.set(title=title, xscale='log', xlabel='processor time of a simulated second, ms')
        panel.set_ylim(bottom=0.0)
        panel.set_xticks((10, 20, 50, 100), ('10', '20', '50', '100'))
    title = 'Step of control; on its line steps of physics, the right end 0.25 ms; ring: shipped'
    handles = figure.axes[0].get_legend_handles_labels()
    figure.legend(*handles, loc='outside upper center', ncols=3, title=title)
    return figure


# --- falls ---------------------------------------------------------------------------------------


def fell(robot: Sequence[str], kind: str, at: float, push: float, seed: int, cycles: int) -> bool:
    """Walk with a friction or on a slope; return whether the walk ended with a verdict."""
    scene = _scene(robot[0], tuple(robot[1:]), cycles)
    friction, slope = (0.8, math.radians(at)) if kind == 'slope' else (at, 0.0)
    foot = replace(scene.foot, friction=friction, shear_strength=0.0)
    scene = replace(scene, foot=foot, floor=replace(scene.floor, slope=slope))
    walker = FullRobot(scene, scene.floor.build(seed), PERIOD)
    list(walk(scene, walker, push, seed))
    return walker.verdict is not None


def measure_falls(args: argparse.Namespace) -> dict[str, Any]:
    """Return how many walks fell."""
    robots, seeds = robots_of(args.robots), args.seeds
    lines = [(name, kind, push) for name in robots for kind in MAPS for push in PUSHES]
    cases = [
        (robots[name], kind, value, push, seed, args.cycles)
        for name, kind, push in lines
        for value in MAPS[kind][1]
        for seed in range(seeds)
    ]
    found = iter(command.in_processes(fell, cases, args.processes, 'walking'))
    rows = [
        {'robot': name, 'map': kind, 'push': push, 'walks': seeds}
        | {'falls': {f'{x:g}': sum(next(found) for _ in range(seeds)) for x in MAPS[kind][1]}}
        for name, kind, push in lines
    ]
    return {'cycles': args.cycles, 'rows': rows}


def draw_falls(document: Mapping[str, Any]) -> Figure:
    """Return the maps, a row for each robot."""
    names = list(dict.fromkeys(row['robot'] for row in document['rows']))
    most = document['rows'][0]['walks']
    figure = Figure(figsize=(9.0, 0.4 + 3.0 * len(names)), layout='constrained')
    places = [(name, kind) for name in names for kind in MAPS]
    for panel, place in zip(figure.subplots(len(names), 2).ravel(), places, strict=True):
        rows = [row for row in document['rows'] if (row['robot'], row['map']) == place]
        falls = np.array([list(row['falls'].values()) for row in rows])
        panel.imshow(falls, 'Oranges', vmin=0, vmax=1.7 * most, origin='lower', aspect='auto')
        for (y, x), count in np.ndenumerate(falls):
            panel.text(x, y, count or '·', ha='center', va='center')
        panel.set_xticks(range(falls.shape[1]), rows[0]['falls'])
        panel.set_yticks(range(len(rows)), [f'{100 * row["push"]:g} %' for row in rows])
        panel.set(title=place[0], xlabel=MAPS[place[1]][0], ylabel='push over weight')
    figure.suptitle(f'Falls of {most} walks of {document["cycles"]} cycles')
    return figure


PARTS = {
    'cycle': (measure_cycle, draw_cycle),
    'steps': (measure_steps, draw_steps),
    'falls': (measure_falls, draw_falls),
}


def main(words: Sequence[str] | None = None) -> int:
    """Run the study; return the exit status."""
    part = command.parser('gait_charts', __doc__)
    part.add_argument('--parts', nargs='+', choices=PARTS, default=[*PARTS], metavar='PART')
    part.add_argument('--walk', type=pathlib.Path, metavar='FILE', help='independent walk, .npz')
    part.add_argument('--robots', type=pathlib.Path, metavar='FILE', help='robots beside the go2')
    command.add_count(part, '--cycles', 20, 'gait cycles of a walk; of a cycle thrice as many')
    command.add_count(part, '--seeds', 10, 'walks of each setting')
    command.add_processes(part)
    command.add_out(part)
    args = part.parse_args(words)
    for name in args.parts:
        measure, draw = PARTS[name]
        document = measure(args)
        with matplotlib.rc_context(STYLE):
            pictures = {f'gait_{name}': draw(document)}
            kept = command.write(args.out, f'gait_{name}', document, pictures)
        command.show(args, kept, command.listed(document['rows'], name))
    return 0
