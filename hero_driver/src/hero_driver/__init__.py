"""The gateway between HeRo robots (rosserial over TCP) and ROS; `rosserial` is pure protocol, the rest is the node."""
