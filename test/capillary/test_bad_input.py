# SPDX-License-Identifier: Apache-2.0
"""Every argument of contact and capillary refuses what is no number, or out of range, by name."""

import math

import pytest

from ros_pad import capillary, contact
from ros_pad.contact import LARGE_PAD, WATER, Foot, Material, design
from ros_pad.contact.design import candidates
from ros_pad.errors import InvalidInput

RUBBER = Material.load('dragon_skin_10')
WALL = capillary.Wall.dome(1.55e-3, 0.583e-3, 2.9e-3)
MESH = capillary.Mesh.dome(1.55e-3, 0.583e-3, rings=6, sectors=12)
PRESSED = contact.press(LARGE_PAD, 75e3, 0.3)
DRY = contact.Liquid(0.073, 0.027, contact_angle=2.8)
ANGLES = {'advancing_angle': 1.5, 'receding_angle': 1.0}
TENSIONS = {'solid_tension': 0.027, 'surface_tension': 0.073}
DESIGN = {'load': 7.0, 'area': 9e-4, 'ceiling': 90e3, 'margin': 1.2}
DOME = {'sphere_radius': 1.5e-3, 'contact_radius': 0.5e-3, 'height': 1e-3}
PIECES = {'rings': 4, 'sectors': 12}

CASES = (
    (contact.inflate, {'pad': LARGE_PAD, 'pressure': 75e3}),
    (contact.press, {'pad': LARGE_PAD, 'pressure': 75e3, 'force': 0.1, 'model': 'thesis'}),
    (contact.force_limit, {'pad': LARGE_PAD, 'pressure': 75e3, 'criterion': 'thickness'}),
    (contact.pressure_for, {'pad': LARGE_PAD, 'force': 0.1, 'margin': 1.2}),
    (contact.Pad, {'radius': 1e-3, 'stiffness': 40.0, 'adhesion_energy': 0.0, 'thickness': 4e-4}),
    (contact.Pad.of, {'material': RUBBER, 'radius': 1e-3, 'thickness': 4e-4}),
    (contact.MeasuredLimit, {'force': 0.3, 'pressure': 75e3, 'slope': 1e-5}),
    (contact.contact_angle, TENSIONS),
    (contact.Liquid, TENSIONS | {'density': 1000.0, 'contact_angle': 1.0}),
    (contact.meniscus, {'pressed': contact.press(LARGE_PAD, 75e3, 0.1), 'liquid': WATER}),
    (contact.hysteresis_force, {'contact_radius': 1e-3, 'surface_tension': 0.073} | ANGLES),
    (contact.capillary_pull, {'radius': 1e-3, 'film': 1e-4, 'liquid': WATER, 'gravity': 9.8}),
    (
        contact.bridge,
        {'radius': 1e-3, 'surface_tension': 0.073, 'contact_angle': 0.5, 'filling_angle': 0.5}
        | {'separation': 0.0, 'plane_angle': 0.5},
    ),
    (
        contact.film_thickness,
        {'initial': 1e-4, 'contact_pressure': 1e3, 'patch_radius': 0.01, 'time': 0.1}
        | {'viscosity': 1e-3},
    ),
    (contact.HalfSpace, {'radius': 0.01, 'modulus': 2e6, 'curvature': 0.0}),
    (contact.Membrane, {'radius': 1.5e-3, 'tension': 40.0, 'pressure': 75e3}),
    (
        contact.squeeze,
        {'surface': contact.HalfSpace(0.01, 2e6), 'initial': 1e-4, 'time': [0.0, 0.1], 'load': 2.0}
        | {'viscosity': 1e-3, 'rise': 0.0, 'rings': 20, 'tolerance': 1e-4},
    ),
    (contact.trapped_film, {'radius': 0.01, 'modulus': 2e6, 'pressure': 6e3}),
    (
        contact.tangential_resistance,
        {'foot': Foot.load('large19'), 'load': 1.0, 'pressure': 75e3, 'dome_film': 0.0}
        | {'sole_film': 0.0},
    ),
    (contact.pads_in, {'area': 1e-3, 'radius': 1.5e-3}),
    (contact.rise_height, {'radius': 1.5e-3, 'liquid': WATER, 'cell': 8.0}),
    (design, DESIGN | {'pad': LARGE_PAD, 'pads': 37, 'criterion': 'thickness'}),
    (
        candidates,
        DESIGN | {'materials': [RUBBER], 'thicknesses': [4e-4], 'radius': 1.5e-3, 'pads': 37},
    ),
    (capillary.Wall.dome, DOME),
    (capillary.Wall.cone, {'contact_radius': 1e-3, 'inclination': 1.0, 'height': 1e-3}),
    (capillary.bath_meniscus, {'wall': WALL, 'liquid': WATER}),
    (
        capillary.press_wet,
        {'pad': LARGE_PAD, 'pressure': 75e3, 'force': 0.1, 'liquid': WATER},
    ),
    (capillary.Mesh.dome, DOME | PIECES),
    (
        capillary.Mesh.cone,
        {'contact_radius': 1e-3, 'top_radius': 1e-3, 'height': 1e-3} | PIECES,
    ),
    (capillary.Mesh.cylinder, {'radius': 1e-3, 'height': 1e-3}),
    (capillary.Mesh.dome_pattern, DOME | {'pads': 3, 'pitch': 4e-3}),
    (
        capillary.wet,
        {'mesh': MESH, 'liquid': WATER, 'balance': 'energy', 'layers': 10, 'slices': 3},
    ),
    (
        capillary.wet_pattern,
        {'mesh': MESH, 'liquid': WATER, 'area': 1e-4, 'pads': 1, 'balance': 'energy'}
        | {'layers': 10},
    ),
    (
        capillary.wet_surface,
        {'liquid': WATER, 'sectors': 12, 'refinements': 0, 'area': 1e-4, 'pad': MESH},
    ),
)


@pytest.mark.parametrize(
    ('function', 'good', 'name'),
    [
        pytest.param(function, good, name, id=f'{function.__qualname__}-{name}')
        for function, good in CASES
        for name in good
        if name not in ('materials', 'thicknesses')
    ],
)
def test_bad_values_are_named(function, good, name):
    word = 'mesh' if (function, name) == (capillary.wet_surface, 'pad') else name
    for value in (math.nan, 'much', -1.0, [0.1, math.nan]):
        with pytest.raises(InvalidInput, match=rf'{word}\b.* = .* (is|are) not allowed'):
            function(**good | {name: value})


BRIDGE = {'radius': 1e-3, 'surface_tension': 0.073, 'contact_angle': 0.5}
REFUSED = (
    (contact.press, {'pad': LARGE_PAD, 'pressure': [1e3, 2e3], 'force': [0.1] * 3}, 'broadcast'),
    (contact.pressure_for, {'pad': LARGE_PAD, 'force': [0.1] * 2, 'margin': [1.0] * 3}, 'broadc'),
    (contact.capillary_pull, {'radius': [1.0] * 2, 'film': [1e-4] * 3, 'liquid': WATER}, 'broadc'),
    (contact.capillary_pull, {'radius': 1e-3, 'film': 6e-3, 'liquid': WATER}, r'up to 0\.0054'),
    (contact.bridge, BRIDGE, 'exactly one'),
    (contact.bridge, BRIDGE | {'filling_angle': math.pi}, 'filling_angle'),
    (contact.bridge, BRIDGE | {'volume': 0.0, 'method': 'young_laplace'}, 'volume'),
    (contact.bridge, BRIDGE | {'filling_angle': 0.5, 'method': 'toroid'}, 'young_laplace, circle'),
    (contact.bridge, BRIDGE | {'filling_angle': 0.5, 'gravity': 9.81}, 'gravity'),
    (contact.meniscus, {'pressed': PRESSED, 'liquid': WATER, 'reading': 'printed'}, 'corrected, '),
    (contact.meniscus, {'pressed': PRESSED, 'liquid': DRY}, 'contact_angle'),
    (capillary.Wall.dome, {'sphere_radius': 1e-3, 'contact_radius': 1e-3}, 'contact_radius'),
    (capillary.Wall.dome, DOME | {'height': 4e-3}, 'height'),
    (capillary.Wall.cone, {'contact_radius': 1e-3, 'inclination': 0.0}, 'inclination'),
    (capillary.Wall.through, {'radii': [1e-3], 'heights': [0.0]}, 'radii'),
    (capillary.Wall.through, {'radii': [1e-3, 1e-3], 'heights': [1e-3, 0.0]}, 'heights'),
    (capillary.wet, {'mesh': MESH, 'liquid': WATER, 'axis': (0.0, math.nan)}, 'axis = nan'),
    (capillary.wet_surface, {'pad': capillary.Wall.cylinder(1e-3), 'liquid': WATER}, 'wall.top'),
    (capillary.wet_surface, {'pad': WALL, 'liquid': WATER, 'area': 7e-6}, 'area'),
)


@pytest.mark.parametrize(('function', 'given', 'words'), REFUSED)
def test_values_that_do_not_fit_together_are_refused(function, given, words):
    with pytest.raises(InvalidInput, match=words):
        function(**given)
