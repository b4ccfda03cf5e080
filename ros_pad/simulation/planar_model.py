# SPDX-License-Identifier: Apache-2.0
"""Constants of a planar walk, in named tuples and sequences, because numba takes no objects."""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

from ros_pad.contact.film import Film
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import CELL, WIDTH, Floor

# SI units; most have the names and meanings of the parts of a scene.
PlanarModel = namedtuple('PlanarModel', 'period settle gait trunk tow foot floor')

# overlap: share of the cycle in which load passes from foot to foot
PlanarGait = namedtuple(
    'PlanarGait', 'cycle stride duty lift reach pushes overlap middles heading_gain'
)

# centre_x, centre_y: of mass, in the body; weight: component normal to the floor; downhill:
# acceleration along -x; rocks: lets feet in a line carry the body, m², 0 if it must be in balance
PlanarTrunk = namedtuple(
    'PlanarTrunk',
    'home_x home_y centre_x centre_y mass inertia height weight downhill leg_stiffness rocks',
)

# dry, wet: drag, N, by the ground
PlanarTow = namedtuple('PlanarTow', 'mass dry wet distance height stiffness')

# capillary: tangential force of the liquid around all domes, N; cell, sole_drain: as of a Film;
# limits, spheres: force limits, N, and radii of domes, m, every limit_cell from 0 Pa
PlanarFoot = namedtuple(
    'PlanarFoot',
    'friction shear_strength conforming_pressure boundary_friction capillary critical_film'
    ' film_exponent shear_stiffness turning_radius sole_area sole_drain limit_cell limits spheres'
    ' pads cell viscosity',
)

# puddle: depth of standing liquid, m; wet, heights: maps, [row along y][column along x]
PlanarFloor = namedtuple(
    'PlanarFloor',
    'puddle wet wet_cell wet_x wet_y heights height_cell height_x height_y',
)


def model_of(scene: Scene, floor: Floor, period: float) -> PlanarModel:
    """Return the constants of a walk of a scene's robot on a floor."""
    (body, gait), tow, slope = scene.legged, scene.tow, scene.floor.slope
    foot = scene.foot.on_rough(scene.floor.roughness)
    film = Film(foot, scene.floor.viscosity)
    down, heights = GRAVITY * math.cos(slope), floor.heights
    rocks = 1e-9 * max(x * x + y * y for x, y in body.homes)
    return PlanarModel(
        period=period,
        settle=scene.settle,
        gait=_filled(PlanarGait, gait, reach=gait.reach(), heading_gain=scene.heading_gain),
        trunk=_filled(
            PlanarTrunk,
            body,
            home_x=tuple(x for x, _ in body.homes),
            home_y=tuple(y for _, y in body.homes),
            centre_x=float(body.robot.centre[0]),
            centre_y=float(body.robot.centre[1]),
            weight=body.mass * down,
            downhill=GRAVITY * math.sin(slope),
            rocks=0.0 if gait.fewest >= 3 and len(gait.middles) > 4 else rocks,
        ),
        tow=_filled(
            PlanarTow,
            tow,
            mass=tow.weight / GRAVITY,
            dry=tow.weight * tow.friction_dry * math.cos(slope),
            wet=tow.weight * tow.friction_wet * math.cos(slope),
        ),
        foot=_filled(
            PlanarFoot,
            foot,
            cell=film.cell,
            viscosity=film.viscosity,
            sole_drain=film.sole_drain,
        ),
        floor=PlanarFloor(
            puddle=floor.film_thickness,
            wet=floor.wet_map.tolist(),
            wet_cell=floor.cell,
            wet_x=floor.origin[0],
            wet_y=floor.origin[1],
            heights=[[0.0]] if heights is None else heights.tolist(),
            height_cell=CELL,
            height_x=-1.0,
            height_y=-WIDTH / 2.0,
        ),
    )


def _filled(kind: Any, owner: object, **known: Any) -> Any:
    """Return a named tuple of what is known, and of what an object has by the same names."""
    others = {name: getattr(owner, name) for name in kind._fields if name not in known}
    return kind(**known, **others)
