# SPDX-License-Identifier: Apache-2.0
"""Pressure for a load: what a pad needs, with the interval that the doubt about its rubber leaves.

python pressure_for_a_load.py [picture.png]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
from ros_pad.configuration import shared_folder
from ros_pad.contact import Material, Measurements, Pad, force_limit, pressure_for

LOAD, RUBBER, RADIUS, THICKNESS = 0.18, 'dragon_skin_10', 1.5e-3, 0.4e-3  # <- your pad: N, m, m

rubber = Material.load(RUBBER)
soft, stiff = (Pad.of(rubber.times(f), RADIUS, THICKNESS) for f in rubber.factor_range)
low, high = pressure_for(soft, LOAD) / 1e3, pressure_for(stiff, LOAD) / 1e3
print(f'{LOAD:g} N needs {low:.1f} kPa of the softest, {high:.1f} kPa of the stiffest')
if np.isnan(force_limit(soft, [1e3 * high])[0]):
    print(f'at {high:.1f} kPa the softest has no force limit: measure how high your pads rise')

loads = np.linspace(0.01, 2.5 * LOAD, 200)
kpa = [pressure_for(pad, loads) / 1e3 for pad in (soft, stiff)]
limits = Measurements.read(shared_folder() / 'measurements/thesis.csv').force_limits
figure, axes = plt.subplots(figsize=(5.0, 3.5), layout='constrained')
axes.plot(loads, kpa[0], 'C0', label=f'softest {RUBBER}')
axes.plot(loads, kpa[1], 'C0--', label='stiffest')
axes.fill_between(loads, *kpa, alpha=0.2)
axes.plot([LOAD, LOAD], [low, high], 'C3_-', ms=10, label=f'{LOAD:g} N')
axes.plot(limits.force_limit, limits.pressure / 1e3, 'ko', label='measured in the thesis')
axes.set(xlabel='load of one pad [N]', ylabel='gauge pressure [kPa]', ylim=0)
axes.legend()
plt.savefig(sys.argv[1], dpi=200) if len(sys.argv) > 1 else plt.show()
