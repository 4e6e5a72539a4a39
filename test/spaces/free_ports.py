"""Prints two TCP ports on which nobody listens, for a ROS master and for robots."""

import socket

sockets = [socket.socket() for _ in range(2)]
for one in sockets:
    one.bind(("127.0.0.1", 0))
print(*(one.getsockname()[1] for one in sockets))
