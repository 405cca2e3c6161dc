"""Bags: MCAP directories as rosbag2 of Jazzy writes them, without any ROS."""

from .clouds import CloudDecoder
from .files import Message
from .reader import Bag
from .topics import BagError, message_definition, Topic
from .writer import BagWriter, COMPRESSIONS

__all__ = [
    'Bag', 'BagError', 'BagWriter', 'CloudDecoder', 'COMPRESSIONS', 'Message',
    'message_definition', 'Topic',
]
