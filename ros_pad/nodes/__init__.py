# SPDX-License-Identifier: Apache-2.0
"""The rclpy nodes: each passes parameters and messages to the core, and publishes the results."""
