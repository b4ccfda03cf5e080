# SPDX-License-Identifier: Apache-2.0
"""The printed parts of a foot and of its moulds, its silicone and its air, as solids.

Cuts overlap: two that end in one plane would leave a film between them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple, TypeAlias

from ros_pad.errors import PadError
from ros_pad.making.plan import Plan

Solid: TypeAlias = Any
"""A `manifold3d.Manifold`, which has no types."""

_OVER = 0.5  # mm by which a cut goes beyond what it cuts
_PLATE, _VENT = 5.0, 0.3  # mm


class Part(NamedTuple):
    """A printed part, a cast body or the air.

    Attributes
    ----------
    name : str
    solid : Solid
        Where it is in the mould or in the foot, mm.
    made : str
        ``filament``, ``resin``, the name of a material, or ``air``.
    leaves : int
        Direction along z in which it leaves the cast or the foot: 1, -1, or 0 for none.
    flip : bool
        Whether it is printed upside down.
    bed : str
        How it lies on the bed, in words.
    """

    name: str
    solid: Solid
    made: str
    leaves: int = 0
    flip: bool = False
    bed: str = ''


def build(made: Plan) -> dict[str, Part]:
    """Return all parts by name.

    Raises
    ------
    PadError
        When manifold3d is not installed.
    """
    try:
        import manifold3d
    except ImportError as error:
        raise PadError(f"manifold3d is missing ({error}): pip install 'ros_pad[make]'") from error
    parts = _Builder(made, manifold3d.Manifold).parts()
    for part in parts.values():
        if part.solid.is_empty() or part.solid.status() != manifold3d.Error.NoError:
            raise PadError(f'{made.foot.source}: {part.name} has no volume with these settings')
    return parts


class _Builder:
    """Makes solids from the dimensions of a plan."""

    def __init__(self, made: Plan, kind: Any) -> None:
        self.made, self.kind = made, kind
        self.z, self.r, self.gap = made.z, made.r, made.set['clearance']
        self.slope = made.slope
        self.large = made.process == 'large'

    def disc(self, radius: float, low: float, high: float, top: float | None = None) -> Solid:
        """Return a disc or cone about the z axis."""
        sides = 8 * max(4, min(32, math.ceil(radius * 0.6 + 1.5)))
        end = radius if top is None else top
        return self.kind.cylinder(high - low, radius, end, sides).translate((0.0, 0.0, low))

    def cut(self, radius: float, low: float, high: float) -> Solid:
        """Return a disc that goes beyond both ends, to be cut out."""
        return self.disc(radius, low - _OVER, high + _OVER)

    def at(self, solid: Solid, places: Iterable[Iterable[float]]) -> Solid:
        """Return copies of a solid at places that do not overlap."""
        return self.kind.compose([solid.translate((*place, 0.0)) for place in places])

    def around(self, solid: Solid, radius: float, count: int) -> Solid:
        """Return copies of a solid in equal steps on a circle."""
        turns = [2.0 * math.pi * k / count for k in range(count)]
        return self.at(solid, [(radius * math.cos(a), radius * math.sin(a)) for a in turns])

    def screws(self, name: str, low: float, high: float) -> Solid:
        """Return the holes of the screws, by the name of their radius."""
        return self.around(self.cut(self.r[name], low, high), self.r['screws'], self.made.screws)

    def pins(self, over: float) -> Solid:
        """Return the pins, which are chambers and channels of the cast, with longer roots."""
        low, high = self.z['sheet'], self.z['face'] + over
        pin = self.disc(self.r['pad'], low, high, self.r['root'] + self.slope * over)
        return self.at(pin, self.made.places.tolist())

    def seal(self, over: float = 0.0) -> Solid:
        """Return the silicone that seals, gasket on the bone or flange of the body, from lower."""
        low, radius = self.z['top' if self.large else 'flange'], self.r['gasket']
        return self.disc(
            radius + self.slope * over, low - over, self.z['face'], radius - self.slope
        )

    def bone(self) -> Solid:
        z, r = self.z, self.r
        solid = self.disc(r['bone'], z['bone'], z['top'])
        solid += self.disc(r['flange'], z['flange'], z['top'])
        solid -= self.at(self.cut(r['hole'], z['bone'], z['top']), self.made.places.tolist())
        return solid - self.screws('thread', z['flange'], z['top'])

    def parts(self) -> dict[str, Part]:
        """Return all parts."""
        z, r, sheet, body = self.z, self.r, self.made.sheet.name, self.made.body.name
        # Into the flange, of bone or silicone: they shall not end in one plane.
        over, end = r['bore'] + self.slope * _OVER, z['flange'] + _OVER
        cast = self.disc(r['sole'], z['sheet'], end, over) + self.seal()
        found = [
            Part('lid', self.lid(), 'filament', -1, False, 'flat'),
            Part('spacer', self.spacer(), 'film', -1, bed='cut from film by spacer.dxf'),
            Part('ring', self.ring(), 'filament', -1, bed='face with the groove down'),
            Part(
                'inner mould', self.inner(), 'resin', 1, True, 'plate down, pins without supports'
            ),
            Part('cap', self.cap(), 'filament', 1, True, 'flat top down, open side up'),
        ]
        if self.large:
            bone = self.bone()
            cast += self.disc(r['plenum'], z['bone'], z['top'] + _OVER)
            cast += self.disc(r['sole'], 0.0, z['sheet'] + 1e-3)
            cast -= bone + self.pins(_OVER)
            found += [Part('bone', bone, 'filament', 0, True, 'flange down')]
            found += [Part('silicone', cast, sheet)]
        else:
            found += [
                Part('retainer', self.retainer(), 'filament', -1, bed='flat face down'),
                Part('body', cast - self.pins(_OVER), body),
                Part('sheet', self.disc(r['sole'], 0.0, z['sheet']), sheet),
            ]
        air = self.pins(1e-3) + self.disc(r['plenum'], z['face'], z['roof'])
        air += self.disc(0.5 * self.made.set['fitting'], z['roof'] - 1e-3, z['cap'])
        return {each.name: each for each in [*found, Part('air', air, 'air')]}

    def inner(self) -> Solid:
        """Return the plate with pins; dowels hold the bone by its screw holes, pegs the ring."""
        z, r = self.z, self.r
        plate = self.disc(r['outer'], z['top'], z['face'] + _PLATE)
        if self.large:
            dowel = self.disc(r['thread'] - 0.5 * self.gap, z['flange'] + 0.5, z['face'] + 1.0)
            plate -= self.seal(_OVER)
            plate += self.around(dowel, r['screws'], 3)
        peg = self.disc(1.5, z['top'] - 3.0, z['top'] + 1.0)
        return plate + self.pins(_OVER) + self.at(peg, self.made.pegs(self.made.plate_angles))

    def ring(self) -> Solid:
        """Return the wall of the mould: its face is flush with the pins' ends."""
        z, r, low, up = self.z, self.r, self.z['sheet'], self.z['flange']
        # Above the flange of the bone there is air: it must not lift the ring.
        up -= 0.5 * self.gap if self.large else 0.0
        more = self.slope * _OVER
        wide = r['flange'] + self.gap if self.large else r['gasket']
        solid = self.disc(r['outer'], low, z['top']) - self.disc(wide, up, z['top'] + _OVER)
        solid -= self.disc(r['sole'] - more, low - _OVER, up + _OVER, r['bore'] + more)
        groove = self.disc(r['sole'] + 4.0, low - _OVER, low + 1.0)
        solid -= groove - self.disc(r['sole'] + 2.5, low - 1.0, low + 2.0)
        vent = self.kind.cube((3.5 + _OVER, 1.0, _VENT + _OVER), False)
        vent = vent.translate((r['sole'] - _OVER, -0.5, low - _OVER))
        for turn in range(12):
            solid -= vent.rotate((0.0, 0.0, 30.0 * turn + 10.0))
        socket = self.disc(1.5 + self.gap, z['top'] - 3.5, z['top'] + _OVER)
        solid -= self.at(socket, self.made.pegs(self.made.plate_angles))
        return solid - self.peg_holes(low, low + 4.0)

    def lid(self) -> Solid:
        """Return the flat plate that closes the mould on the floor's side."""
        thick = max(4.0, 0.12 * self.r['outer'])
        return self.disc(self.r['outer'], -thick, 0.0) - self.peg_holes(-thick, 0.0)

    def peg_holes(self, low: float, high: float) -> Solid:
        """Return the holes for the loose pegs of lid, spacer and ring: their faces stay flat."""
        hole = self.cut(1.5 + self.gap, low, high)
        return self.at(hole, self.made.pegs(self.made.lid_angles))

    def spacer(self) -> Solid:
        """Return the ring of film under the lid, as thick as the sheet: cut, not printed."""
        high, r = self.z['sheet'], self.r
        holes = self.cut(r['sole'], 0.0, high) + self.peg_holes(0.0, high)
        return self.disc(r['outer'], 0.0, high) - holes

    def cap(self) -> Solid:
        """Return plenum, sealing face, hole for the fitting, screws, and holes for the leg."""
        z, r, use = self.z, self.r, self.made.set
        solid = self.disc(r['flange'], z['stop'], z['cap']) - self.screws(
            'screw', z['stop'], z['cap']
        )
        if self.large:
            solid -= self.disc(r['gasket'] + 1.0, z['stop'] - _OVER, z['land'])
        solid -= self.disc(r['plenum'], z['stop'] - _OVER, z['roof'])
        solid -= self.disc(0.5 * use['fitting'], z['roof'] - 1e-3, z['cap'] + _OVER)
        if not use['mount_holes']:
            return solid
        hole = self.disc(0.5 * use['mount_hole'], z['cap'] - 4.5, z['cap'] + _OVER)
        return solid - self.around(hole, 0.5 * use['mount_circle'], int(use['mount_holes']))

    def retainer(self) -> Solid:
        """Return the ring under the body's flange, as high as the squeezed flange."""
        r, low, up = self.r, self.z['flange'] - 3.0, self.z['stop']
        solid = self.disc(r['flange'], low, up) - self.screws('thread', low, up)
        solid -= self.cut(r['bore'] + self.gap, low, up)
        return solid - self.disc(r['gasket'] + 1.0, self.z['flange'], up + _OVER)


def as_printed(part: Part) -> Solid:
    """Return the solid as it is printed, on z = 0."""
    # Corners nearer than single precision tells apart would leave cracks in an STL file.
    solid = part.solid.simplify(1e-4)
    if part.flip:
        solid = solid.rotate((180.0, 0.0, 0.0))
    return solid.translate((0.0, 0.0, -solid.bounding_box()[2]))
