# SPDX-License-Identifier: Apache-2.0
"""The rclpy nodes: parameters in, messages in, one call into the core, messages out."""
