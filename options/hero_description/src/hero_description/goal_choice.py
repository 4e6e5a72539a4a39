"""Sends RViz's goals to the robot that was clicked.

RViz gives all its goal tools one name, so one for each robot could not be told apart. Here "Publish Point" on a robot
selects it, a disc below it shows that, and "2D Nav Goal" is for the selected robot, on /hero_N/goal. Another program
drives there: go_to_goal of hero_examples.

    rosrun hero_description goal_choice _robots:=0-3
"""

import math
from typing import Dict, List, Optional

import rospy
import tf2_ros
from geometry_msgs.msg import PointStamped, PoseStamped
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from hero_node.parameters import Parameter, parse_explicit_ids
from hero_node.ros import Program, read_parameters

# As in displays.yaml.
CHOICE_TOPIC = "/hero_choice/chosen"
POINT_TOPIC = "/hero_choice/point"
GOAL_TOPIC = "/hero_choice/goal"

LISTEN_S = 0.5
"""Time of listening to /tf after a click; reading a swarm's /tf all the time would cost too much."""

REACH_M = 0.15
"""A click farther from a robot's center selects none."""

DISC_DIAMETER_M = 0.11
GROUND_Z_M = -0.00912
"""Height of the ground in base_link (urdf/hero.urdf: axle height less wheel radius)."""

CHOSEN = ColorRGBA(0.05, 0.45, 0.95, 0.7)


class GoalChoice:
    """The chosen robot, and where goals go."""

    def __init__(self, names: List[str]) -> None:
        self._names = names
        self._chosen = names[0]
        self._publishers: Dict[str, rospy.Publisher] = {
            name: rospy.Publisher(f"/{name}/goal", PoseStamped, queue_size=2) for name in names
        }
        self._markers = rospy.Publisher(CHOICE_TOPIC, MarkerArray, queue_size=2, latch=True)
        rospy.Subscriber(POINT_TOPIC, PointStamped, self._receive_point, queue_size=2)
        rospy.Subscriber(GOAL_TOPIC, PoseStamped, self._receive_goal, queue_size=2)
        self._show()

    def _receive_point(self, point: PointStamped) -> None:
        nearest = self._find_nearest(point)
        if nearest is None:
            rospy.logwarn("no robot where you clicked; goals go to %s", self._chosen)
            return
        self._chosen = nearest
        rospy.loginfo("goals go to %s", nearest)
        self._show()

    def _receive_goal(self, goal: PoseStamped) -> None:
        publisher = self._publishers[self._chosen]
        if not publisher.get_num_connections():
            rospy.logwarn(
                'no program takes goals for %s: roslaunch hero_examples go_to_goal.launch robots:="%s"',
                self._chosen,
                self._chosen.rpartition("_")[2],
            )
        publisher.publish(goal)

    def _find_nearest(self, point: PointStamped) -> Optional[str]:
        """Return the robot at a point, None if there is none."""
        buffer = tf2_ros.Buffer(debug=False)
        listener = tf2_ros.TransformListener(buffer, queue_size=100, tcp_nodelay=True)
        rospy.sleep(LISTEN_S)
        listener.unregister()
        distances_m = {}
        for name in self._names:
            try:
                transform = buffer.lookup_transform(point.header.frame_id, name + "/base_link", rospy.Time(0))
            except tf2_ros.TransformException as error:
                rospy.logdebug("no transform to %s: %s", name, error)
                continue
            position = transform.transform.translation
            distances_m[name] = math.hypot(position.x - point.point.x, position.y - point.point.y)
        nearest = min(distances_m, key=lambda name: distances_m[name], default=None)
        return nearest if nearest is not None and distances_m[nearest] < REACH_M else None

    def _show(self) -> None:
        disc = Marker(type=Marker.CYLINDER, ns="chosen", frame_locked=True, color=CHOSEN)
        disc.header.frame_id = self._chosen + "/base_link"
        disc.pose.position.z = GROUND_Z_M
        disc.pose.orientation.w = 1.0
        disc.scale.x = disc.scale.y = DISC_DIAMETER_M
        disc.scale.z = 0.001
        self._markers.publish(MarkerArray([disc]))


def main() -> None:
    """Run until the node is to end."""
    with Program("goal_choice") as program:
        robots = read_parameters({"robots": Parameter("0", parse_explicit_ids)})["robots"]
        GoalChoice(["hero_%d" % robot_id for robot_id in robots])
        while program.sleep(10.0):
            pass
