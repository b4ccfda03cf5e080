# SPDX-License-Identifier: Apache-2.0
"""The way of one force through the code is as docs/architecture.md has it."""

import dataclasses
import pathlib
import re
import sys

import pytest

PAGE = pathlib.Path(__file__).resolve().parents[1] / 'docs' / 'architecture.md'


def steps():
    listed = PAGE.read_text().split('<!-- path:begin -->')[1].split('<!-- path:end -->')[0]
    return re.findall(r'^\d+\. `([\w.]+)`', listed, re.MULTILINE)


def test_a_force_becomes_a_pressure_on_the_way_that_the_page_shows(tmp_path, monkeypatch):
    composed = pytest.importorskip('ros_pad.nodes.composed')
    from ros_pad.simulation.scene import Scene

    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'OFF')
    wanted, called = steps(), []
    assert len(wanted) == 10

    def note(frame, event, _):
        if event == 'call' and frame.f_code.co_qualname in wanted:
            called.append(frame.f_code.co_qualname)

    scene = dataclasses.replace(Scene.load('hexapod_patches'), cycles=1)
    sys.setprofile(note)
    try:
        composed.run(scene, 'dome', bag=tmp_path / 'bag')
    finally:
        sys.setprofile(None)
    # From the beginning of a control period to its valve: what was called, in order.
    valves = [place for place, name in enumerate(called) if name == wanted[-1]]
    start = called.index(wanted[0], valves[len(valves) // 2])
    end = called.index(wanted[-1], start)
    assert list(dict.fromkeys(called[start : end + 1])) == wanted
