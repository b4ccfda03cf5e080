# SPDX-License-Identifier: Apache-2.0
"""Studies that measure the claims of ros_pad. Not installed with it."""
