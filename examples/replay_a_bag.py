# SPDX-License-Identifier: Apache-2.0
"""Somebody's bag with other parameters: what the feet would have estimated and decided.

python replay_a_bag.py [picture.png]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
from ros_pad.bags import BagReader
from ros_pad.trials import NodeSettings, replay

BAG = Path(__file__).resolve().parents[1] / 'bags/hexapod_patches/bag'  # <- your bag
CHANGES = {'wet_prior': 0.2}  # names as on the page of the parameters

bag = BagReader(BAG)
found = replay(bag, NodeSettings.of(bag).changed(CHANGES))
print(f'{found.duration_s:.2f} s of legs {found.legs} with {CHANGES}; compared: {found.verdict}')
for leg in found.outcomes:
    (wet_was, wet), (was, switches) = leg.wet_ends, leg.switches
    print(f'leg {leg.leg}: wet stances {wet_was} -> {wet}, switches {was} -> {switches}')

figure = plt.figure(figsize=(6, 6), layout='constrained')
panels = figure.subplots(len(found.legs), squeeze=False, sharex=True)[:, 0]
for axes, leg in zip(panels, found.legs):
    for tracks, label in ((found.recorded, 'recorded'), (found.replayed, 'replayed')):
        wetness = tracks[leg, 'wetness']
        time = [1e-9 * (each - found.start_ns) for each in wetness.times]
        axes.plot(time, wetness.values, label=label)
    axes.set(ylabel=f'leg {leg}', ylim=(-0.05, 1.05))
panels[0].set(title='probability that the ground is wet')
figure.legend(*axes.get_legend_handles_labels(), loc='outside lower center', ncols=2)
panels[-1].set(xlabel='time [s]')
plt.savefig(sys.argv[1], dpi=200) if len(sys.argv) > 1 else plt.show()
