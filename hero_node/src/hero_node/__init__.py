"""Common parts of all nodes and programs of the suite. Only modules in `ros` import ROS."""
