# SPDX-License-Identifier: Apache-2.0
"""What a bag says of the trial in it, under one key of its ``custom_data``."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import ros_pad
from ros_pad.simulation import fidelity as ladder
from ros_pad.simulation.scene import Scene
from ros_pad.trials.trial import Metrics
from ros_pad.trials.trial import Trial

KEY = 'ros_pad'
AMBIENT_PRESSURE = 101325.0  # Pa, that simulated trials add to gauge pressures


def label(
    scene: Scene,
    policy: str,
    seed: int,
    fidelity: str,
    *,
    interrupted: bool = False,
    metrics: Metrics | None = None,
    real_time_factor: float | None = None,
    comparison: Sequence[dict[str, Any]] = (),
) -> dict[str, str]:
    """Return the custom data of a trial's bag.

    Parameters
    ----------
    scene, policy, seed, fidelity
        What was run.
    interrupted : bool
        Whether it was cut short.
    metrics, real_time_factor
        What came out, once it is known.
    comparison : sequence of dict
        Metrics of other policies on the same ground, each with its ``policy``.
    """
    return {
        KEY: json.dumps(
            {
                'scene': scene.source,
                'policy': policy,
                'seed': seed,
                'fidelity': fidelity,
                'floor': asdict(scene.floor),
                'ambient_pressure': AMBIENT_PRESSURE,
                'metrics': metrics.as_dict() if metrics else None,
                'real_time_factor': real_time_factor,
                'settings': settings(scene, policy, fidelity)
                | {
                    'interrupted': interrupted,
                    'comparison': list(comparison),
                },
            }
        )
    }


def promise(trial: Trial) -> str:
    """Return in words how far the distance of a trial can be trusted."""
    if trial.metrics is not None and trial.metrics.verdict:
        return f'the walk on {trial.fidelity} ended early, and nothing is promised for such walks'
    return str(trial.settings['fidelity_note'])


def settings(scene: Scene, policy: str, fidelity: str) -> dict[str, Any]:
    """Return what a reader of a trial needs to know of its scene, and of the rung it ran on."""
    choice = ladder.choose(scene, fidelity, policy)
    return {
        'foot': scene.foot.source,
        'expected_load': scene.expected_load,
        'stride_m': scene.stride,
        'cycle_s': scene.gait.cycle,
        'settle_s': scene.settle,
        'faults': [str(fault) for fault in scene.faults],
        # JSON knows no infinity.
        'fidelity_bound': choice.bound if choice.bound < math.inf else None,
        'fidelity_note': choice.note,
        'omitted': [asdict(each) for each in ladder.omitted(scene, choice.rung, policy)],
        'version': ros_pad.__version__,
    }
