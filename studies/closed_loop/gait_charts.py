# SPDX-License-Identifier: Apache-2.0
"""Draw the gait with balance: a cycle beside an independent walk, steps of time, and falls.

``cycle``: the shipped go2, pushed by 10 % of its weight or not, beside a walk that was simulated
outside this project, at its frequency and mean speed. FILE of ``--walk`` is that walk; without it,
its averages are taken from docs/charts. ``steps``: the go2 on ground uneven by 5 mm, with other
steps of control and physics. ``falls``: how many walks fall, by friction or slope and by pushes of
0.2 s every 3 s in random directions; robots of ``--robots`` (see ``gaits``) are beside the go2.
"""

from __future__ import annotations

import functools
import json
import math
import pathlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import matplotlib
import numpy as np
import yaml
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from ros_pad.contact.meniscus import GRAVITY
from ros_pad.simulation import Scene
from ros_pad.simulation.full_robot import FullRobot
from ros_pad.simulation.mujoco_model import RECOMMENDED
from studies import command
from studies.closed_loop.gaits import PERIOD, scene_of, walk
from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PALE, PURPLE, SKY, STYLE, VERMILION
from studies.samples import runs

SOURCE = (
    'quad_dry.npz: a Go2-like quadruped of 15.2 kg simulated outside this project in MuJoCo with'
    ' steps of 1 ms, trot of 1.8 Hz, 0.32 m/s, turning, pushed by 6 to 12 % of its weight'
)
OTHER = 'independent, pushed'
OWN = {'go2, pushed': 0.1, 'go2': 0.0}
FREQUENCY, SPEED = 1.8, 0.32  # Hz, m/s, of that walk
START, LANDING = 2.5, 0.012  # s: walks are steady from then on; time in which a foot lands
PHASES = np.linspace(0.0, 1.0, 101)
LEGS = ('FL', 'FR', 'RL', 'RR')
BODY = {'height': (1e3, 'height less its mean, mm'), 'roll': (180.0 / math.pi, 'roll, °')}
BODY['pitch'] = (BODY['roll'][0], 'pitch, °')

CONTROLS = {1: BLUE, 2: SKY, 4: GREEN, 8: ORANGE, 12: VERMILION, 16: PURPLE}  # ms
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


def _short(numbers: Any) -> Any:
    """Return numbers with four digits."""
    if isinstance(numbers, (Sequence, np.ndarray)):
        return [_short(each) for each in numbers]
    return float(f'{numbers:.4g}')


# --- cycle ---------------------------------------------------------------------------------------


def simulated(push: float, cycles: int) -> dict[str, Any]:
    """Walk the go2 as the independent walk; return the same signals under the same names."""
    scene = _scene('go2', (), cycles)
    gait = replace(scene.legged[1], cycle=1.0 / FREQUENCY, stride=SPEED / FREQUENCY)
    scene = replace(scene, gait=gait)
    robot = FullRobot(scene, scene.floor.build(0), PERIOD)
    rows = [
        (robot.time, robot.data.qpos[:7].copy(), robot.contacts[:, :3].copy())
        for _ in walk(scene, robot, push, 0)
    ]
    when, places, forces = map(np.array, zip(*rows, strict=True))
    return {
        'time': when,
        'truth_base_pos': places[:, :3],
        'truth_base_quat_wxyz': places[:, 3:],
        'truth_force_world': forces,
        'total_mass': scene.body.mass,
    }


def averaged(name: str, part: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return figures, and mean, 5 and 95 % over cycles from touch-down to touch-down of FL."""
    when = part['time']
    steady = when > START
    a, b, c, d = part['truth_base_quat_wxyz'].T
    height = part['truth_base_pos'][:, 2]
    loads = part['truth_force_world'][:, :, 2].T / (float(part['total_mass']) * GRAVITY)
    body = {
        'height': height - height[steady].mean(),
        'roll': np.arctan2(2.0 * (a * b + c * d), 1.0 - 2.0 * (b * b + c * c)),
        'pitch': np.arcsin(2.0 * (a * c - d * b)),
    }
    landed = [
        [
            start
            for start, end in runs(load > 0.02, join=15)
            if when[start] > START < when[end - 30]
        ]
        for load in loads
    ]
    first = [load[np.add.outer(at, range(round(LANDING / PERIOD)))].max(axis=1)
             for load, at in zip(loads, landed, strict=True)]  # fmt: skip
    row = {'walk': name, 'cycles': len(landed[0]) - 1}
    row['load when landing'] = _short([np.median(each) for each in first])
    curves = {}
    for curve, values in (body | dict(zip(LEGS, loads, strict=True))).items():
        ends = zip(when[landed[0][:-1]], when[landed[0][1:]], strict=True)
        rows = [np.interp(start + PHASES * (end - start), when, values) for start, end in ends]
        mean = np.mean(rows, axis=0)
        curves[curve] = _short([mean, *np.quantile(rows, (0.05, 0.95), axis=0)])
        row[f'{curve} rms, of the mean cycle'] = _short([np.std(values[steady]), np.std(mean)])
    return row, curves


def measure_cycle(file: pathlib.Path | None, cycles: int) -> dict[str, Any]:
    """Return figures and averages of the independent walk, and of two of the go2."""
    if file:
        rows, curves = ({OTHER: each} for each in averaged(OTHER, np.load(file)))
    else:
        kept = json.loads((command.CHARTS / 'gait_cycle.json').read_text(encoding='utf-8'))
        rows, curves = {OTHER: kept['rows'][0]}, {OTHER: kept['curves'][OTHER]}
    for name in command.each([*OWN], 'walking', 'walk'):
        rows[name], curves[name] = averaged(name, simulated(OWN[name], cycles))
    return {'source': SOURCE, 'rows': [*rows.values()], 'curves': curves}


def draw_cycle(document: Mapping[str, Any]) -> Figure:
    """Return the picture of the two pushed walks."""
    figure = Figure(figsize=(9.0, 5.2), layout='constrained')
    layout = [[name for name in names for _ in range(12 // len(names))] for names in (BODY, LEGS)]
    for name, panel in figure.subplot_mosaic(layout).items():
        scale, label = BODY.get(name, (1.0, f'load of {name} over the weight'))
        for of, colour, line in ((OTHER, VERMILION, '--'), ('go2, pushed', BLUE, '-')):
            mean, low, high = scale * np.array(document['curves'][of][name])
            panel.fill_between(PHASES, low, high, color=colour, alpha=0.25, lw=0)
            panel.plot(PHASES, mean, line, color=colour, label=of)
        panel.set(title=label, xlim=(0.0, 1.0), xlabel='share of the cycle of FL')
    for panel in figure.axes[len(BODY) :]:
        panel.set_ylim(0.0, 1.05)
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
        'cost': (time.process_time() - begun) / robot.time,
        'fell': robot.verdict is not None,
        'behind': want - robot.body[0],
        'slip': sum(foot.slip_path for foot in robot.feet) / (len(LEGS) * gait.duty * want),
        'path': np.array(path[48 // control - 1 :: 48 // control]),
    }


def measure_steps(seeds: int, cycles: int, processes: int) -> dict[str, Any]:
    """Return the medians for each setting; the reference of a floor has the shortest steps."""
    settings = [(control, step) for control in CONTROLS for step in PHYSICS if step <= control]
    cases = [(*each, seed, cycles) for each in settings for seed in range(seeds)]
    walks = command.in_processes(stepped, cases, processes, 'walking with other steps')
    rows = []
    for place, (control, physics) in enumerate(settings):
        mine = walks[place * seeds : (place + 1) * seeds]
        row = {'control': 1e-3 * control, 'physics': 1e-3 * physics, 'walks': seeds}
        row['falls'] = sum(each['fell'] for each in mine)
        for each, finest in zip(mine, walks[:seeds], strict=True):
            off = each['path'] - finest['path'][: len(each['path'])]
            each['height'] = float(np.sqrt(np.mean(off[:, 2] ** 2)))
            each['place'] = float(np.sqrt(np.mean(off[:, 0] ** 2 + off[:, 1] ** 2)))
        names = ['cost'] if row['falls'] else ['cost', *ERRORS]
        rows.append(row | {key: _short(np.median([each[key] for each in mine])) for key in names})
    return {'rows': rows}


def draw_steps(document: Mapping[str, Any]) -> Figure:
    """Return the picture: time against errors, a line for each step of control."""
    figure = Figure(figsize=(9.0, 6.0), layout='constrained')
    shipped = PERIOD, RECOMMENDED.timestep
    panels = zip(figure.subplots(2, 2).ravel(), ERRORS.items(), strict=True)
    for panel, (name, (scale, title)) in panels:
        for (control, colour), marker in zip(CONTROLS.items(), 'os^DPX', strict=True):
            rows = [row for row in document['rows'] if row['control'] == 1e-3 * control]
            fell, count = (sum(row[key] for row in rows) for key in ('falls', 'walks'))
            label = f'{control} ms' + f': falls {fell} times of {count}' * bool(fell)
            x = [1e3 * row['cost'] for row in rows]
            y = [scale * row.get(name, math.nan) for row in rows]
            panel.plot(x, y, marker=marker, color=colour, lw=1.0, mec='white', label=label)
            for row, *at in zip(rows, x, y, strict=True):
                if (row['control'], row['physics']) == shipped:
                    panel.plot(*at, 'o', ms=14, mfc='none', mec=BLACK)
        panel.set(title=title, xscale='log', xlabel='processor time of a simulated second, ms')
        panel.set_ylim(bottom=0.0)
        panel.xaxis.set_major_formatter('{x:g}')
        panel.grid(color=PALE, alpha=0.25, lw=0.5)
    title = 'Step of control; on its line, from the right, steps of physics from 0.25 ms; ring: shipped'
    handles = figure.axes[0].get_legend_handles_labels()
    figure.legend(*handles, loc='outside upper center', ncols=3, title=title)
    return figure


# --- falls ---------------------------------------------------------------------------------------


def fell(
    robot: tuple[str, ...], kind: str, value: float, push: float, seed: int, cycles: int
) -> bool:
    """Walk with a friction or on a slope; return whether the walk ended with a verdict."""
    scene = _scene(robot[0], robot[1:], cycles)
    friction, slope = (0.8, math.radians(value)) if kind == 'slope' else (value, 0.0)
    foot = replace(scene.foot, friction=friction, shear_strength=0.0)
    scene = replace(scene, foot=foot, floor=replace(scene.floor, slope=slope))
    walker = FullRobot(scene, scene.floor.build(seed), PERIOD)
    for _ in walk(scene, walker, push, seed):
        pass
    return walker.verdict is not None


def measure_falls(
    robots: Mapping[str, tuple[str, ...]], seeds: int, cycles: int, processes: int
) -> dict[str, Any]:
    """Return how many walks fell."""
    lines = [(name, kind, push) for name in robots for kind in MAPS for push in PUSHES]
    cases = [
        (robots[name], kind, value, push, seed, cycles)
        for name, kind, push in lines
        for value in MAPS[kind][1]
        for seed in range(seeds)
    ]
    found = iter(command.in_processes(fell, cases, processes, 'walking'))
    rows = [
        {'robot': name, 'map': kind, 'push': push, 'walks': seeds}
        | {'falls': {f'{x:g}': sum(next(found) for _ in range(seeds)) for x in MAPS[kind][1]}}
        for name, kind, push in lines
    ]
    return {'cycles': cycles, 'rows': rows}


def draw_falls(document: Mapping[str, Any]) -> Figure:
    """Return the maps, a row for each robot."""
    names = list(dict.fromkeys(row['robot'] for row in document['rows']))
    figure = Figure(figsize=(9.0, 0.4 + 3.0 * len(names)), layout='constrained')
    colours = LinearSegmentedColormap.from_list('falls', ['white', VERMILION])
    places = [(name, kind) for name in names for kind in MAPS]
    for panel, place in zip(figure.subplots(len(names), 2).ravel(), places, strict=True):
        rows = [row for row in document['rows'] if (row['robot'], row['map']) == place]
        falls = np.array([list(row['falls'].values()) for row in rows])
        panel.imshow(falls, colours, vmin=0, vmax=rows[0]['walks'], origin='lower', aspect='auto')
        for (y, x), count in np.ndenumerate(falls):
            panel.text(x, y, count or '·', ha='center', va='center')
        panel.set_xticks(range(falls.shape[1]), rows[0]['falls'])
        panel.set_yticks(range(len(rows)), [f'{100 * row["push"]:g} %' for row in rows])
        panel.set(title=place[0], xlabel=MAPS[place[1]][0], ylabel='push over weight')
    figure.suptitle(f'Falls of {rows[0]["walks"]} walks, {document["cycles"]} cycles long')
    return figure


def main(words: Sequence[str] | None = None) -> int:
    """Run the study; return the exit status."""
    part = command.parser('gait_charts', __doc__)
    names = ('cycle', 'steps', 'falls')
    part.add_argument('--parts', nargs='+', choices=names, default=names, metavar='PART')
    part.add_argument('--walk', type=pathlib.Path, metavar='FILE', help='independent walk, .npz')
    part.add_argument('--robots', type=pathlib.Path, metavar='FILE', help='robots beside the go2')
    command.add_count(part, '--cycles', 20, 'gait cycles of a walk', least=6)
    command.add_count(part, '--seeds', 10, 'walks of each setting')
    command.add_processes(part)
    command.add_out(part)
    args = part.parse_args(words)
    robots = {'shipped go2': ('go2',)}
    if args.robots:
        for name, (urdf, *feet) in yaml.safe_load(args.robots.read_text()).items():
            robots[name] = (str(args.robots.parent / urdf), *feet)
    many = args.seeds, args.cycles, args.processes
    measures = {
        'cycle': (lambda: measure_cycle(args.walk, 3 * args.cycles), draw_cycle),
        'steps': (lambda: measure_steps(*many), draw_steps),
        'falls': (lambda: measure_falls(robots, *many), draw_falls),
    }
    for name in args.parts:
        measure, draw = measures[name]
        document = measure()
        with matplotlib.rc_context(STYLE):
            pictures = {f'gait_{name}': draw(document)}
            kept = command.write(args.out, f'gait_{name}', document, pictures)
        command.show(args, kept, command.listed(document['rows'], name))
    return 0
