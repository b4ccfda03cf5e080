# SPDX-License-Identifier: Apache-2.0
import os
import signal
import threading
import time

import pytest
import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

from ros_pad.errors import ConfigError, InvalidInput, TransportError
from ros_pad.nodes.process import run


class Probe(Node):
    """Calls ``deed`` at its first tick, and records whether its context was valid at the end."""

    def __init__(self, deed, ends):
        super().__init__('probe', start_parameter_services=False)
        self._deed = deed
        self._ends = ends
        self.create_timer(0.001, self._tick)

    def _tick(self):
        deed, self._deed = self._deed, lambda: None
        deed()

    def destroy_node(self):
        # Only with a valid context can a node publish at its end.
        self._ends.append('in order' if rclpy.ok() else 'cut off')
        super().destroy_node()


def fail(error):
    raise error


@pytest.fixture
def perform():
    """Run a probe with a deed; return the exit status. The probe must always end in order."""

    def perform(deed):
        ends = []
        try:
            return run(lambda: Probe(deed, ends), [])
        finally:
            assert not rclpy.ok()
            assert ends == ['in order']

    return perform


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_an_orderly_end(perform, number, capfd):
    before = signal.getsignal(number)
    assert perform(lambda: signal.raise_signal(number)) == 0
    assert signal.getsignal(number) is before
    assert 'Traceback' not in capfd.readouterr().err


def test_a_signal_before_the_spin_ends_the_node_in_order():
    ends = []

    def make():
        signal.raise_signal(signal.SIGTERM)
        return Probe(lambda: fail(AssertionError), ends)

    assert run(make, []) == 0
    assert ends == ['in order']


def test_an_idle_node_ends_after_a_signal():
    """A spin that does not look for signals would last for ever."""

    def send():
        time.sleep(0.5)
        os.kill(os.getpid(), signal.SIGINT)

    def make():
        threading.Thread(target=send).start()
        return Node('idle', start_parameter_services=False)

    assert run(make, []) == 0


@pytest.mark.parametrize(
    ('error', 'status'),
    [(TransportError('the line broke'), 1), (InvalidInput('no'), 2), (ConfigError('no'), 2)],
)
def test_an_error_of_ours_has_the_last_word(perform, error, status, capfd):
    assert perform(lambda: fail(error)) == status
    assert capfd.readouterr().err.endswith(f'ros_pad: {error}\n')


def test_a_runtime_error_of_a_node_is_not_taken_for_bad_arguments(perform):
    with pytest.raises(RuntimeError, match='of its own'):
        perform(lambda: fail(RuntimeError('of its own')))


def test_a_node_that_ros_refuses_reports_the_reason(capfd):
    # As when SROS 2 is requested, but ROS 2 was built without it.
    assert run(lambda: fail(rclpy_implementation.RCLError('no security libraries')), []) == 1
    assert capfd.readouterr().err == (
        'ros_pad: ROS 2 cannot create the node: no security libraries:'
        ' pad doctor finds the cause\n'
    )
    assert not rclpy.ok()


@pytest.mark.parametrize('given', [('-p', 'rubbish'), ('--params-file', 'nowhere.yaml')])
def test_arguments_that_ros_cannot_read(capfd, given):
    assert run(lambda: fail(AssertionError), ['probe', '--ros-args', *given]) == 2
    assert given[1] in capfd.readouterr().err
