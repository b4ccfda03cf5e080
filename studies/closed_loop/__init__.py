# SPDX-License-Identifier: Apache-2.0
"""Studies of the closed loop: effects of assumed numbers, policies, faults and recorded data."""
