# SPDX-License-Identifier: Apache-2.0
"""The commands of ``pad``, one module each: its arguments, and what it does."""
