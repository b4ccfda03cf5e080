# SPDX-License-Identifier: Apache-2.0
"""The physical terms of a scene: which of them a trial has, which it leaves out, and why.

A term is compared with the scene's accuracy by its effect on the distance. Most act on the
friction of the feet: the bound of how much five per cent of friction change the distance, measured
on random scenes as the errors of the levels are, converts them.
"""

