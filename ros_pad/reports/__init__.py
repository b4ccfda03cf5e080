# SPDX-License-Identifier: Apache-2.0
"""Pages and pictures of trials, sweeps, replays, designs and calibrations."""
