# SPDX-License-Identifier: Apache-2.0
"""The ladder of estimators: how soon slip is heard, what for, and what spoils it.

A hexapod walks once, closed loop, over floors with wet patches and the thesis' wet and dry ones;
what its sensors read is kept with the truth. Each method is then given the same readings.

Truth is the motion of the contact over the floor. A *slip* is a stretch of it above 5 mm/s under
more than 0.15 of the expected load, with gaps below 20 ms; those longer than 3 mm count. One is
*missed* when no alarm is on before 60 ms after its end. A *stick* is where the contact goes less
than 0.5 mm from 0.3 s before to 60 ms after; an alarm that comes on there, or lasts on into it, is
*false*. Feet on dry ground scrub all the time on the full dynamics, so that sticks are also those
of walks in the plane, and of feet that stand and are pulled to and fro.

Without MuJoCo all walks are those in the plane.
"""

from __future__ import annotations

import bisect
import functools
import importlib.util
import math
import statistics
import time
from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace
from typing import Any
from typing import Protocol
from typing import TypedDict

import numpy as np
from matplotlib.figure import Figure

from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation.alarm import SlipAlarm
from ros_pad.estimation.foot import FootEstimator
from ros_pad.estimation.foot import Tuning
from ros_pad.estimation.friction import FrictionPrior
from ros_pad.ladders.ladder import Progress
from ros_pad.simulation.robot import Vector
from ros_pad.simulation.scene import HexapodBody
from ros_pad.simulation.scene import Scene
from ros_pad.trials.loop import ClosedLoop
from ros_pad.trials.loop import tuning_for

Floats = np.ndarray[Any, np.dtype[np.float64]]
Flags = np.ndarray[Any, np.dtype[np.bool_]]

CYCLES = 15
SEEDS = (101, 102)  # the defaults of the estimator were chosen on others
FEW_CYCLES = 10
SETTLED = 1.0  # s: the robot only stands before
MOVING = 5e-3  # m/s
LOADED = 0.15  # of the expected load
BRIDGED = 0.02  # s
COUNTS = 3e-3  # m
LATE = 0.06  # s
BEFORE = 0.3  # s
STILL = 5e-4  # m
STANCE = 0.1  # s: shorter ones are not asked whether they were wet


class Targets(TypedDict):
    """What is asked of a :class:`Row`: at most; ``wet_right`` at least, ``coverage`` between."""

    misses: float
    false_per_minute: float
    wet_right: float
    coverage: tuple[float, float]
    us_per_update: float


TARGETS: Targets = {
    'misses': 0.01,
    'false_per_minute': 1.0,
    'wet_right': 0.97,
    'coverage': (0.90, 0.99),
    'us_per_update': 20.0,
}


# --- walks, recorded once ------------------------------------------------------------------------


@dataclass(frozen=True)
class Recording:
    """What the sensors of a walk read, and the truth; arrays have a row for each sample.

    Attributes
    ----------
    name : str
    period : float
        Of the sensors, s.
    foot : Foot
        As it is; :attr:`told` is what an estimator is told.
    expected_load : float
        N.
    told : tuple
        Arguments of :class:`FootEstimator`: foot, expected load, tuning.
    stamps : array
        Times that the samples bear, s.
    force, position : array, (samples, legs, 3)
        As read, N and m.
    noise : array, (samples, legs, 3)
        That of the position, m, which is already in it.
    pressure : array, (samples, legs)
        As reported last, Pa.
    arrived : array of bool, (samples, legs)
        Whether the estimator gets the sample.
    load, tangential, grip, speed : array, (samples, legs)
        Truth: normal and tangential force and what the foot could hold, N, and speed of the
        contact, m/s.
    wet : array of bool, (samples, legs)
    sticks_only : bool
        Whether only false alarms are counted.
    """

    name: str
    period: float
    foot: Foot
    expected_load: float
    told: tuple[Foot, float, Tuning]
    stamps: Floats
    force: Floats
    position: Floats
    noise: Floats
    pressure: Floats
    arrived: Flags
    load: Floats
    tangential: Floats
    grip: Floats
    speed: Floats
    wet: Flags
    sticks_only: bool = False

    @functools.cached_property
    def rows(self) -> list[list[list[float]]]:
        """For each leg its readings: force, position, pressure, as an estimator takes them."""
        table = np.concatenate([self.force, self.position, self.pressure[..., None]], axis=2)
        return np.swapaxes(table, 0, 1).tolist()


class _Ears:
    """Stand between loop and sensors, and keep what is read."""

    def __init__(self, loop: ClosedLoop) -> None:
        self._sensors = loop.sensors
        self.readings: list[tuple[Vector, Vector]] = []

    def read(self, robot: Any) -> list[tuple[Vector, Vector]]:
        self.readings = self._sensors.read(robot)
        return self.readings

    def read_moments(self, robot: Any) -> list[float | None]:
        return self._sensors.read_moments(robot)


class _NoLog:
    """Takes what a trial would log."""

    def sample(self, *_: Any) -> None:
        pass

    def control(self, *_: Any) -> None:
        pass


def record(scene: Scene, policy: str, seed: int, rung: str) -> Recording:
    """Walk once, closed loop, and keep readings and truth; a walk that fails ends there."""
    loop = ClosedLoop(scene, policy, seed, rung)
    ears = _Ears(loop)
    loop.sensors = ears  # type: ignore[assignment]
    log: Any = _NoLog()
    read, true = [], []
    for _ in range(round(scene.duration * 1e9) // loop.period_ns):
        pressures = list(loop.pressures)
        loop.tick(log)
        if loop.robot.verdict:
            break
        read.append([(*f, *p, q) for (f, p), q in zip(ears.readings, pressures, strict=True)])
        true.append(
            [(*foot.position, *foot.force, foot.grip, foot.slip_speed, foot.wet)
             for foot in loop.robot.feet]
        )  # fmt: skip
    loop.close()
    taken, truth = np.array(read), np.array(true, dtype=np.float64)
    return Recording(
        name=f'{scene.name}, {policy}, {seed}, {rung}',
        period=loop.period_ns * 1e-9,
        foot=scene.foot,
        expected_load=scene.expected_load,
        told=(scene.foot, scene.expected_load, tuning_for(scene)),
        stamps=loop.period_ns * 1e-9 * np.arange(1, len(taken) + 1, dtype=np.float64),
        force=taken[..., :3],
        position=taken[..., 3:6],
        noise=taken[..., 3:6] - truth[..., :3],
        pressure=taken[..., 6],
        arrived=np.ones(taken.shape[:2], dtype=bool),
        load=truth[..., 5],
        tangential=np.hypot(truth[..., 3], truth[..., 4]),
        grip=truth[..., 6],
        speed=truth[..., 7],
        wet=truth[..., 8] > 0.5,
        sticks_only=rung == 'L1' and scene.floor.kind == 'dry',
    )


def pull(scene: Scene, duration: float, seed: int) -> Recording:
    """Return six feet that stand, flat and dry, and are pulled to and fro without slip.

    They are pulled at up to 0.2 to 0.6 of their friction, every 0.3 to 1.2 s.
    """
    period, load, foot = 1.0 / scene.sensors.rate, scene.expected_load, scene.foot
    generator = np.random.default_rng([seed, 5])
    stamps = period * np.arange(1, round(duration / period) + 1, dtype=np.float64)
    friction = FrictionPrior.of(foot, load).flat_dry
    amplitude, cycle = friction * np.linspace(0.2, 0.6, 6), np.linspace(1.2, 0.3, 6)
    shape = (len(stamps), 6, 3)
    force, position = np.zeros(shape), np.zeros(shape)
    force[..., 0] = load * amplitude * np.sin(2.0 * math.pi * stamps[:, None] / cycle)
    force[..., 2] = load
    position[..., 0] = -force[..., 0] / foot.shear_stiffness
    noise = scene.sensors.position * generator.normal(size=shape)
    tangential = abs(force[..., 0])
    ones = np.ones(shape[:2])
    return Recording(
        name='pulled to and fro',
        period=period,
        foot=foot,
        expected_load=load,
        told=(foot, load, tuning_for(scene)),
        stamps=stamps,
        force=force + scene.sensors.force * generator.normal(size=shape),
        position=position + noise,
        noise=noise,
        pressure=0.0 * ones,
        arrived=ones > 0.0,
        load=load * ones,
        tangential=tangential,
        grip=friction * load * ones,
        speed=0.0 * ones,
        wet=ones < 0.0,
        sticks_only=True,
    )


def full() -> str:
    """Return the rung that walks are recorded on: the full dynamics where MuJoCo is there."""
    return 'L2' if importlib.util.find_spec('mujoco') else 'L1'


World = Callable[[Scene], Scene]


def recordings(world: World | None = None, rung: str | None = None) -> list[Recording]:
    """Return the walks that methods are compared on; ``world`` changes their scenes."""
    walks = [('patches', policy) for policy in ('flat', 'dome', 'adaptive')]
    thesis = [(f'smooth_{name}', name[4:]) for name in ('dry_flat', 'wet_flat', 'wet_dome')]
    plan = [(name, policy, seed) for name, policy in walks for seed in SEEDS]
    plan += [(name, policy, SEEDS[0]) for name, policy in thesis]
    return _record_all(plan, world, rung or full(), CYCLES)


def few_recordings(world: World | None = None, rung: str | None = None) -> list[Recording]:
    """Return the walks that the estimator is tried on under many conditions."""
    plan = [('patches', 'flat', SEEDS[0]), ('patches', 'dome', SEEDS[1])]
    plan += [('patches', 'adaptive', seed) for seed in SEEDS]
    return _record_all(plan, world, rung or full(), FEW_CYCLES)


def _record_all(
    plan: Sequence[tuple[str, str, int]], world: World | None, rung: str, cycles: int
) -> list[Recording]:
    change = world or (lambda scene: scene)

    def scene_of(name: str) -> Scene:
        return change(replace(Scene.load(f'hexapod_{name}'), cycles=cycles))

    walks = [record(scene_of(name), policy, seed, rung) for name, policy, seed in plan]
    dry = scene_of('smooth_dry_flat')
    return [*walks, record(dry, 'flat', SEEDS[0], 'L1'), pull(dry, 2.0 * cycles, SEEDS[0])]


# --- what an estimator says ----------------------------------------------------------------------


@dataclass(frozen=True)
class Said:
    """What an estimator said of a recording; arrays (samples, legs), the last value held.

    Attributes
    ----------
    slipping, standing, fresh : array of bool
    wet, mean, sd, margin, speed : array
        P(wet), friction and its standard deviation, margin, slip speed in m/s.
    seconds, updates : float, int
        Time that it took, and for how many samples.
    """

    slipping: Flags
    standing: Flags
    fresh: Flags
    wet: Floats
    mean: Floats
    sd: Floats
    margin: Floats
    speed: Floats
    seconds: float
    updates: int


def replay(walk: Recording) -> Said:
    """Give the readings of each leg to an estimator; what it refuses changes nothing."""
    shape = walk.load.shape
    out = np.empty((*shape, 8))
    seconds, updates = 0.0, 0
    stamps, rows, arrived = walk.stamps.tolist(), walk.rows, walk.arrived.tolist()
    for leg in range(shape[1]):
        estimator = FootEstimator(*walk.told)
        said, mine = [], rows[leg]
        start = time.perf_counter()
        for sample, stamp in enumerate(stamps):
            new = arrived[sample][leg]
            if new:
                row = mine[sample]
                try:
                    estimator.update(stamp, row[:3], row[3:6], row[6])
                except InvalidInput:
                    new = False
            now = estimator.estimate
            said.append(
                (now.slipping, now.standing, new and now.fresh, now.wet_probability,
                 now.friction_mean, now.friction_sd, now.margin, now.slip_speed)
            )  # fmt: skip
        seconds += time.perf_counter() - start
        updates += sum(each[leg] for each in arrived)
        out[:, leg] = said
    return Said(
        slipping=out[..., 0] > 0.5,
        standing=out[..., 1] > 0.5,
        fresh=out[..., 2] > 0.5,
        wet=out[..., 3],
        mean=out[..., 4],
        sd=out[..., 5],
        margin=out[..., 6],
        speed=out[..., 7],
        seconds=seconds,
        updates=updates,
    )


# --- the judge -----------------------------------------------------------------------------------


@dataclass
class Tally:
    """What was counted; tallies of several walks add up.

    Attributes
    ----------
    slips, missed : int
    delays, ways : list of float
        For each slip that did not begin in an alarm, how long, s, and how far, m, it went before
        there was one; infinite if missed.
    false_alarms : int
    stick_time : float
        s.
    wet_ends : list of tuple
        For each flat stance, whether it was wet, and P(wet) at its end.
    covered, below : dict of list of array
        By ground and shape (``dry``, ``wet``, ``dome``), whether the true friction was within 2
        sigma, and the true margin below what is said to be its 5 % quantile.
    """

    slips: int = 0
    missed: int = 0
    delays: list[float] = field(default_factory=list)
    ways: list[float] = field(default_factory=list)
    false_alarms: int = 0
    stick_time: float = 0.0
    wet_ends: list[tuple[bool, float]] = field(default_factory=list)
    covered: dict[str, list[Flags]] = field(default_factory=dict)
    below: dict[str, list[Flags]] = field(default_factory=dict)


def slips(speed: Floats, load: Floats, period: float, gate: float) -> Iterator[tuple[int, int]]:
    """Yield first and last sample of each stretch of motion under load, of any length."""
    moving = (speed > MOVING) & (load > gate)
    unloaded = np.concatenate([[0], np.cumsum(load <= gate)])
    found = np.flatnonzero(moving)
    if not len(found):
        return
    # Split where the gap is too long, or the foot was unloaded in it.
    gaps = np.diff(found)
    lifted = unloaded[found[1:]] > unloaded[found[:-1]]
    cut = (gaps > round(BRIDGED / period)) | lifted
    starts = found[np.concatenate([[True], cut])]
    ends = found[np.concatenate([cut, [True]])]
    yield from zip(starts.tolist(), ends.tolist(), strict=True)


def hear(tally: Tally, walk: Recording, alarms: Flags) -> None:
    """Count delays, misses and false alarms of what was on when, (samples, legs)."""
    period, count = walk.period, len(walk.stamps)
    gate = LOADED * walk.expected_load
    settled, late, before = (round(span / period) for span in (SETTLED, LATE, BEFORE))
    sample = np.arange(count)
    for leg in range(alarms.shape[1]):
        on, load, speed = alarms[:, leg], walk.load[:, leg], walk.speed[:, leg]
        way = np.concatenate([[0.0], np.cumsum(speed) * period])
        lasts = np.minimum(count, sample + late + 1)
        stick = way[lasts] - way[np.maximum(0, sample - before)] < STILL
        stick &= (load > gate) & (sample >= settled)
        tally.stick_time += float(stick.sum()) * period
        false = on & stick
        tally.false_alarms += int((false[1:] & ~false[:-1]).sum())
        if walk.sticks_only:
            continue
        heard_at = np.flatnonzero(on).tolist()
        for first, last in slips(speed, load, period, gate):
            if first < settled or way[last + 1] - way[first] <= COUNTS:
                continue
            place = bisect.bisect_left(heard_at, first)
            heard = place < len(heard_at) and heard_at[place] <= last + late
            tally.slips += 1
            if not heard:
                tally.missed += 1
                tally.delays.append(math.inf)
                tally.ways.append(math.inf)
            elif heard_at[place] > first:
                tally.delays.append((heard_at[place] - first) * period)
                # Of a slip that came to rest before the alarm, the whole way.
                end = min(heard_at[place], last + 1)
                tally.ways.append(float(way[end] - way[first]))


def believe(tally: Tally, walk: Recording, said: Said) -> None:
    """Count how right wetness and friction are."""
    if walk.sticks_only:
        return
    settled = round(SETTLED / walk.period)
    tip = 0.5 * walk.expected_load
    for leg in range(walk.load.shape[1]):
        load = walk.load[:, leg]
        pressures, of = np.unique(walk.pressure[:, leg], return_inverse=True)
        domed = np.array([walk.foot.dome_load(2.0 * tip, p) > tip for p in pressures.tolist()])[of]
        asked = said.standing[:, leg] & said.fresh[:, leg] & (load > 1e-6)
        asked[:settled] = False
        friction = walk.grip[:, leg] / np.maximum(load, 1e-6)
        mean, sd, margin = (each[:, leg] for each in (said.mean, said.sd, said.margin))
        right = abs(mean - friction) <= 2.0 * sd
        below = friction - walk.tangential[:, leg] / np.maximum(load, 1e-6) < margin
        wet = walk.wet[:, leg]
        for name, where in (('dry', ~domed & ~wet), ('wet', ~domed & wet), ('dome', domed)):
            tally.covered.setdefault(name, []).append(right[asked & where])
            tally.below.setdefault(name, []).append(below[asked & where])
        for start, end in _stretches(load > LOADED * walk.expected_load):
            middle = (start + end) // 2
            if start >= settled and (end - start) * walk.period > STANCE and not domed[middle]:
                tally.wet_ends.append((bool(wet[middle]), float(said.wet[end - 1, leg])))


def _stretches(on: Flags) -> Iterator[tuple[int, int]]:
    """Yield start and end, exclusive, of each run of True that has both."""
    edges = np.diff(on.astype(int))
    ends = np.flatnonzero(edges < 0) + 1
    for start in (np.flatnonzero(edges > 0) + 1).tolist():
        after = ends[ends > start]
        if len(after):
            yield start, int(after[0])


# --- rows ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Row:
    """What one method, or the estimator under one condition, achieved.

    Attributes
    ----------
    part : str
        ``methods`` or ``robustness``.
    name : str
        Method, or what was changed.
    variant : str
        Of the method or the change.
    value : float
        Threshold of the method, or how much was changed.
    unit : str
    shipped : bool
        Whether this is the estimator as shipped, under ordinary conditions.
    delay, way : float or None
        Medians of time, s, and way slipped, m, before the alarm, over slips that did not begin in
        one; None where more than half of these are missed, or of all began in one.
    misses : float or None
        Share of slips.
    already : float or None
        Share of slips that began in an alarm.
    slips : int
    false_per_minute : float or None
        False alarms in a minute of stick.
    stick_minutes : float
    us_per_update : float or None
        Mean time of an update, microseconds.
    brier, wet_right : float or None
        Mean squared error of P(wet) at the end of flat stances, and share on the right side.
    stances : int
    coverage, below : float or None
        Share of updates with the true friction within 2 sigma, and with the true margin below what
        is said to be its 5 % quantile.
    coverages, belows : dict of float
        The same by ground and shape.
    note : str
        What else is to be said.
    """

    part: str
    name: str
    variant: str
    value: float
    unit: str
    shipped: bool
    delay: float | None
    way: float | None
    misses: float | None
    already: float | None
    slips: int
    false_per_minute: float | None
    stick_minutes: float
    us_per_update: float | None
    brier: float | None
    wet_right: float | None
    stances: int
    coverage: float | None
    below: float | None
    coverages: dict[str, float]
    belows: dict[str, float]
    note: str = ''


def row_of(tally: Tally, us_per_update: float | None = None, **names: Any) -> Row:
    """Return the row that a tally makes."""
    minutes = tally.stick_time / 60.0
    timed = 2 * len(tally.delays) >= tally.slips
    probabilities = np.array(tally.wet_ends, dtype=np.float64).reshape(-1, 2)
    wet, said = probabilities.T
    return Row(
        delay=_median(tally.delays) if timed else None,
        way=_median(tally.ways) if timed else None,
        misses=tally.missed / tally.slips if tally.slips else None,
        already=1.0 - len(tally.delays) / tally.slips if tally.slips else None,
        slips=tally.slips,
        false_per_minute=tally.false_alarms / minutes if minutes else None,
        stick_minutes=minutes,
        us_per_update=us_per_update,
        brier=_mean((said - wet) ** 2),
        wet_right=_mean((said > 0.5) == (wet > 0.5)),
        stances=len(wet),
        coverage=_mean(_joined(tally.covered.values())),
        below=_mean(_joined(tally.below.values())),
        coverages=_means(tally.covered),
        belows=_means(tally.below),
        **names,
    )


def _median(values: Sequence[float]) -> float | None:
    median = statistics.median(values) if values else math.inf
    return median if math.isfinite(median) else None


def _mean(values: Any) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _joined(lists: Any) -> Floats:
    arrays = [array for each in lists for array in each]
    return np.concatenate(arrays) if arrays else np.array([])


def _means(parts: dict[str, list[Flags]]) -> dict[str, float]:
    means = {name: _mean(_joined([arrays])) for name, arrays in parts.items()}
    return {name: mean for name, mean in means.items() if mean is not None}


# --- methods -------------------------------------------------------------------------------------

RATIO, SPEED, CUSUM, BAYES, SHIPPED = (
    'T/N',
    'slip speed',
    'CUSUM',
    'Bayes, margin',
    'FootEstimator, alarm',
)
RATIOS = (0.05, 0.08, 0.1, 0.12, 0.15, 0.2, 0.3, 0.4, 0.6)
SPEEDS = (0.006, 0.01, 0.014, 0.02, 0.03, 0.04, 0.06, 0.1)  # m/s
CUSUM_SPEEDS = (0.01, 0.02, 0.04)  # m/s
CUSUM_THRESHOLDS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
MARGINS = (-0.3, -0.2, -0.15, -0.1, -0.05, -0.02, 0.0, 0.02, 0.05)


class Detector(Protocol):
    """Takes one sample of a foot, as :meth:`FootEstimator.update` does; True is alarm."""

    def update(
        self, time: float, force: Sequence[float], position: Sequence[float], pressure: float
    ) -> bool:
        """Take one sample."""


class RatioThreshold:
    """T/N above a threshold."""

    def __init__(self, told: tuple[Foot, float, Tuning], threshold: float) -> None:
        self._gate, self._threshold = told[2].load_gate * told[1], threshold

    def update(
        self, time: float, force: Sequence[float], position: Sequence[float], pressure: float
    ) -> bool:
        """Take one sample."""
        x, y, load = force
        return load > self._gate and math.hypot(x, y) > self._threshold * load


class SpeedThreshold:
    """Speed of the contact against its force above a threshold, as the estimator takes it."""

    def __init__(self, told: tuple[Foot, float, Tuning], threshold: float) -> None:
        foot, load, tuning = told
        self._gate, self._threshold = tuning.load_gate * load, threshold
        self._stiffness, self._smoothing = foot.shear_stiffness, tuning.smoothing
        self._time: float | None = None
        self._x = self._y = 0.0

    def speed(
        self, time: float, force: Sequence[float], position: Sequence[float]
    ) -> tuple[float, float] | None:
        """Return slip speed, m/s, and time since the last sample, s; None in the air."""
        push_x, push_y, load = force
        if load < self._gate:
            self._time = None
            return None
        x, y = position[0] + push_x / self._stiffness, position[1] + push_y / self._stiffness
        if self._time is None:
            self._time, self._x, self._y = time, x, y
            return None
        dt, self._time = time - self._time, time
        share = dt / (self._smoothing + dt)
        self._x += share * (x - self._x)
        self._y += share * (y - self._y)
        along = (x - self._x) * push_x + (y - self._y) * push_y
        return -along / (self._smoothing * (math.hypot(push_x, push_y) or math.inf)), dt

    def update(
        self, time: float, force: Sequence[float], position: Sequence[float], pressure: float
    ) -> bool:
        """Take one sample."""
        found = self.speed(time, force, position)
        return found is not None and found[0] > self._threshold


class SpeedCusum(SpeedThreshold):
    """:class:`SlipAlarm` on that speed."""

    def __init__(self, told: tuple[Foot, float, Tuning], speed: float, threshold: float) -> None:
        super().__init__(told, math.inf)
        self._alarm = alarm_of(told, speed, threshold)

    def update(
        self, time: float, force: Sequence[float], position: Sequence[float], pressure: float
    ) -> bool:
        """Take one sample."""
        found = self.speed(time, force, position)
        if found is None:
            self._alarm.reset()
            return False
        return self._alarm.update(*found)


class BayesMargin:
    """Margin of :class:`FootEstimator` below a threshold."""

    def __init__(self, told: tuple[Foot, float, Tuning], threshold: float) -> None:
        self._estimator, self._threshold = FootEstimator(*told), threshold

    def update(
        self, time: float, force: Sequence[float], position: Sequence[float], pressure: float
    ) -> bool:
        """Take one sample."""
        now = self._estimator.update(time, force, position, pressure)
        return now.standing and now.margin < self._threshold


class ShippedAlarm:
    """The alarm of :class:`FootEstimator`."""

    def __init__(self, told: tuple[Foot, float, Tuning]) -> None:
        self._estimator = FootEstimator(*told)

    def update(
        self, time: float, force: Sequence[float], position: Sequence[float], pressure: float
    ) -> bool:
        """Take one sample."""
        return self._estimator.update(time, force, position, pressure).slipping


def alarm_of(told: tuple[Foot, float, Tuning], speed: float, threshold: float) -> SlipAlarm:
    """Return the alarm with the noise that the estimator takes the speed to have."""
    foot, _, tuning = told
    noise = math.hypot(tuning.position_noise, tuning.force_noise / foot.shear_stiffness)
    noise = math.hypot(noise / tuning.smoothing, tuning.speed_noise)
    return SlipAlarm(noise, tuning.smoothing, speed, threshold)


@dataclass(frozen=True)
class Setting:
    """A method with a threshold.

    Attributes
    ----------
    name, variant : str
    value : float
    unit : str
    make : callable
        Returns a detector, for what an estimator is told.
    """

    name: str
    variant: str
    value: float
    unit: str
    make: Callable[[tuple[Foot, float, Tuning]], Detector]


def settings() -> list[Setting]:
    """Return every method with its thresholds."""

    def of(kind: Any, *values: float) -> Callable[[tuple[Foot, float, Tuning]], Detector]:
        return lambda told: kind(told, *values)

    found = [Setting(RATIO, '', r, '', of(RatioThreshold, r)) for r in RATIOS]
    found += [Setting(SPEED, '', v, 'm/s', of(SpeedThreshold, v)) for v in SPEEDS]
    found += [
        Setting(CUSUM, f'{1e3 * speed:g} mm/s', threshold, '', of(SpeedCusum, speed, threshold))
        for speed in CUSUM_SPEEDS
        for threshold in CUSUM_THRESHOLDS
    ]
    found += [Setting(BAYES, '', m, '', of(BayesMargin, m)) for m in MARGINS]
    return [*found, Setting(SHIPPED, '', 0.0, '', ShippedAlarm)]


def detect(walk: Recording, make: Callable[[tuple[Foot, float, Tuning]], Detector]) -> Flags:
    """Return when a detector is on, (samples, legs)."""
    out = np.zeros(walk.load.shape, dtype=bool)
    stamps = walk.stamps.tolist()
    for leg, mine in enumerate(walk.rows):
        update = make(walk.told).update
        out[:, leg] = [
            update(stamp, row[:3], row[3:6], row[6])
            for stamp, row in zip(stamps, mine, strict=True)
        ]
    return out


def compare(walks: Sequence[Recording], progress: Progress) -> list[Row]:
    """Measure each method with each of its thresholds on the same readings."""
    every = settings()
    # The margin is the same for all thresholds: estimate once.
    said = [replay(walk) for walk in walks]
    times = {setting.name: cost(walks[0], setting.make) for setting in every}
    rows = []
    for done, setting in enumerate(every):
        tally = Tally()
        for walk, mine in zip(walks, said, strict=True):
            if setting.name == BAYES:
                alarms = mine.standing & (mine.margin < setting.value)
            elif setting.name == SHIPPED:
                alarms = mine.slipping
                believe(tally, walk, mine)
            else:
                alarms = detect(walk, setting.make)
            hear(tally, walk, alarms)
        rows.append(
            row_of(
                tally, times[setting.name], part='methods', name=setting.name,
                variant=setting.variant, value=setting.value, unit=setting.unit,
                shipped=setting.name == SHIPPED,
            )
        )  # fmt: skip
        progress((done + 1) / len(every))
    return rows


def cost(walk: Recording, make: Callable[[tuple[Foot, float, Tuning]], Detector]) -> float:
    """Return the mean time of an update over a walk of one leg, us: the best of three."""
    stamps = walk.stamps.tolist()
    # Slices are the reader's, not the method's.
    samples = [(t, r[:3], r[3:6], r[6]) for t, r in zip(stamps, walk.rows[0], strict=True)]
    best = math.inf
    for _ in range(3):
        update = make(walk.told).update
        start = time.perf_counter()
        for sample in samples:
            update(*sample)
        best = min(best, time.perf_counter() - start)
    return 1e6 * best / len(samples)


# --- robustness ----------------------------------------------------------------------------------

Disturbance = Callable[[Recording, float, np.random.Generator], Recording]


def force_bias(walk: Recording, bias: float, generator: np.random.Generator) -> Recording:
    """Give each leg's force sensor an offset of that size, N, in a direction of its own."""
    direction = generator.normal(size=(walk.force.shape[1], 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return replace(walk, force=walk.force + bias * direction)


def position_noise(walk: Recording, noise: float, _: np.random.Generator) -> Recording:
    """Scale the noise of the marker to a standard deviation, m, of which nobody is told."""
    scale = noise / walk.told[2].position_noise
    return replace(walk, position=walk.position + (scale - 1.0) * walk.noise)


def told_noise(walk: Recording, noise: float, generator: np.random.Generator) -> Recording:
    """Do the same, and tell."""
    foot, load, tuning = walk.told
    told = (foot, load, replace(tuning, position_noise=noise))
    return replace(position_noise(walk, noise, generator), told=told)


def rate(walk: Recording, hertz: float, _: np.random.Generator) -> Recording:
    """Let every so many samples arrive."""
    step = round(1.0 / (hertz * walk.period))
    arrived = np.zeros_like(walk.arrived)
    arrived[::step] = True
    return replace(walk, arrived=arrived)


def believed_stiffness(walk: Recording, factor: float, _: np.random.Generator) -> Recording:
    """Tell of pads that are stiffer in shear by a factor."""
    foot, load, tuning = walk.told
    foot = replace(foot, shear_stiffness=factor * foot.shear_stiffness)
    return replace(walk, told=(foot, load, tuning))


def believed_shipped(walk: Recording, _: float, __: np.random.Generator) -> Recording:
    """Tell of the shipped foot, whatever this one is."""
    return replace(walk, told=(Foot.load(walk.foot.source), *walk.told[1:]))


def impacts(walk: Recording, peak: float, generator: np.random.Generator) -> Recording:
    """Let feet ring as they land: times the load, 10 ms half-sine, to a third of it sideways.

    The force that is read rises; what happens to the foot does not.
    """
    force = walk.force.copy()
    length = max(2, round(0.01 / walk.period))
    shape = np.sin(np.pi * (np.arange(length) + 0.5) / length)
    for leg in range(force.shape[1]):
        carries = walk.load[:, leg] > LOADED * walk.expected_load
        for first in (np.flatnonzero(carries[1:] & ~carries[:-1]) + 1).tolist():
            angle = generator.uniform(0.0, 2.0 * math.pi)
            share = generator.uniform(0.0, 1.0 / 3.0)
            push = np.array([share * math.cos(angle), share * math.sin(angle), 1.0])
            part = shape[: len(force) - first, None]
            force[first : first + length, leg] += peak * walk.expected_load * part * push
    return replace(walk, force=force)


def dropped(walk: Recording, share: float, generator: np.random.Generator) -> Recording:
    """Lose a share of the messages of each leg."""
    return replace(walk, arrived=walk.arrived & (generator.random(walk.arrived.shape) >= share))


def late_position(walk: Recording, delay: float, _: np.random.Generator) -> Recording:
    """Pair each force with a position that was measured some time, s, before."""
    sample = np.maximum(0, np.arange(len(walk.stamps)) - round(delay / walk.period))
    return replace(walk, position=walk.position[sample])


def clock_jumps(walk: Recording, jump: float, generator: np.random.Generator) -> Recording:
    """Set the clock by some time, s, at random, every 2 s on average."""
    jumps = generator.random(len(walk.stamps)) < 0.5 * walk.period
    return replace(walk, stamps=walk.stamps + jump * np.cumsum(jumps))


def same(walk: Recording, _: float, __: np.random.Generator) -> Recording:
    """Change nothing."""
    return walk


def at_1000_hertz(scene: Scene) -> Scene:
    """Return the scene with sensors at 1000 Hz."""
    return replace(scene, sensors=replace(scene.sensors, rate=1000.0))


def with_stiffness(factor: float) -> World:
    """Return what makes the feet of a scene stiffer in shear."""

    def change(scene: Scene) -> Scene:
        stiffness = factor * scene.foot.shear_stiffness
        return replace(scene, foot=replace(scene.foot, shear_stiffness=stiffness))

    return change


def with_patches(length: float) -> World:
    """Return what sets the length of patches, m."""

    def change(scene: Scene) -> Scene:
        if scene.floor.kind != 'patches':
            return scene
        return replace(scene, floor=replace(scene.floor, patch_length=length))

    return change


def with_wet_friction(friction: float) -> World:
    """Return what sets the friction on a film that does not drain."""
    return lambda scene: replace(scene, foot=replace(scene.foot, boundary_friction=friction))


def with_mass(factor: float) -> World:
    """Return what makes the body heavier by a factor, on the same feet."""

    def change(scene: Scene) -> Scene:
        body = scene.body
        assert isinstance(body, HexapodBody)
        body = replace(body, mass=factor * body.mass, inertia=factor * body.inertia)
        tow = replace(scene.tow, weight=factor * scene.tow.weight)
        return replace(scene, body=body, tow=tow)

    return change


@dataclass(frozen=True)
class Change:
    """A thing that is changed, with values of it.

    Attributes
    ----------
    name, unit : str
    values : tuple of float
    variant : str
    ordinary : float
        Value at which nothing is changed.
    disturb : callable
        Changes a recording.
    world : callable or None
        Returns, for a value, what changes the scenes of new recordings.
    rung : str or None
        To record on; None is the full dynamics.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    ordinary: float
    variant: str = ''
    disturb: Disturbance = same
    world: Callable[[float], World] | None = None
    rung: str | None = None


STIFFNESSES = (0.25, 0.5, 1.0, 2.0, 4.0)
NOISES = (5e-5, 1.5e-4, 3e-4, 6e-4)
WET_FRICTIONS = (0.12, 0.25, 0.4, 0.55)
TOLD, NOT_TOLD = 'told', 'not told'

CHANGES = (
    Change('force bias', 'N', (0.0, 0.5, 1.0, 2.0), 0.0, disturb=force_bias),
    Change('position noise', 'm', NOISES, 1.5e-4, TOLD, told_noise),
    Change('position noise', 'm', NOISES, 1.5e-4, NOT_TOLD, position_noise),
    Change(
        'sample rate', 'Hz', (50.0, 100.0, 250.0, 1000.0), 250.0,
        disturb=rate, world=lambda _: at_1000_hertz,
    ),
    Change('shear stiffness', 'times', STIFFNESSES[::2], 1.0, TOLD, world=with_stiffness),
    Change('shear stiffness', 'times', STIFFNESSES, 1.0, NOT_TOLD, believed_stiffness),
    Change('patch length', 'm', (0.2, 0.5, 1.5, 4.0), 1.5, world=with_patches),
    Change('wet friction', '', WET_FRICTIONS, 0.12, TOLD, world=with_wet_friction),
    Change(
        'wet friction', '', WET_FRICTIONS, 0.12, NOT_TOLD, believed_shipped, with_wet_friction
    ),
    Change('impacts', 'loads', (0.0, 2.0, 4.0), 0.0, disturb=impacts),
    Change('messages dropped', '', (0.0, 0.1, 0.2, 0.3), 0.0, disturb=dropped),
    Change('position late', 's', (0.0, 8e-3, 2e-2, 4e-2), 0.0, disturb=late_position),
    Change('clock jumps', 's', (-0.5, -0.1, 0.0, 0.1, 0.5), 0.0, disturb=clock_jumps),
    Change('mass', 'times', (0.5, 1.0, 1.5), 1.0, 'L2', world=with_mass),
    Change('mass', 'times', (0.5, 1.0, 2.0, 4.0), 1.0, 'L1', world=with_mass, rung='L1'),
)  # fmt: skip


def stress(changes: Sequence[Change], progress: Progress) -> list[Row]:
    """Try the shipped estimator under each change.

    ``not told`` of the stiffness means that the estimator is told of pads so many times stiffer
    than they are.
    """
    base = few_recordings()
    plain = _try(base)
    rows = []
    total = sum(len(change.values) for change in changes)
    # What is recorded serves all changes that need it.
    kept: dict[Any, list[Recording]] = {}
    for change in changes:
        for value in change.values:
            ordinary = value == change.ordinary and change.disturb is not rate
            if ordinary and change.rung is None:
                tally, walks = plain, base
            else:
                if change.world is None or (ordinary and change.rung is None):
                    walks = base
                else:
                    key = (change.world(value) if change.disturb is rate else
                           (change.name, value, change.rung))  # fmt: skip
                    if key not in kept:
                        kept[key] = few_recordings(change.world(value), change.rung)
                    walks = kept[key]
                generator = np.random.default_rng(SEEDS)
                tally = _try([change.disturb(walk, value, generator) for walk in walks])
            rows.append(
                row_of(
                    tally, part='robustness', name=change.name, variant=change.variant,
                    value=value, unit=change.unit, shipped=value == change.ordinary,
                    note=_shortened(walks),
                )
            )  # fmt: skip
            progress(len(rows) / total)
    return rows


def _try(walks: Sequence[Recording]) -> Tally:
    tally = Tally()
    for walk in walks:
        said = replay(walk)
        hear(tally, walk, said.slipping)
        believe(tally, walk, said)
    return tally


def _shortened(walks: Sequence[Recording]) -> str:
    ended = [walk.name for walk in walks if len(walk.stamps) * walk.period < FEW_CYCLES]
    return f'ended early: {"; ".join(ended)}' if ended else ''


def measure(progress: Progress | None = None) -> list[Row]:
    """Record, compare the methods, and try the estimator; ``progress`` from 0 to 1."""
    tell = progress or (lambda _: None)
    rows = compare(recordings(), lambda share: tell(0.25 * share))
    return rows + stress(CHANGES, lambda share: tell(0.25 + 0.75 * share))


# --- what is shown -------------------------------------------------------------------------------

NEEDS_MUJOCO = 'full dynamics not compared: pip install "ros_pad[mujoco]"'
_HEADINGS = (
    'delay', 'way', 'misses', 'false/', 'update', 'Brier', 'wet', 'within', 'margin',
    '2 sigma: dry', 'wet', 'dome',
)  # fmt: skip
_UNITS = ('ms', 'mm', '%', 'minute', 'us', '', 'right', '2 sigma', 'below 5 %', '', '', '')
_WIDTHS = [max(10, len(a) + 2, len(b) + 2) for a, b in zip(_HEADINGS, _UNITS, strict=True)]


def table(rows: Sequence[Row]) -> str:
    """Return the rows as text."""
    lines = []
    for part, title in (
        ('methods', 'methods, each over its thresholds'),
        ('robustness', 'FootEstimator under changed conditions (* ordinary)'),
    ):
        mine = [row for row in rows if row.part == part]
        if not mine:
            continue
        lines.append(
            f'{title}: {max(row.slips for row in mine)} slips and'
            f' {max(row.stick_minutes for row in mine):.1f} minutes of stick at most'
        )
        for heads in (_HEADINGS, _UNITS):
            cells = ''.join(f'{head:>{width}}' for head, width in zip(heads, _WIDTHS, strict=True))
            lines.append(f'  {"":38}{cells}')
        lines += [_line(row) for row in mine]
    if full() == 'L1':
        lines.append(NEEDS_MUJOCO)
    return '\n'.join(lines)


def _line(row: Row) -> str:
    name = ', '.join(filter(None, (row.name, row.variant)))
    named = f'{name} {row.value:g} {row.unit}'.strip() + (' *' if row.shipped else '')
    values = (
        _shown(row.delay, 1e3), _shown(row.way, 1e3), _shown(row.misses, 1e2),
        _shown(row.false_per_minute), _shown(row.us_per_update), _shown(row.brier),
        _shown(row.wet_right), _shown(row.coverage), _shown(row.below),
        *(_shown(row.coverages.get(name)) for name in ('dry', 'wet', 'dome')),
    )  # fmt: skip
    cells = ''.join(f'{value:>{width}}' for value, width in zip(values, _WIDTHS, strict=True))
    return f'  {named:38}{cells}' + (f'  {row.note}' if row.note else '')


def _shown(value: float | None, scale: float = 1.0) -> str:
    return '-' if value is None else f'{scale * value:.3g}'


def figures(rows: Sequence[Row], progress: Progress | None = None) -> dict[str, Figure]:
    """Return the pictures by their names."""
    from ros_pad.ladders import estimator_chart  # which needs the names above

    return {
        'estimator': estimator_chart.draw_methods(rows),
        'estimator_robustness': estimator_chart.draw_robustness(rows),
    }
