# SPDX-License-Identifier: Apache-2.0
"""Trials: the closed loop without ROS, its metrics, bags and reports."""
