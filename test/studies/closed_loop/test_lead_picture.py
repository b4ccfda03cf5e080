# SPDX-License-Identifier: Apache-2.0
"""The picture at the top of the README."""

import dataclasses
import io

import matplotlib.image
import numpy as np
import pytest

from ros_pad.reports import style
from ros_pad.simulation import Scene
from ros_pad.trials import run
from studies.closed_loop.lead_picture import lead_picture


@pytest.mark.slow
def test_lead_picture(tmp_path):
    walk = run(dataclasses.replace(Scene.load('hexapod_patches'), cycles=30), 'adaptive', seed=0)
    trials = [walk, dataclasses.replace(walk, policy='flat')]
    path = tmp_path / 'lead.png'
    lead_picture(trials, path)
    data = path.read_bytes()
    assert len(data) < 400_000
    picture = matplotlib.image.imread(io.BytesIO(data))
    height, width, _ = picture.shape
    assert width == 1600 and 300 < height < 1200
    colours = {tuple(pixel) for pixel in np.round(255 * picture[..., :3]).reshape(-1, 3).tolist()}
    for colour in (style.WET, style.BLUE, style.VERMILION):
        assert tuple(float(int(colour[k : k + 2], 16)) for k in (1, 3, 5)) in colours
