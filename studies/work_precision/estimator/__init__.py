# SPDX-License-Identifier: Apache-2.0
"""Work-precision study of slip alarms: delay, misses, false alarms and time of each method."""
