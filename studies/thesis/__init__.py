# SPDX-License-Identifier: Apache-2.0
"""Figures and claims of the thesis, drawn from the models and compared with them."""
