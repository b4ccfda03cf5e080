# SPDX-License-Identifier: Apache-2.0
"""Studies of nodes, drivers and parsers under load, with faults and with invalid input."""
