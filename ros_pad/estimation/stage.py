# SPDX-License-Identifier: Apache-2.0
"""TEMPORARY."""
from __future__ import annotations

import math

import numpy as np

from ros_pad.configuration import Setting
from ros_pad.estimation import doubt as doubts
from ros_pad.estimation.feet import FeetEstimator
from ros_pad.pace import CONTROL_PERIOD_NS
from ros_pad.pace import Pace
from ros_pad.records import ESTIMATE
from ros_pad.records import Block

PUBLISH_RATE = Setting(
    'publish_rate', 1e9 / CONTROL_PERIOD_NS, 'Estimates a second.', 'Hz', 5.0, 1000.0
)


class EstimationStage:
    def __init__(self, foot, expected_load, tuning, legs, period_ns=CONTROL_PERIOD_NS, reject=None):
        self.estimator = FeetEstimator(len(legs), foot, expected_load, tuning)
        self.estimator.shared = self.estimator.grounds.shared
        self.estimator.noise_texts = lambda i: (self.estimator.tracks[i].watch.noise.position.text('m'), self.estimator.tracks[i].watch.noise.force.text('N'))
        self.n = len(legs)
        self.joints = tuning.source == 'joints'
        self.pace = Pace(period_ns)
        self.pressures = [0.0] * self.n
        self.samples = 0
        self.last_ns = 0
        self.used = np.zeros(self.n, int)
        self._load = [-math.inf] * self.n
        self._pos = [(math.nan, math.nan)] * self.n
        self._any = [False] * self.n

    def pressure(self, rows):
        for i, p in enumerate(rows['pressure'].tolist()):
            if abs(p) <= 1e7:
                self.pressures[i] = p

    def process(self, block):
        out = []
        start = 0
        stamps = block.stamps.tolist()
        for k, s in enumerate(stamps):
            if self.pace.due(s):
                self._take(stamps[start:k + 1], block.rows[start:k + 1])
                start = k + 1
                out.append(self.estimate(s))
                self._load = [-math.inf] * self.n
                self._pos = [(math.nan, math.nan)] * self.n
        if start < len(stamps):
            self._take(stamps[start:], block.rows[start:])
        return out

    def _take(self, stamps, rows):
        numbers = rows.view('f8').reshape(len(stamps), self.n, -1).transpose(1, 0, 2).tolist()
        times = [s * 1e-9 for s in stamps]
        samples = []
        for i, mine in enumerate(numbers):
            got = []
            for s in mine:
                if s[0] != s[0] or s[4] != s[4] or (self.joints and s[7] != s[7]):
                    got.append(None)
                else:
                    got.append(tuple(s))
                    self._load[i] = max(self._load[i], s[2])
                    self._pos[i] = (s[4], s[5])
                    self._any[i] = True
            samples.append(got)
        self.estimator.update(times, samples, self.pressures)
        self.samples += len(stamps)
        self.last_ns = stamps[-1]

    def estimate(self, stamp):
        rows = ESTIMATE.rows(self.n)
        g = self.estimator.grounds
        for i, t in enumerate(self.estimator.tracks):
            d = g.doubts[i]
            st = t.last
            standing = t.gate.stands and t.sound
            rows[i] = (self._pos[i], self._load[i] if self._load[i] > -math.inf else math.nan,
                st.slip_velocity if standing and st else (0., 0.), st.slip_speed if standing and st else 0., t.slip.sd,
                float(standing and st is not None and st.slipping), *g.beliefs[i], t.margin, d.code, (d.a, d.b))
        return Block.of(stamp, rows)

    def tick(self, now):
        pass
