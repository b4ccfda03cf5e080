# SPDX-License-Identifier: Apache-2.0
"""When a foot floods: the load at which water that climbs between its domes reaches the sole.

python when_a_foot_floods.py [picture.png]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
from ros_pad.capillary import Mesh, wet_pattern
from ros_pad.contact import WATER, Foot, force_limit, pads_in, press

FOOT, LIQUID, PRESSURES = 'large37', WATER, (70e3, 80e3, 90e3)  # <- your foot, liquid, Pa

pad = Foot.load(FOOT).pad
cell = 1.0 / pads_in(1.0, pad.radius)  # m2 of floor under each pad
figure, axes = plt.subplots(figsize=(5.0, 3.5), layout='constrained')
for number, pressure in enumerate(PRESSURES):
    loads = np.linspace(0.005, force_limit(pad, pressure), 25)
    pressed, levels = press(pad, pressure, loads), np.full(loads.size, np.nan)
    for k, load in enumerate(loads):
        dome = Mesh.dome(pressed.sphere_radius[k], pressed.contact_radius[k], pressed.gap[k])
        water = wet_pattern(dome, LIQUID, cell)
        levels[k] = water.height
        if water.status == 'saturated':
            depth = 1e3 * (pressed.gap[k] - dome.volume / cell)
            print(f'{pressure / 1e3:g} kPa: floods at {load:.3f} N, in {depth:.2f} mm of water')
            axes.plot(load, 1e3 * pressed.gap[k], f'C{number}o')
            break
    axes.plot(loads, 1e3 * pressed.gap, f'C{number}', label=f'sole at {pressure / 1e3:g} kPa')
    axes.plot(loads, 1e3 * levels, f'C{number}--', label='water between domes')
axes.set(xlabel='load of one pad [N]', ylabel='height above the floor [mm]', ylim=0)
axes.legend()
plt.savefig(sys.argv[1], dpi=200) if len(sys.argv) > 1 else plt.show()
