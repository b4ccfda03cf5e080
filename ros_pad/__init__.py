# SPDX-License-Identifier: Apache-2.0
"""Adaptive feet with inflatable pads: contact model, estimation, control, simulation, ROS 2."""

__version__ = '0.2.0'
