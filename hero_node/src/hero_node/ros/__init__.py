"""ROS nodes that start, run and end without endless waits."""

from threading import Thread

from .connections import limit_xmlrpc_connections, open_tcpros_server
from .handshakes import HANDSHAKE
from .master import ask_master, check_master, find_running_node, read_master_uri
from .master_watch import MasterWatch
from .private_parameters import read_given, read_parameters
from .program import Program
from .ros_clock import ROS_CLOCK, read_duration_clock_s
from .ros_node import end_ros_node, init_ros_node
from .script import rate, start_node

# The rospy of Debian 11 calls it when a script ends; its Python 3.9 no longer has it.
if not hasattr(Thread, "isAlive"):
    setattr(Thread, "isAlive", Thread.is_alive)  # noqa: B010 - mypy knows no such method
