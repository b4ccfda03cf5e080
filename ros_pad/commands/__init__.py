# SPDX-License-Identifier: Apache-2.0
"""The commands of ``pad``: one module for each, with its arguments and its action."""
