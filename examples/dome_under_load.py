# SPDX-License-Identifier: Apache-2.0
"""A dome under load: its gap and its contact on the way to the force limit, beside measurements.

python dome_under_load.py [picture.png]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
from ros_pad.configuration import shared_folder
from ros_pad.contact import LARGE_PAD, Measurements, force_limit, inflate, press

PAD, MEASURED = LARGE_PAD, shared_folder() / 'measurements/thesis.csv'  # <- your pad and CSV file

points = Measurements.read(MEASURED).pressed
pressure = points.pressure[0]
limit = force_limit(PAD, pressure)
loads = np.linspace(0.0, limit, 200)
domes = press(PAD, pressure, loads)
print(f'free dome: {1e3 * inflate(PAD, pressure).height:.3f} mm at {pressure / 1e3:g} kPa')
print(f'force limit: {limit:.3f} N, gap {1e3 * domes.gap[-1]:.3f} mm')
for load, gap in zip(points.force, points.height - points.depth, strict=True):
    at_load = press(PAD, pressure, load).gap
    print(f'{load:.3f} N: gap {1e3 * at_load:.3f} mm, measured {1e3 * gap:.3f} mm')

figure, axes = plt.subplots(figsize=(5.0, 3.5), layout='constrained')
axes.plot(loads, 1e3 * domes.gap, 'C0', label='gap under the rim')
axes.plot(loads, 1e3 * domes.contact_radius, 'C1', label='contact radius')
axes.plot(points.force, 1e3 * (points.height - points.depth), 'C0o', label='measured')
axes.plot(points.force, 1e3 * points.contact_radius, 'C1o')
axes.set(xlabel='load of one pad [N]', ylabel='length [mm]', title=f'{pressure / 1e3:g} kPa')
axes.legend()
plt.savefig(sys.argv[1], dpi=200) if len(sys.argv) > 1 else plt.show()
