# SPDX-License-Identifier: Apache-2.0
"""Dimensions of a foot and of its moulds, and why a foot cannot be made.

Lengths of a :class:`Plan` are millimetres; z is 0 on the floor and grows towards the leg.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ros_pad.configuration import Setting, Table, choice
from ros_pad.contact import Foot, Material
from ros_pad.contact.layout import LARGE, LINING, RIM, SKIN, WALL, Layout, hexagonal, reach_of
from ros_pad.contact.pad import Array
from ros_pad.errors import InvalidInput, PadError

PROCESSES = ('large', 'small')
"""A printed bone wrapped in silicone (thesis 5.1.1), and a body of silicone under a softer sheet
(5.1.2)."""

STRENGTH = 15.0  # MPa in bending: half of what printed ABS breaks at in its layers
_POISSON = 0.35  # of ABS


def _length(
    name: str, default: float, description: str, low: float = 0.0, high: float = 0.1
) -> Setting:
    return Setting(name, default, description, 'm', low, high)


SETTINGS = (
    _length('tolerance', 0.05e-3, 'How far the thickness of the sheet may be off.'),
    _length('nozzle', 0.4e-3, 'Nozzle of the filament printer.', 1e-4),
    _length('wall', WALL, 'Smallest wall of the filament printer.', 2e-4),
    _length('hole', 1e-3, 'Smallest hole of the filament printer, in diameter.'),
    _length(
        'clearance', 0.2e-3, 'Gap of printed parts around one another; half for dowels.', 0.0, 5e-4
    ),
    _length('bed', 0.145, 'Side of the smaller of the two print beds.', 0.0, 2.0),
    _length('pin', 0.3e-3, 'Smallest pin of the resin printer, in diameter.'),
    Setting('slenderness', 20.0, 'Largest length of a pin over its diameter.', '', 1.0, 100.0),
    Setting('draft', 0.25, 'Angle by which pins and bores open.', 'degrees', 0.0, 5.0),
    _length('web', 0.2e-3, 'Smallest wall of silicone.'),
    _length('lining', LINING, 'Silicone between a pin and the bone.'),
    _length('skin', SKIN, 'Silicone around the bone.'),
    _length('under', 0.8e-3, 'Silicone between the sheet and the bone.'),
    _length('rim', RIM, 'Silicone around the outermost pads of a sole without a bone.'),
    _length('bone', 0.0, 'Thickness of the bone; 0: as thick as it must be, from 8 mm.'),
    _length('flange', 3e-3, 'Thickness of the flange of the bone.'),
    Setting('load', 0.0, 'Peak load; 0: three times the force limit.', 'N', 0.0, 1e5),
    _length('screw', 3e-3, 'Screws, which cut their thread in bone or retainer.', 2e-3, 1e-2),
    _length('fitting', 4.2e-3, 'Hole for the fitting of the hose: tapped to M5.', 1e-3),
    Setting('mount_holes', 3, 'Holes in the cap for the leg.', '', 0, 24),
    _length('mount_hole', 2.5e-3, 'Their diameter: screws of 3 mm cut their thread.', 1e-3),
    _length('mount_circle', 0.0, 'Diameter of their circle; 0: 20 mm, or what there is room for.'),
)
"""Limits of printers, walls, screws and holes, SI."""


@dataclass(frozen=True)
class Plan:
    """Dimensions of a foot and of its moulds.

    Attributes
    ----------
    foot : Foot
    process : str
        One of :data:`PROCESSES`.
    given : dict of str to float
        Settings that were asked for, SI.
    set : dict of str to float
        :data:`SETTINGS` in millimetres, N, degrees.
    places : array, (pads, 2)
        Centres of the pads, mm.
    pitch : float
        Distance of neighbouring pads, mm; infinite for one pad.
    z, r : dict of str to float
        Heights above the floor and radii by name, mm.
    sheet, body : Material
        What the sheet and the body are cast of.
    """

    foot: Foot
    process: str
    given: dict[str, float]
    set: dict[str, float]
    places: Array
    pitch: float
    z: dict[str, float]
    r: dict[str, float]
    sheet: Material
    body: Material

    lid_angles = (50.0, 165.0, 295.0)
    plate_angles = (20.0, 130.0, 250.0)

    @property
    def screws(self) -> int:
        """Number of screws between cap and bone or retainer: three for 75 mm, at least six."""
        return max(6, 3 * math.ceil(2.0 * math.pi * self.r['screws'] / 75.0))

    @property
    def screw_length(self) -> float:
        """Length of these screws below their heads, mm: they end inside."""
        held = self.z['stop'] - self.z['flange'] + (0.0 if 'bone' in self.z else 3.0)
        return 2.0 * math.floor(0.5 * (self.z['cap'] - self.z['stop'] + held) + 1e-9)

    def pegs(self, angles: Sequence[float]) -> list[tuple[float, float]]:
        """Return places of pegs between ring and plate or lid, mm, at angles in degrees."""
        radius = self.r['outer'] - 3.2
        turns = [math.radians(angle) for angle in angles]
        return [(radius * math.cos(a), radius * math.sin(a)) for a in turns]

    @property
    def edge(self) -> float:
        """Room between the outermost pad and the edge of the sole, mm."""
        use = self.set
        return use['lining'] + use['wall'] + use['skin'] if self.process == 'large' else use['rim']

    @property
    def slope(self) -> float:
        """Tangent of the draft."""
        return math.tan(math.radians(self.set['draft']))

    def bulge(self, thick: float) -> float:
        """Return how far a sole without a bone bulges at the ceiling, mm: a clamped plate.

        Bending and shear of a plate of this thickness, mm, with ν = 0.5; holes are left out.
        """
        load, shear = 1e-6 * self.foot.ceiling, 1e-6 * self.body.shear_modulus
        wide = self.r['bore'] + self.slope * (thick - self.z['top'] + self.z['sheet'])
        bending = 3.0 * load * wide**4 / (64.0 * shear * thick**3)
        return bending + 0.3 * load * wide**2 / (shear * thick)


def plan(foot: Foot, process: str | None = None, given: Mapping[str, Any] | None = None) -> Plan:
    """Return the dimensions of a foot and of its moulds.

    Parameters
    ----------
    foot : Foot
        Its ``silicones`` say what it is cast of.
    process : {'large', 'small'}, optional
        By default large from pads of 1 mm radius on.
    given : dict of str to float, optional
        Values of :data:`SETTINGS`, SI.

    Raises
    ------
    InvalidInput
        When the foot cannot be made; the message has every reason, each with the number that would
        do.
    ConfigError
        When a setting is unknown or not allowed.
    """
    usual = 'large' if foot.pad.radius >= LARGE else 'small'
    process = choice('process', process or usual, PROCESSES)
    table = Table(dict(given or {}), 'settings of moulds')
    values = table.values(SETTINGS)
    table.finish()
    use = {each.name: values[each.name] * (1e3 if each.unit == 'm' else 1.0) for each in SETTINGS}
    sheet, body = _silicones(foot, process)
    made = Plan(foot, process, dict(given or {}), use, np.zeros((1, 2)), 0.0, {}, {}, sheet, body)
    layout = Layout.of(foot.pads, foot.pad.radius, foot.sole_radius, 1e-3 * made.edge)
    made = replace(made, places=1e3 * layout.places, pitch=1e3 * layout.pitch)
    title = f'{foot.source} cannot be made ({process} process)'
    least = _least(made)
    if 1e3 * foot.sole_radius < least:
        raise InvalidInput(
            f'{title}: {foot.pads} pads of radius {1e3 * foot.pad.radius:g} mm on a sole of radius'
            f' {1e3 * foot.sole_radius:g} mm leave no room for walls between them and at the edge:'
            f' sole_radius of at least {0.1 * math.ceil(10.0 * least - 1e-9):.1f} mm is needed, or'
            ' fewer pads'
        )
    if process == 'large':
        use['bone'] = use['bone'] or max(8.0, 0.5 * math.ceil(2.0 * bone_needed(made)))
    made.z.update(_heights(made))
    made.r.update(_radii(made, reach_of(made.places)))
    roof = _plate(foot.ceiling, made.r['plenum'], 1.0)
    made.z['cap'] = made.z['roof'] + max(6.0, 0.5 * math.ceil(2.0 * roof))
    use['mount_circle'] = use['mount_circle'] or min(20.0, _mounts(made)[1])
    wrong = [
        f'{name} is {value:.3g} mm, '
        + (
            f'at least {0.01 * math.ceil(100.0 * low - 1e-6):.2f} mm is needed'
            if value < low
            else f'at most {0.01 * math.floor(100.0 * high + 1e-6):.2f} mm is allowed'
        )
        for name, value, low, high in _limits(made)
        if not low - 1e-9 <= value <= high + 1e-9
    ]
    if wrong:
        raise InvalidInput(f'{title}: {"; ".join(wrong)}')
    return made


def verdict(foot: Foot) -> str:
    """Return whether a foot can be made, and if not why not, as a sentence."""
    try:
        made = plan(foot)
    except PadError as error:
        return f'Not to be cast: {error}.'
    return (
        f'It can be cast ({made.process} process, {made.pitch:.2f} mm from pad to pad): pad mould.'
    )


def _silicones(foot: Foot, process: str) -> tuple[Material, Material]:
    own, need = foot.pad.material, 1 + (process == 'small')
    names = foot.silicones if own is None else (own.name, *foot.silicones[1:])
    if len(names) < need or foot.pad.thickness is None:
        raise InvalidInput(
            f'{foot.source}: thickness and silicones of sheet{" and body" * (need - 1)} are'
            f' needed, as silicones: [ecoflex_00_20, dragon_skin_30]; not {list(names)}'
        )
    found = [Material.load(name) for name in names[:need]]
    for each in found:
        if each.casting is None:
            raise InvalidInput(f'{each.name}: how it is cast is missing: the key casting')
    return found[0], found[-1]


def _heights(made: Plan) -> dict[str, float]:
    use = made.set
    sheet = 1e3 * (made.foot.pad.thickness or 0.0)
    if made.process == 'large':
        bone = sheet + use['under']
        top = bone + use['bone']
        z = {'bone': bone, 'flange': top - use['flange'], 'top': top, 'face': top + 1.0}
        z |= {'stop': top, 'land': top + 0.8}
    else:
        top = 1e3 * made.foot.sole_thickness
        z = {'flange': top - 2.0, 'top': top, 'face': top, 'stop': top - 0.4, 'land': top - 0.4}
    return {'sheet': sheet, **z, 'roof': z['face'] + 2.0}


def _radii(made: Plan, reach: float) -> dict[str, float]:
    use, z, large = made.set, made.z, made.process == 'large'
    pad, sole = 1e3 * made.foot.pad.radius, 1e3 * made.foot.sole_radius
    root = pad + made.slope * (z['face'] - z['sheet'])
    bore = sole + made.slope * (z['flange'] - z['sheet'])
    plenum = reach + root + 1.0 if large else bore
    gasket = max(plenum + 2.0, bore) if large else bore + 3.0
    hole = 0.5 * use['screw'] + 0.2
    screws = gasket + 1.0 + use['wall'] + hole
    flange = screws + hole + 2.0
    r = {'pad': pad, 'root': root, 'sole': sole, 'bore': bore, 'plenum': plenum, 'gasket': gasket}
    r |= {'hole': pad + use['lining'], 'bone': sole - use['skin'], 'screw': hole, 'screws': screws}
    r['thread'] = hole - 0.45
    return r | {'flange': flange, 'outer': flange + use['clearance'] + 6.0}


def _least(made: Plan) -> float:
    """Return the least radius of the sole, mm, for walls between the pads and at the edge."""
    use, radius = made.set, 1e3 * made.foot.pad.radius
    if made.process == 'large':
        cell = 2.0 * (radius + use['lining']) + use['wall']
    else:
        long = 1e3 * (made.foot.sole_thickness - (made.foot.pad.thickness or 0.0))
        cell = 2.0 * (radius + made.slope * max(long, 0.0)) + use['web']
    shape = hexagonal(made.foot.pads)
    return cell * reach_of(shape - shape.mean(axis=0)) + radius + made.edge


def _limits(made: Plan) -> Iterator[tuple[str, float, float, float]]:
    """Yield lengths, mm, with their least and largest allowed value."""
    use, z, r = made.set, made.z, made.r
    least_pin = max(use['pin'], (z['face'] - z['sheet']) / use['slenderness'])
    yield 'the sheet, for its tolerance,', z['sheet'], 2.0 * use['tolerance'], 0.9 * r['pad']
    yield 'a pad, as a pin of resin, in diameter,', 2.0 * r['pad'], least_pin, math.inf
    yield 'wall', use['wall'], 2.0 * use['nozzle'], math.inf
    yield 'the largest part', 2.0 * r['outer'], 0.0, use['bed']
    yield 'fitting', use['fitting'], 0.0, 2.0 * (r['gasket'] - use['wall'])
    if made.process == 'large':
        lining, bone = use['lining'] - r['root'] + r['pad'], use['flange'] + 2.0
        yield 'lining, at the root of a pin,', lining, use['web'], math.inf
        yield 'skin', use['skin'], use['web'], math.inf
        yield 'under', use['under'], use['web'], math.inf
        yield 'a hole of the bone, in diameter,', 2.0 * r['hole'], use['hole'], math.inf
        yield 'bone', use['bone'], max(bone_needed(made), bone), math.inf
        yield 'flange', use['flange'], max(flange_needed(made), 1.0), math.inf
    else:
        # The retainer is 1.5 mm above the floor or more, and the bulge is at most a pad's radius.
        thick = (each for each in np.arange(3.0, 300.0, 0.1) if made.bulge(each) <= r['pad'])
        least = max(6.5, z['sheet'] + next(thick, 300.0))
        yield 'sole_thickness (a bone needs less)', z['top'], least, math.inf
        yield 'rim', use['rim'], 0.8, math.inf
    if use['mount_holes']:
        yield 'mount_circle, unless mount_holes = 0,', use['mount_circle'], *_mounts(made)


def _mounts(made: Plan) -> tuple[float, float]:
    """Return the least and the largest circle of the holes for the leg, mm in diameter."""
    use, r = made.set, made.r
    walls = use['mount_hole'] + 2.0 * use['wall']
    # The fitting is 4 mm wider than its hole, and there is a wall between two holes.
    apart = math.sin(math.pi / max(use['mount_holes'], 2.0))
    least = max(use['fitting'] + 4.0 + walls, (walls - use['wall']) / apart)
    return least, 2.0 * (r['screws'] - r['screw']) - walls


def _plate(pressure: float, radius: float, solid: float) -> float:
    """Return the thickness, mm, that a plate supported at its rim needs under a pressure, Pa.

    The stress in its middle is 3 (3 + ν)/8 p (radius/thickness)², over the share of a row of holes
    that is solid (ligament efficiency).
    """
    stress = 3.0 * (3.0 + _POISSON) / 8.0 * 1e-6 * pressure / solid
    return radius * math.sqrt(stress / STRENGTH)


def _worst(made: Plan) -> float:
    """Return the larger of the ceiling and the peak load over the sole, Pa."""
    load = made.set['load'] or 3.0 * made.foot.limits[-1]
    return max(made.foot.ceiling, load / made.foot.sole_area)


def bone_needed(made: Plan) -> float:
    """Return the least thickness of the bone, mm: a plate with holes, supported at its rim."""
    hole = 2e3 * made.foot.pad.radius + 2.0 * made.set['lining']
    solid = 1.0 - hole / made.pitch
    return _plate(_worst(made), 1e3 * made.foot.sole_radius - made.set['skin'], solid)


def flange_needed(made: Plan) -> float:
    """Return the least thickness of the bone's flange, mm: a beam from the screws to the bone."""
    line = 0.5e-6 * _worst(made) * made.r['bone']  # N/mm
    lever = made.r['screws'] - made.r['bone']
    return math.sqrt(6.0 * line * lever / STRENGTH)
