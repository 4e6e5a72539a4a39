"""Gives RViz the frames hero_N/true/... of simulated robots, where they truly are, and what they see from there.

    rosrun hero_description true_poses _robots:=0-3

The robots' own frames, hero_N/..., are where odometry believes them: drawn by these, robots stand in walls.
"""

import xml.etree.ElementTree as ElementTree
from contextlib import suppress
from typing import List

import rospy
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage
from tf2_ros import StaticTransformBroadcaster

from hero_node.parameters import Parameter, parse_explicit_ids
from hero_node.ros import Program, read_parameters

from .rviz_config import TRUE


def make_links(robot: str, urdf: str) -> List[TransformStamped]:
    """Return where the links of a robot are on its base, with wheels that do not turn."""
    transforms = []
    for joint in ElementTree.fromstring(urdf).iter("joint"):  # noqa: S314 - this package's own file
        parts = {part.tag: part.attrib for part in joint}
        header = Header(frame_id=f"{robot}/{TRUE}/{parts['parent']['link']}")
        place = Transform(Vector3(*map(float, parts["origin"]["xyz"].split())), Quaternion(w=1.0))
        transforms.append(TransformStamped(header, f"{robot}/{TRUE}/{parts['child']['link']}", place))
    return transforms


def make_base(robot: str, truth: Odometry) -> TransformStamped:
    """Return where the base of a robot truly is."""
    pose = truth.pose.pose
    place = Transform(Vector3(pose.position.x, pose.position.y, pose.position.z), pose.orientation)
    return TransformStamped(truth.header, f"{robot}/{TRUE}/base_link", place)


def main() -> None:
    """Pass on true poses and scans until the end."""
    with Program("true_poses") as program:
        robots = [
            "hero_%d" % number for number in read_parameters({"robots": Parameter("0", parse_explicit_ids)})["robots"]
        ]
        urdf = str(rospy.get_param("robot_description"))
        links = StaticTransformBroadcaster()
        links.sendTransform([transform for robot in robots for transform in make_links(robot, urdf)])
        frames = rospy.Publisher("/tf", TFMessage, queue_size=len(robots) + 10)

        def place(truth: Odometry, robot: str) -> None:
            with suppress(rospy.ROSException):  # while the node ends, its topics are closed
                frames.publish(TFMessage([make_base(robot, truth)]))

        def look(scan: LaserScan, seen: rospy.Publisher) -> None:
            robot, _, link = scan.header.frame_id.partition("/")
            scan.header.frame_id = f"{robot}/{TRUE}/{link}"
            # The newest pose there is: ground truth comes before the driver's scans, or a little later.
            scan.header.stamp = rospy.Time(0)
            with suppress(rospy.ROSException):
                seen.publish(scan)

        for robot in robots:
            seen = rospy.Publisher(f"/{robot}/{TRUE}/proximity", LaserScan, queue_size=2)
            rospy.Subscriber(f"/{robot}/ground_truth", Odometry, place, robot, queue_size=2)
            rospy.Subscriber(f"/{robot}/proximity", LaserScan, look, seen, queue_size=2)
        while program.running:
            program.sleep(1.0)
