"""What runs behaviours on robots and in the real-time simulator: everything that imports rospy."""
