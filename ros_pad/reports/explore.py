# SPDX-License-Identifier: Apache-2.0
"""What ``pad explore`` shows of a foot, computed from its inputs without a page.

Each part is computed by the function that the other commands use. A part that has no answer is
None, with a remark at the input that is the cause; the other parts stay.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ros_pad import contact
from ros_pad.configuration import Setting, quantity
from ros_pad.contact import Film, Foot, Inflated, Material, Meniscus, Pad, Pressed
from ros_pad.contact.layout import Layout
from ros_pad.contact.limits import DEFAULT_CRITERION, criteria, largest_pressure
from ros_pad.contact.pad import DOME_PRESSURE, Array
from ros_pad.contact.resistance import DOMED, FOOT_SETTINGS, PAD_SETTINGS, RUBBER_SETTINGS
from ros_pad.errors import ConfigError, InvalidInput, NoEquilibrium
from ros_pad.simulation.pneumatics import Hose, PneumaticChannel, RegulatorModel, time_to

MEASURED = 'measured stiffness'
"""Choice of the material for pads of a measured stiffness, without a material."""
LIQUIDS = {'water': contact.WATER, 'thesis': contact.THESIS_LIQUID}
STATES = ('flat, dry', 'flat, wet', 'dome, dry', 'dome, wet')
_LOADS = 30  # points of the curves
_TICK, _LONGEST = 1e-3, 5.0  # s, see time_to


class Field(NamedTuple):
    """A number that can be chosen.

    Attributes
    ----------
    name, label : str
        In the inputs, and on the page.
    setting : Setting
        What is allowed, SI.
    low, high, step : float
        Range of the slider, in the unit of the page.
    shown, unit : str, float
        That unit, and what it is in SI.
    """

    name: str
    label: str
    setting: Setting
    low: float
    high: float
    step: float
    shown: str
    unit: float

    def read(self, value: float | None) -> float:
        """Return a value in SI in the unit of the page; NaN for none."""
        if value is None or math.isnan(value):
            return math.nan
        return value if self.unit == 1 else float(f'{value / self.unit:.12g}')

    def check(self, value: float) -> None:
        """Raise InvalidInput if a value in the unit of the page is not allowed."""
        low, high = self.setting.low / self.unit, self.setting.high / self.unit
        allowed = replace(self.setting, low=low, high=high, unit=self.shown)
        if math.isnan(value):
            raise InvalidInput(f'{allowed.name} is missing: {allowed.allowed} is needed')
        allowed.accept(value)


def _of(settings: Sequence[Setting], name: str, new: str = '') -> Setting:
    return replace(next(each for each in settings if each.name == name), name=new or name)


def _own(name: str, unit: str, low: float, high: float) -> Setting:
    return Setting(name, float, '', unit, low, high)


_MM, _UM, _KPA = ('mm', 1e-3), ('µm', 1e-6), ('kPa', 1e3)
FIELDS = (
    Field('pads', 'Pads', _of(FOOT_SETTINGS, 'pads'), 1, 400, 1, '', 1),
    Field('radius', 'Pad radius', _of(PAD_SETTINGS, 'radius'), 0.2, 4.0, 0.05, *_MM),
    Field('stiffness', 'Stiffness', _of(PAD_SETTINGS, 'stiffness'), 2, 150, 0.5, 'N/m', 1),
    Field('thickness', 'Thickness', _of(RUBBER_SETTINGS, 'thickness'), 0.05, 1.5, 0.01, *_MM),
    Field('sole_radius', 'Sole radius', _of(FOOT_SETTINGS, 'sole_radius'), 3, 60, 0.5, *_MM),
    Field('supply', 'Highest pressure', _of(FOOT_SETTINGS, 'ceiling', 'supply'), 1, 150, 1, *_KPA),
    Field('pressure', 'Pressure', _own('pressure', 'Pa', 0.0, 1e6), 0, 150, 0.5, *_KPA),
    Field('load', 'Load on the foot', _own('load', 'N', 1e-3, 1e4), 0.1, 100, 0.1, 'N', 1),
    Field('film', 'Liquid film', _own('film', 'm', 1e-6, 1e-2), 0.01, 1, 0.01, *_MM),
    Field('stand', 'Time on the film', _own('stand', 's', 1e-4, 1e3), 0.01, 2, 0.01, 's', 1),
    Field('roughness', 'Roughness, RMS', _own('roughness', 'm', 0.0, 1e-3), 0, 10, 0.1, *_UM),
    Field('bore', 'Hose, inside', _own('bore', 'm', 0.5e-3, 20e-3), 0.5, 8, 0.1, *_MM),
    Field('hose', 'Hose, length', _own('hose', 'm', 0.0, 50.0), 0, 10, 0.1, 'm', 1),
)  # fmt: skip
_BLAMED = {'ceiling': 'supply', 'limit': 'criterion', 'setpoint': 'pressure', 'force': 'load'}


Inputs: TypeAlias = dict[str, Any]
"""What is chosen, SI, by name of :data:`FIELDS`, with ``foot`` (the foot to begin with, which has
what cannot be chosen here), ``material`` (:data:`MEASURED` or a material), ``criterion`` of the
force limit and ``liquid`` of :data:`LIQUIDS`."""


def inputs_of(foot: Foot) -> Inputs:
    """Return the values of a foot, at a typical pressure and half the load for that."""
    pad, pressure = foot.pad, DOMED * foot.ceiling
    load = float(f'{0.5 * foot.dome_load(math.inf, pressure):.2g}') or 1.0
    return {
        'foot': foot,
        'material': MEASURED if pad.material is None else pad.material.name,
        'criterion': foot.limit,
        'liquid': 'water',
        'pads': foot.pads,
        'radius': pad.radius,
        'stiffness': pad.stiffness,
        'thickness': pad.thickness,
        'sole_radius': foot.sole_radius,
        'supply': foot.ceiling,
        'pressure': pressure,
        'load': load,
        **{'film': 3e-4, 'stand': 0.3, 'roughness': 0.0, 'bore': 4e-3, 'hose': 1.0},
    }


class Remark(NamedTuple):
    """Where a model ends, or what to know: the input that is the cause, and words."""

    name: str
    text: str
    error: bool


class Switching(NamedTuple):
    """Time to 90 % of the pressure, and from all of it until pads are flat, s; may be infinite."""

    fill: float
    vent: float


@dataclass(frozen=True)
class Explored:
    """The answer to inputs; parts without an answer are None.

    Attributes
    ----------
    remarks : tuple of Remark
        At most one error for each input.
    foot : Foot
        The foot, on smooth ground, as it is exported.
    free, pressed, ring
        The dome free and under its share of the load, and the ring of liquid.
    limits : dict of str to float
        Force limit of one pad by criterion, N; NaN above the largest pressure of a criterion.
    loads, curves
        Loads, N, and the tangential capacity there, N, by state; the last is the present load.
    switching : Switching
    pitch : float
        Distance of neighbouring pads in a hexagonal pattern over the sole, m.
    """

    inputs: Inputs
    remarks: tuple[Remark, ...]
    foot: Foot | None
    free: Inflated | None
    pressed: Pressed | None
    ring: Meniscus | None
    limits: Mapping[str, float]
    loads: Array
    curves: Mapping[str, Array]
    switching: Switching | None
    pitch: float

    @property
    def grip(self) -> dict[str, float]:
        """Tangential capacity at the load, N, by state."""
        return {state: float(curve[-1]) for state, curve in self.curves.items()}

    @property
    def limit(self) -> float | None:
        """Force limit of the foot, N."""
        if self.foot is None or not self.limits:
            return None
        return self.foot.pads * self.limits[self.foot.limit]


class _Parts:
    """Computes parts, and turns their errors into remarks."""

    def __init__(self) -> None:
        self.remarks: list[Remark] = []
        self._bad: set[str] = set()

    def __call__(self, needs: str, make: Callable[..., Any], *given: Any) -> Any:
        """Return what a function makes of values.

        None if a value is missing, one of the inputs that it needs has an error, or it raises.
        """
        if self._bad & set(needs.split()) or any(each is None for each in given):
            return None
        try:
            return make(*given)
        except NoEquilibrium as error:
            loaded = error.status == 'flattened' and not str(error).startswith('pressure = 0 ')
            self.note('load' if loaded else 'pressure', str(error), True)
        except InvalidInput as error:
            name = str(error).split()[0]
            self.note(_BLAMED.get(name, name), str(error), True)
        except ConfigError as error:
            self.note('material', str(error), True)
        return None

    def note(self, name: str, text: str, error: bool = False) -> None:
        """Add a remark; of several errors at one input the first is kept."""
        if not (error and name in self._bad):
            self.remarks.append(Remark(name, text, error))
        if error:
            self._bad.add(name)


def explore(inputs: Inputs) -> Explored:
    """Compute everything that the page shows."""
    parts = _Parts()
    # A material has its stiffness from its law; pads without one need no thickness.
    unused = 'stiffness' if inputs['material'] != MEASURED else 'thickness'
    for field in FIELDS:
        value = inputs[field.name]
        if field.name != unused or (unused == 'thickness' and value is not None):
            parts('', field.check, field.read(value))
    pressure = inputs['pressure']
    pad = parts('radius stiffness thickness', _pad, inputs)
    criterion = parts('', _criterion, inputs, pad, parts)
    foot = parts('pads sole_radius supply', _foot, inputs, pad, criterion, parts)
    parts('pressure', _below_ceiling, inputs, foot)
    free = parts('pressure', contact.inflate, pad, pressure)
    pitch = parts('pads sole_radius radius', lambda: _pitch(inputs, free, parts))
    limits = parts('pressure', _limits, pad, pressure) or {}
    parts('pressure', _within_limit, inputs, foot, limits, parts)
    loads, curves = parts('load', _curves, inputs, foot, limits, parts) or (np.zeros(1), {})
    share = parts('load pads', lambda: inputs['load'] / inputs['pads'])
    pressed = parts('pressure', contact.press, pad, pressure, share)
    return Explored(
        inputs=inputs,
        foot=foot,
        free=free,
        pressed=pressed,
        ring=parts('', _ring, inputs, pressed, parts),
        limits=limits,
        loads=loads,
        curves=curves,
        switching=parts('pressure bore hose', _switched, inputs, foot, parts),
        pitch=pitch if pitch and math.isfinite(pitch) else math.nan,
        remarks=tuple(parts.remarks),
    )


@functools.lru_cache(maxsize=64)
def _material(name: str) -> Material:
    return Material.load(name)


def _pad(inputs: Inputs) -> Pad:
    """Return the pad; measured limits stay only with the pad on which they were measured."""
    start, radius, thickness = inputs['foot'].pad, inputs['radius'], inputs['thickness']
    if inputs['material'] == MEASURED:
        adhesion = Pad.adhesion_energy if start.material else start.adhesion_energy
        pad = Pad(radius, inputs['stiffness'], adhesion, thickness=thickness)
    else:
        own = start.material
        same = own is not None and own.name == inputs['material']
        pad = Pad.of(own if same and own else _material(inputs['material']), radius, thickness)
    measured = replace(pad, measured_limit=start.measured_limit)
    return measured if measured == start else pad


def _criterion(inputs: Inputs, pad: Pad, parts: _Parts) -> str:
    if inputs['criterion'] in criteria(pad):
        return inputs['criterion']
    words = f'{inputs["criterion"]} is not known for these pads: {DEFAULT_CRITERION} is used'
    parts.note('criterion', words)
    return DEFAULT_CRITERION


def _foot(inputs: Inputs, pad: Pad, criterion: str, parts: _Parts) -> Foot:
    end, ceiling = largest_pressure(pad), inputs['supply']
    if ceiling >= end:
        ceiling = float(math.floor(end))
        parts.note(
            'supply',
            f'the model of these pads ends at {1e-3 * end:.4g} kPa: that is the ceiling of the'
            ' foot',
        )
    _of(FOOT_SETTINGS, 'ceiling').accept(ceiling)  # or no file of this foot could be read
    return replace(
        inputs['foot'],
        pad=pad,
        pads=inputs['pads'],
        sole_radius=inputs['sole_radius'],
        ceiling=ceiling,
        limit=criterion,
    )


def _below_ceiling(inputs: Inputs, foot: Foot) -> None:
    ceiling = 1e-3 * foot.ceiling
    quantity('pressure', 1e-3 * inputs['pressure'], 'kPa, the ceiling of the foot', high=ceiling)


def _pitch(inputs: Inputs, free: Inflated | None, parts: _Parts) -> float:
    """Return the pitch of the pads in a hexagonal pattern over the sole, m."""
    radius = inputs['radius']
    pitch = max(Layout.of(inputs['pads'], radius, inputs['sole_radius']).pitch, 0.0)
    width = 2.0 * radius
    if free is not None and free.height > radius:
        width = 2.0 * free.sphere_radius
    if pitch < width:
        words = f'free domes, {1e3 * width:.3g} mm wide, touch one another at a pitch of'
        parts.note('pads', f'{words} {1e3 * pitch:.3g} mm')
    return pitch


def _limits(pad: Pad, pressure: float) -> dict[str, float]:
    """Return the force limit of a pad by criterion, N; NaN above a criterion's last pressure."""
    return {
        each: contact.force_limit(pad, pressure, each)
        if pressure < largest_pressure(pad)
        else math.nan
        for each in criteria(pad)
    }


def _within_limit(inputs: Inputs, foot: Foot, limits: Mapping[str, float], parts: _Parts) -> None:
    value = foot.pads * limits[foot.limit]
    if inputs['load'] > value:
        parts.note(
            'load',
            f'above the force limit of the foot by the criterion {foot.limit}, {value:.4g} N: the'
            ' domes are pressed flat, and the sole carries the rest',
        )


def _curves(
    inputs: Inputs, foot: Foot, limits: Mapping[str, float], parts: _Parts
) -> tuple[Array, dict[str, Array]]:
    """Return loads, the last of them the present one, and the capacity there by state, N."""
    largest = max(1.3 * inputs['load'], 1.2 * foot.pads * limits.get(foot.limit, 0.0))
    loads = np.append(np.linspace(largest / _LOADS, largest, _LOADS), inputs['load'])
    found = {}
    for state in STATES:
        dome, wet = 'dome' in state, 'wet' in state
        if dome and inputs['pressure'] < DOME_PRESSURE:
            continue  # the foot is flat
        needs = 'load roughness' + ' film stand' * wet + ' pressure' * dome
        curve = parts(needs, _capacity, inputs, foot, loads, inputs['pressure'] * dome, wet)
        if curve is not None:
            found[state] = curve
    return loads, found


def _capacity(inputs: Inputs, foot: Foot, loads: Array, pressure: float, wet: bool) -> Array:
    """Return the capacity under loads, N."""
    rough, found = foot.on_rough(inputs['roughness']), []
    film = Film(rough)
    for load in loads.tolist():
        film.touch_down(inputs['film'])
        found.append(rough.grip_after(load, pressure, film if wet else None, inputs['stand']))
    return np.array(found)


def _ring(inputs: Inputs, pressed: Pressed, parts: _Parts) -> Meniscus:
    ring = contact.meniscus(pressed, LIQUIDS[inputs['liquid']])
    if ring.ring_radius > inputs['radius']:
        parts.note(
            'liquid',
            f'the ring of liquid has a radius of {1e3 * ring.ring_radius:.3g} mm, wider than the'
            ' pad: its balance, and so its height, is not valid there',
        )
    return ring


def _switched(inputs: Inputs, foot: Foot, parts: _Parts) -> Switching | None:
    if inputs['pressure'] <= DOME_PRESSURE:
        return None
    found = _switching(foot, inputs['pressure'], Hose(inputs['bore'], inputs['hose']))
    if math.inf in found:
        parts.note('hose', f'the pads take longer than {_LONGEST:g} s to fill or to vent')
    return found


@functools.lru_cache(maxsize=8)
def _switching(foot: Foot, pressure: float, hose: Hose) -> Switching:
    regulator = RegulatorModel(full_scale=max(RegulatorModel().full_scale, pressure))
    channel = PneumaticChannel(regulator, hose, foot.air_volume)
    fill = time_to(channel, pressure, 0.9 * pressure, _TICK, _LONGEST)
    channel.step(pressure, _LONGEST)
    return Switching(fill, time_to(channel, 0.0, DOME_PRESSURE, _TICK, _LONGEST))


def rows(found: Explored) -> dict[str, dict[str, tuple[str, str]]]:
    """Return the numbers of the page by heading and key: label, and text with unit, or a dash."""
    ring, switching = found.ring, found.switching
    if ring is not None and ring.ring_radius > found.inputs['radius']:
        ring = None  # a height that is not valid: see _ring

    def of(part: Any, name: str, unit: str = 'mm', size: float = 1e-3) -> str:
        return _text(None if part is None else float(getattr(part, name)), unit, size)

    return {
        'Dome': {
            'free-height': ('free height', of(found.free, 'height')),
            'pressed-gap': ('gap under load', of(found.pressed, 'gap')),
            'pressed-contact_radius': ('contact radius', of(found.pressed, 'contact_radius')),
            'ring-height': ('ring of liquid, height', of(ring, 'height')),
        },
        'Force limit of a pad': {
            f'limit-{name}': (name, _text(value, 'N')) for name, value in found.limits.items()
        },
        'Foot': {
            'limit': ('force limit', _text(found.limit, 'N')),
            'pitch': ('pitch of pads', _text(found.pitch, 'mm', 1e-3)),
            'fill': ('fills to 90 % in', of(switching, 'fill', 's', 1.0)),
            'vent': ('flat again after', of(switching, 'vent', 's', 1.0)),
        },
        'Grip': {
            f'grip-{state.replace(", ", "-")}': (state, _text(found.grip.get(state), 'N'))
            for state in STATES
        },
    }


def _text(value: float | None, unit: str, size: float = 1.0) -> str:
    if value is None or math.isnan(value):
        return '–'
    return f'over {_LONGEST:g} {unit}' if math.isinf(value) else f'{value / size:.4g} {unit}'
