"""Programs that run behaviors on robots and in the real-time simulator: everything that imports rospy."""
