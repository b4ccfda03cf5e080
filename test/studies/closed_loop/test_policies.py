# SPDX-License-Identifier: Apache-2.0
import json
from dataclasses import replace

import pytest

from ros_pad.control.policies import Choice, LiftOff
from ros_pad.simulation import Scene
from studies.closed_loop import policies, rivals

STEP = LiftOff(1, 'flat', 9, False, 0.5, (0.0, 0.0), False)


def test_held_out_grounds_share_no_condition_with_tuning_grounds():
    values = {
        (part, name): {
            changes[part][name]
            for changes in policies.TUNING.values()
            if name in changes.get(part, {})
        }
        for part, name in (('floor', 'patch_length'), ('floor', 'wet_fraction'), ('tow', 'weight'))
    }
    for name, changes in policies.HELD_OUT.items():
        assert changes, name
        for part, changed in changes.items():
            for key, value in changed.items():
                assert value not in values.get((part, key), ()), name
                assert value != getattr(getattr(Scene.load(policies.SCENE), part), key), name


def test_ratio_by_hand():
    result = policies.ratio([100.0, 98.0], [100.0, 100.0])
    assert result == {'of_means': 0.99, 'low': 0.98, 'high': 1.0, 'least': 0.98, 'behind': 0.5}


def test_the_page_has_the_tables_of_the_last_run():
    document = json.loads((policies.command.CHARTS / 'policies.json').read_text())
    page = policies.PAGE.read_text()
    assert policies.command.pasted(page, policies.MARKS, policies.overall(document)) == page


def border(policy, morphology):
    """Return the least probability of wet ground, in hundredths, at which feet become domes."""
    steps = (replace(STEP, morphology=morphology, wet_ahead=each / 100.0) for each in range(101))
    return [policy(step) for step in steps].index(Choice('dome'))


def test_the_value_of_a_foot_where_each_step_is_on_new_ground():
    """By hand, with P(wet) = 0.9 at each step, loss 1, discount 0.99: a flat step gains 1 - 2 P.
    A dome becomes flat if that is worth two switches, 0.05 + 0.99 * 0.05; a flat foot becomes a
    dome one step later if it is worth 0.99 * 0.05 - 0.05."""
    policy = rivals.pomdp(loss=1.0, length=1e-3, share=0.9)
    assert border(policy, 'dome') == pytest.approx(100 * (1.0 - 0.0995) / 2.0, abs=1.0)
    assert border(policy, 'flat') == pytest.approx(100 * 1.0005 / 2.0, abs=1.0)
