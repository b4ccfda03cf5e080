# SPDX-License-Identifier: Apache-2.0
"""Work-precision study of a walk: every fidelity level, and other methods."""
