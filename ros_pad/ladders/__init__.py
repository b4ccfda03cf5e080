# SPDX-License-Identifier: Apache-2.0
"""Work-precision ladders: each way to solve a problem, timed and compared in one run."""
