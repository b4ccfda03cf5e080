# SPDX-License-Identifier: Apache-2.0
"""Feet that change shape: contact model, estimation, control, simulation and ROS 2 nodes."""

__version__ = '0.1.0'
