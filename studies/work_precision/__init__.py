# SPDX-License-Identifier: Apache-2.0
"""Work-precision studies: time and error of several methods for one problem."""
