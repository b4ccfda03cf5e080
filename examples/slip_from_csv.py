# SPDX-License-Identifier: Apache-2.0
"""Slip and wetness of one foot from a CSV file of forces and positions.

Columns, by name: t [s], fx, fy, fz [N] (of the ground on the foot), x, y, z [m] (of a marker on
the foot), pressure [Pa] (gauge). Run it: python slip_from_csv.py [picture.png]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from ros_pad.contact import Foot
from ros_pad.estimation import Estimate, FootEstimator

FILE, FOOT, LOAD = Path(__file__).with_name('slip.csv'), 'large37', 6.8  # <- your file, foot, N
data = np.genfromtxt(FILE, delimiter=',', names=True, usecols='t,fx,fy,fz,x,y,z,pressure')
time, estimator = data['t'], FootEstimator(Foot.load(FOOT), expected_load=LOAD)
rows = [estimator.update(t, (fx, fy, fz), (x, y, z), p) for t, fx, fy, fz, x, y, z, p in data]
found = {name: np.array(values) for name, *values in zip(Estimate._fields, *rows)}
moved = found['slip_velocity'] * (found['slipping'] * np.gradient(time))[:, None]
touch_downs = np.flatnonzero(np.diff(found['standing'].astype(int), prepend=0) > 0)
for begin, end in zip(touch_downs, [*touch_downs[1:], len(time)]):
    slip, wet = np.hypot(*moved[begin:end].sum(axis=0)), found['wet_probability'][end - 1]
    print(f'stance from {time[begin]:.2f} s: slip {1e3 * slip:.1f} mm, P(wet) {wet:.2f}', end=', ')
    print(rows[end - 1].doubt or 'no doubt')

figure, (top, low) = plt.subplots(2, figsize=(6.0, 4.5), sharex=True, layout='constrained')
speed, band = 1e3 * found['slip_speed'], 2e3 * found['slip_speed_sd']
top.fill_between(time, speed - band, speed + band, where=found['standing'], alpha=0.4, lw=0)
top.plot(time, np.where(found['slipping'], speed, np.nan), 'C3', label='slip alarm')
top.set(ylabel='slip speed [mm/s], ±2 sd')
top.legend(loc='upper right')
low.plot(time, found['wet_probability'])
low.set(xlabel='time [s]', ylabel='P(wet)', ylim=(-0.05, 1.05))
plt.savefig(sys.argv[1], dpi=200) if len(sys.argv) > 1 else plt.show()
