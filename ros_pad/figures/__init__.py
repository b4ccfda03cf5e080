# SPDX-License-Identifier: Apache-2.0
"""Figures for papers: the thesis' own redrawn, design, calibration."""
