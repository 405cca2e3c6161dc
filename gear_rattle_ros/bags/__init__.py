"""
Bags: MCAP directories as rosbag2 of Jazzy writes them, without any ROS.

Times are nanoseconds since the epoch, sizes and places in a file are bytes.
"""

from .bag_file import COMPRESSIONS
from .clouds import CloudDecoder
from .order import Message
from .reader import Bag, read_bag
from .topics import BagError, message_definition, Topic
from .writer import BagWriter

__all__ = [
    'Bag', 'BagError', 'BagWriter', 'CloudDecoder', 'COMPRESSIONS', 'Message',
    'message_definition', 'read_bag', 'Topic',
]
