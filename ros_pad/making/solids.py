# SPDX-License-Identifier: Apache-2.0
"""The printed parts of a foot and of its moulds, its silicone and its air, as solids.

Cuts overlap: two that end in one plane would leave a film between them.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable
from typing import Any, NamedTuple, TypeAlias

from ros_pad.errors import PadError
from ros_pad.making.plan import Plan

Solid: TypeAlias = Any
"""A `manifold3d.Manifold`, which has no types."""

_OVER = 0.5  # mm by which a cut goes beyond what it cuts
_LID, _PLATE, _VENT = 4.0, 5.0, 0.3  # mm


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
    """

    name: str
    solid: Solid
    made: str
    leaves: int = 0
    flip: bool = False


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
    return _Builder(made, manifold3d.Manifold).parts()


class _Builder:
    """Makes solids from the dimensions of a plan."""

    def __init__(self, made: Plan, kind: Any) -> None:
        self.made, self.kind = made, kind
        self.z, self.r = made.z, made.r
        self.slope = math.tan(math.radians(made.set['draft']))

    def disc(self, radius: float, low: float, high: float, top: float | None = None) -> Solid:
        """Return a disc or cone about the z axis."""
        sides = 8 * max(4, min(32, math.ceil(radius * 0.6 + 1.5)))
        end = radius if top is None else top
        return self.kind.cylinder(high - low, radius, end, sides).translate((0.0, 0.0, low))

    def at(self, solid: Solid, places: Iterable[tuple[float, float]]) -> Solid:
        """Return copies of a solid at places that do not overlap."""
        return self.kind.compose([solid.translate((x, y, 0.0)) for x, y in places])

    def around(self, solid: Solid, radius: float, angles: Iterable[float]) -> Solid:
        """Return copies of a solid on a circle, at angles in degrees."""
        turns = [math.radians(angle) for angle in angles]
        return self.at(solid, [(radius * math.cos(a), radius * math.sin(a)) for a in turns])

    @functools.cached_property
    def screw_angles(self) -> list[float]:
        return [360.0 * k / self.made.screws for k in range(self.made.screws)]

    @functools.cached_property
    def pins(self) -> Solid:
        """The pins, which are the chambers and channels of the cast."""
        low, high, pad = self.z['sheet'], self.z['face'], self.r['pad']
        return self.at(self.disc(pad, low, high, self.r['root']), self.made.places.tolist())

    @functools.cached_property
    def bone(self) -> Solid:
        z, r = self.z, self.r
        solid = self.disc(r['bone'], z['bone'], z['top']) + self.disc(
            r['flange'], z['flange'], z['top']
        )
        hole = self.disc(r['hole'], z['bone'] - _OVER, z['top'] + _OVER)
        solid -= self.at(hole, self.made.places.tolist())
        screw = self.disc(r['screw'], z['flange'] - _OVER, z['top'] + _OVER)
        return solid - self.around(screw, r['screws'], self.screw_angles)

    @functools.cached_property
    def outside(self) -> Solid:
        """The outside of the cast, without what is in it: sheet, wall with draft, gasket."""
        z, r = self.z, self.r
        # Into the flange, of bone or silicone: they shall not end in one plane.
        end = z['flange'] + _OVER
        wall = self.disc(r['sole'], z['sheet'], end, r['bore'] + self.slope * _OVER)
        if self.made.process == 'small':
            return wall + self.flange
        inside = self.disc(r['bone'], z['bone'], z['top'] + _OVER)
        return wall + inside + self.flange

    @functools.cached_property
    def flange(self) -> Solid:
        """The silicone that seals: a gasket on the bone, or the flange of the body."""
        z, r = self.z, self.r
        low = z['top'] if self.made.process == 'large' else z['flange']
        return self.disc(r['gasket'], low, z['face'], r['gasket'] - self.slope)

    @functools.cached_property
    def sheet(self) -> Solid:
        return self.disc(self.r['sole'], 0.0, self.z['sheet'])

    def parts(self) -> dict[str, Part]:
        """Return all parts."""
        large, body = self.made.process == 'large', self.outside - self.pins
        names = self.made.sheet.name, self.made.body.name
        found = [
            Part('lid', self.lid(), 'filament', -1, True),
            Part('spacer', self.spacer(), 'film', -1),
            Part('ring', self.ring(), 'filament', -1),
            Part('inner mould', self.inner(), 'resin', 1, True),
            Part('cap', self.cap(), 'filament', 1, True),
        ]
        if large:
            foot = (body - self.bone) + self.disc(self.r['sole'], 0.0, self.z['sheet'] + 1e-3)
            found += [Part('bone', self.bone, 'filament', 0, True)]
            found += [Part('silicone', foot - self.pins, names[0])]
        else:
            found += [Part('retainer', self.retainer(), 'filament', -1)]
            found += [Part('body', body, names[1]), Part('sheet', self.sheet, names[0])]
        found.append(Part('air', self.air(), 'air'))
        return {each.name: each for each in found}

    def inner(self) -> Solid:
        """Plate with the pins; dowels hold the bone (in its screw holes) and the ring."""
        z, r, gap = self.z, self.r, self.made.set['clearance']
        plate = self.disc(r['outer'], z['top'], z['face'] + _PLATE)
        if self.made.process == 'large':
            # By the flange's cone, so that it leaves the gasket.
            plate -= self.disc(
                r['gasket'] + self.slope * _OVER,
                z['top'] - _OVER,
                z['face'],
                r['gasket'] - self.slope,
            )
            dowel = self.disc(r['screw'] - 0.5 * gap, z['flange'] + 0.5, z['face'] + 1.0)
            plate += self.around(dowel, r['screws'], self.screw_angles[::2][:3])
        root = self.disc(r['pad'], z['sheet'], z['face'] + _OVER, r['root'] + self.slope * _OVER)
        plate += self.at(root, self.made.places.tolist())
        return plate + self.at(self.peg(z['top'], -1.0), self.made.pegs(self.made.plate_angles))

    def peg(self, level: float, up: float) -> Solid:
        """Return a peg of 3 mm that stands 3 mm above or below a face, into which it reaches."""
        ends = sorted((level + 3.0 * up, level - 1.0 * up))
        return self.disc(1.5, *ends)

    def socket(self, level: float, up: float) -> Solid:
        """Return the hole for a peg, 3.5 mm into a face that looks against ``up``."""
        ends = sorted((level + 3.5 * up, level - _OVER * up))
        return self.disc(1.5 + self.made.set['clearance'], *ends)

    def ring(self) -> Solid:
        """Return the wall of the mould: its face is flush with the pins' ends."""
        z, r, gap = self.z, self.r, self.made.set['clearance']
        low, up = z['sheet'], z['flange']
        solid = self.disc(r['outer'], low, z['top'])
        bore = self.disc(
            r['sole'] - self.slope * _OVER, low - _OVER, up + _OVER, r['bore'] + self.slope * _OVER
        )
        wide = r['flange'] + gap if self.made.process == 'large' else r['gasket']
        solid -= bore + self.disc(wide, up, z['top'] + _OVER)
        groove = self.disc(r['sole'] + 4.0, low - _OVER, low + 1.0)
        solid -= groove - self.disc(r['sole'] + 2.5, low - 1.0, low + 2.0)
        vent = self.kind.cube((3.5 + _OVER, 1.0, _VENT + _OVER), False)
        vent = vent.translate((r['sole'] - _OVER, -0.5, low - _OVER))
        for turn in range(12):
            solid -= vent.rotate((0.0, 0.0, 30.0 * turn + 10.0))
        solid -= self.at(self.socket(low, 1.0), self.made.pegs(self.made.lid_angles))
        return solid - self.at(self.socket(z['top'], -1.0), self.made.pegs(self.made.plate_angles))

    def lid(self) -> Solid:
        """Return the flat plate that closes the mould on the floor's side."""
        peg = self.disc(1.5, -1.0, self.z['sheet'] + 3.0)
        return self.disc(self.r['outer'], -_LID, 0.0) + self.at(
            peg, self.made.pegs(self.made.lid_angles)
        )

    def spacer(self) -> Solid:
        """Return the ring of film under the lid, as thick as the sheet: cut, not printed."""
        low, high = -_OVER, self.z['sheet'] + _OVER
        solid = self.disc(self.r['outer'], 0.0, self.z['sheet'])
        holes = self.disc(1.5 + self.made.set['clearance'], low, high)
        solid -= self.disc(self.r['sole'], low, high)
        return solid - self.at(holes, self.made.pegs(self.made.lid_angles))

    def cap(self) -> Solid:
        """Plenum, sealing face, hole for the fitting, screws, and holes for the leg."""
        z, r, use = self.z, self.r, self.made.set
        solid = self.disc(r['flange'], z['stop'], z['cap'])
        if self.made.process == 'large':
            solid -= self.disc(r['gasket'] + 1.0, z['stop'] - _OVER, z['land'])
        solid -= self.disc(r['plenum'], z['stop'] - _OVER, z['roof'])
        solid -= self.disc(0.5 * use['fitting'], z['roof'] - _OVER, z['cap'] + _OVER)
        screw = self.disc(r['screw'], z['stop'] - _OVER, z['cap'] + _OVER)
        solid -= self.around(screw, r['screws'], self.screw_angles)
        count = int(use['mount_holes']) if self.made.foot.pads > 1 else 0
        if not count:
            return solid
        hole = self.disc(0.5 * use['mount_hole'], z['cap'] - 4.5, z['cap'] + _OVER)
        angles = [360.0 * k / count + 15.0 for k in range(count)]
        return solid - self.around(hole, 0.5 * use['mount_circle'], angles)

    def retainer(self) -> Solid:
        """Return the ring under the body's flange, as high as the squeezed flange."""
        z, r, gap = self.z, self.r, self.made.set['clearance']
        low, up = z['flange'] - 3.0, z['stop']
        solid = self.disc(r['flange'], low, up) - self.disc(
            r['bore'] + gap, low - _OVER, up + _OVER
        )
        solid -= self.disc(r['gasket'] + 1.0, z['flange'], up + _OVER)
        screw = self.disc(r['screw'], low - _OVER, up + _OVER)
        return solid - self.around(screw, r['screws'], self.screw_angles)

    def air(self) -> Solid:
        """Chambers, channels, plenum and the hole for the fitting."""
        z, r = self.z, self.r
        pins = self.disc(r['pad'], z['sheet'], z['face'] + 1e-3, r['root'])
        chambers = self.at(pins, self.made.places.tolist())
        plenum = self.disc(r['plenum'], z['face'], z['roof'])
        inlet = self.disc(0.5 * self.made.set['fitting'], z['roof'] - 1e-3, z['cap'])
        return chambers + plenum + inlet


def as_printed(part: Part) -> Solid:
    """Return the solid as it is printed, on z = 0."""
    # Corners nearer than single precision tells apart would leave cracks in an STL file.
    solid = part.solid.simplify(1e-4)
    if part.flip:
        solid = solid.rotate((180.0, 0.0, 0.0))
    return solid.translate((0.0, 0.0, -solid.bounding_box()[2]))
