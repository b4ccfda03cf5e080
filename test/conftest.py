# SPDX-License-Identifier: Apache-2.0
"""What all tests have in common."""

import signal

# A shell has its background jobs ignore Ctrl-C, and they pass that on to what they start: here to
# the commands that tests interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
