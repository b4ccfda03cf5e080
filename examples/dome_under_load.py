# SPDX-License-Identifier: Apache-2.0
"""A dome under load: its gap and its contact on the way to the force limit, beside measurements.

python dome_under_load.py [picture.png]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
from ros_pad.configuration import shared_folder
from ros_pad.contact import Foot, Measurements, force_limit, inflate, press

THESIS = shared_folder() / 'measurements/thesis.csv'
FOOT, FILE, PRESSURE = 'large37', THESIS, 75e3  # <- your foot, CSV file and pressure, Pa

pad = Foot.load(FOOT).pad
table = np.array(Measurements.read(FILE).pressed)
_, forces, heights, depths, radii, gaps = table[:, np.isclose(table[0], PRESSURE)]
gaps = np.where(np.isnan(gaps), heights - depths, gaps)
loads = np.linspace(0.0, force_limit(pad, PRESSURE), 200)
domes = press(pad, PRESSURE, loads)
print(f'free dome: {1e3 * inflate(pad, PRESSURE).height:.3f} mm at {PRESSURE / 1e3:g} kPa')
print(f'force limit: {loads[-1]:.3f} N, gap {1e3 * domes.gap[-1]:.3f} mm')
for load, at_load, gap in zip(forces, press(pad, PRESSURE, forces).gap, gaps, strict=True):
    print(f'{load:.3f} N: gap {1e3 * at_load:.3f} mm, measured {1e3 * gap:.3f} mm')

figure, axes = plt.subplots(figsize=(5.0, 3.5), layout='constrained')
axes.plot(loads, 1e3 * domes.gap, 'C0', label='gap under the rim')
axes.plot(loads, 1e3 * domes.contact_radius, 'C1', label='contact radius')
axes.plot(forces, 1e3 * gaps, 'C0o', label='measured')
axes.plot(forces, 1e3 * radii, 'C1o')
axes.set(xlabel='load of one pad [N]', ylabel='length [mm]', title=f'{PRESSURE / 1e3:g} kPa')
axes.legend()
plt.savefig(sys.argv[1], dpi=200) if len(sys.argv) > 1 else plt.show()
