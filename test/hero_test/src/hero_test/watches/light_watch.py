"""The lights of simulated robots, from the simulator's markers."""

import rospy
from visualization_msgs.msg import MarkerArray


class LightWatch:
    """The newest color of each robot, by its place in the simulator (its id, where the first is hero_0)."""

    def __init__(self):
        self.colors = {}
        self.rows = []
        self.subscriber = rospy.Subscriber("/hero_sim/markers", MarkerArray, self.receive, queue_size=10)

    def receive(self, message):
        bodies = [marker for marker in message.markers if marker.ns == "robots"]
        self.colors = {marker.id: (marker.color.r, marker.color.g, marker.color.b) for marker in bodies}
        if bodies:
            self.rows.append((bodies[0].header.stamp.to_sec(), dict(self.colors)))

    def is_lit(self, robot_id, color):
        """Return whether the robot shows this color, each part 0..1."""
        shown = self.colors.get(robot_id)
        return shown is not None and max(abs(a - b) for a, b in zip(shown, color)) < 0.01

    def close(self):
        self.subscriber.unregister()
