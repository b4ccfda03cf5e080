# SPDX-License-Identifier: Apache-2.0

from ros_pad.control.faults import KINDS, Kind, text


def test_codes_are_the_places_in_the_table():
    assert list(KINDS) == list(range(len(Kind)))
    assert not any(kind.numbers for kind in (Kind.NONE, Kind.DEVICE))
    for kind in Kind:
        used = [name for name in 'abpq' if f'{{{name}' in kind.template]
        assert not used or kind.numbers


def test_a_fault_is_text_for_people_and_three_numbers_for_records():
    fault = Kind.LEAK(45e3, 25e3)
    assert str(fault) == 'leaks or lacks air: 45.0 kPa, 25.0 kPa below the set-point'
    assert text(fault.kind.code, fault.a, fault.b) == str(fault)
    assert str(Kind.SILENCE(0.52, 70e3)) == 'no reading for 0.5 s, the last was 70.0 kPa'
