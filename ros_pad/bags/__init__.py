# SPDX-License-Identifier: Apache-2.0
"""Bags: recorded trials in the format of rosbag2 of ROS 2 Jazzy, read and written without ROS.

A bag is a folder with ``metadata.yaml`` (version 9) and one MCAP file (profile ``ros2``, CDR
messages, ``ros2msg`` schemas). Times are nanoseconds on the clock of the trial: simulated time
where the nodes use ``/clock``, else the time of day.
"""

from ros_pad.bags.metadata import annotate
from ros_pad.bags.reader import BagReader
from ros_pad.bags.recovery import Repair, repair
from ros_pad.bags.writer import BagWriter

__all__ = ['BagReader', 'BagWriter', 'Repair', 'annotate', 'repair']
