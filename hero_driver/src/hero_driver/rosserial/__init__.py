"""The rosserial protocol as a pure core: bytes in, events out; commands in, bytes out.

Source: rosserial's protocol 2 as the robot's ros_lib speaks it (node_handle.h) and as measured on the stock robot.
"""
