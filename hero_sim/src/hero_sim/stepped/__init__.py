"""Robots stepped in process: firmware rules and driver corrections as arrays over robots, without bytes or sockets."""
