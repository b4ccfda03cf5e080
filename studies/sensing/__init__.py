# SPDX-License-Identifier: Apache-2.0
"""How well body and feet are estimated from IMU, joints and forces."""
