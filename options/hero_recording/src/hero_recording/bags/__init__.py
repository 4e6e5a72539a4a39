"""Bags of robots: the topics in them, messages as rows of tables, reading with and without ROS, repair."""

from .bag_set import BagSet
from .tables import read_rows, to_seconds
from .topics import Message, find_robot_topic
