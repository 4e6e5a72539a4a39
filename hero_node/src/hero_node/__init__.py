"""What every node and program of the suite is made of. Only modules in `ros` import ROS."""
