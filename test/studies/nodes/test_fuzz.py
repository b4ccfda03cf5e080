# SPDX-License-Identifier: Apache-2.0
"""The targets of the study fuzz fit the code that they call; no search is made here."""

import pytest

from ros_pad.errors import ConfigError
from studies.nodes import fuzz


@pytest.mark.parametrize('name', fuzz.TARGETS)
def test_every_seed_is_read_and_the_first_one_to_its_end(name):
    target = fuzz.target(name)
    assert target.seeds
    for seed in target.seeds:
        target(seed)  # it catches errors of ros_pad and raises others
    target.feed(target.seeds[0])  # it raises errors of ros_pad, too
    target(b'')


def test_what_is_no_error_of_ours_is_found():
    def fail(data):
        raise {b'ours': ConfigError, b'other': ZeroDivisionError}[data]

    target = fuzz.Target(fail, [])
    target(b'ours')
    with pytest.raises(ZeroDivisionError):
        target(b'other')
