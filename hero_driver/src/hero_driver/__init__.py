"""The gateway between HeRo robots (rosserial over TCP) and ROS.

`hero_driver.rosserial` is pure protocol and needs neither ROS nor a network; everything else is the node.
"""
