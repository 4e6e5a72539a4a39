"""A robot over ROS: its topics and services under /hero_N, tf, and the drivers' reports."""

import math
import threading
from concurrent.futures import wait
from typing import Any, List, Optional, Tuple

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, LaserScan
from std_msgs.msg import ColorRGBA, Float32

from hero_msgs.msg import Encoder, Neighbors
from hero_msgs.srv import SetOdom
from hero_node import HeroError, Pose, Velocity, one_line, pose_of
from hero_node.files import name_fleet_file
from hero_node.robot_constants import HERO, MODELS, RobotModel
from hero_node.ros import ROS_CLOCK

from ..values.background_motion import BackgroundMotion, Steps, run_steps
from ..values.errors import RobotError, StaleDataError
from ..values.readings import FRESH_S, front_first
from ..values.robot_link import RobotLink
from ..values.sensing import Neighbor
from .drivers import share_drivers
from .extra_topics import find_class, load_fleet_file, read_field
from .frames import find_origin
from .localized_poses import share_poses
from .robot_topics import CommandTopic, NewestMessages

SERVICE_TIMEOUT_S = 2.0

END_TIMEOUT_S = 3.0
"""A cancelled motion ends within 0.3 s; one that hangs must not hang its robot's next motion."""

NEEDED = ("odom", "proximity")
"""Topics that a robot must send to be ready, if subscribed to; others, such as the IMU, it may lack."""

MESSAGE_CLASSES = {
    "odom": Odometry,
    "proximity": LaserScan,
    "laser": LaserScan,
    "encoder": Encoder,
    "imu": Imu,
    "neighbors": Neighbors,
    "distance": Float32,
}


class ThreadMotion(BackgroundMotion):
    """A motion on its own thread."""

    def __init__(self, steps: Steps) -> None:
        """Start it; it ends soon after a step was sent that it is not to continue."""
        super().__init__()
        self._cancelled = threading.Event()
        self.set_running_or_notify_cancel()
        threading.Thread(target=self._take_steps, args=(steps,), name="motion", daemon=True).start()

    def _take_steps(self, steps: Steps) -> None:
        try:
            run_steps(steps, self._sleep, ROS_CLOCK.sleep)
        except (HeroError, ValueError, TypeError, rospy.ROSException) as error:
            self.set_exception(error)
        else:
            self.set_result(None)

    def _sleep(self, duration_s: float) -> bool:
        return not self._cancelled.wait(duration_s) and not rospy.is_shutdown()

    def cancel(self) -> bool:
        self._cancelled.set()
        return not self.done()

    def cancel_and_wait(self) -> None:
        self.cancel()
        wait([self], END_TIMEOUT_S)


class RosLink(NewestMessages, RobotLink):
    """One robot over ROS; needs a started node."""

    clock = ROS_CLOCK

    def __init__(self, robot_id: int) -> None:
        """Advertise the commands to the robot with this number."""
        self._robot_id = robot_id
        self._name = "hero_%d" % robot_id
        self._extras = {topic.name: topic for topic in load_fleet_file().topics}
        classes = {topic.topic: find_class(topic) for topic in self._extras.values()}
        super().__init__("/" + self._name, {**classes, **MESSAGE_CLASSES})
        self._drivers = share_drivers()
        self._cmd_vel = CommandTopic(self._namespace + "/velocity_controller/cmd_vel", Twist, self._explain_absence)
        self._led = CommandTopic(self._namespace + "/led", ColorRGBA, self._explain_absence)

    def read_extra(self, name: str, timeout_s: float) -> Any:
        """Return the newest value of a topic of fleet.yaml; the first one is waited for.

        Raises: ValueError for a name that is not in the file. StaleDataError without a message.
        """
        if name not in self._extras:
            known = ", ".join(self._extras) or "nothing"
            raise ValueError(f"{name!r} is not declared in {name_fleet_file()}, which names {known}")
        topic = self._extras[name]
        self.subscribe(topic.topic)
        if self.age_s(topic.topic) == math.inf:
            self.wait_for_next(topic.topic, timeout_s)
        return read_field(self.read(topic.topic), topic)

    def _explain_absence(self) -> str:
        return self._drivers.explain_absence(self._namespace)

    @property
    def connected(self) -> bool:
        """Return whether the driver subscribes to the robot's commands, as it does while it knows the robot."""
        return self._cmd_vel.connected

    @property
    def model(self) -> RobotModel:
        return MODELS.get(self._drivers.find_model(self._namespace), HERO)

    def missing(self) -> Optional[str]:
        if not self.connected:
            return self._cmd_vel.describe_absence()
        silent = self.find_silent(NEEDED, FRESH_S)
        if silent is not None:
            return f"no message on {self._namespace}/{silent}: is the robot on and in reach?"
        if not self._drivers.knows(self._namespace):
            return "no driver has reported it yet, so whether it is stopped is not known"
        return None

    def read_pose(self) -> Pose:
        pose = self.read("odom").pose.pose
        return pose_of(pose.position, pose.orientation)

    def read_velocity(self) -> Velocity:
        twist = self.read("odom").twist.twist
        return Velocity(twist.linear.x, twist.angular.z)

    def read_ranges(self) -> List[float]:
        return front_first(self.read("proximity"))

    def read_infrared_counts(self) -> List[float]:
        counts = [float(count) for count in self.read("laser").intensities[::2]]  # the others are averages
        return counts[len(counts) // 2 :] + counts[: len(counts) // 2]

    def read_distance(self) -> float:
        return float(self.read("distance").data)

    def read_neighbors(self) -> List[Neighbor]:
        message = self.read("neighbors")
        if not message.is_known:
            text = "senses no neighbors, as its own pose is not known or old: does localize run, and is its tag in view"
            raise StaleDataError(f"{self._name} {text} of the camera?")
        return [Neighbor(found.id, found.range, found.bearing, found.heading) for found in message.neighbors]

    def find_localized(self, frame: str, timeout_s: float) -> Optional[Pose]:
        """The first call subscribes to /localization/poses, for all robots."""
        return share_poses().find(self._robot_id, frame, timeout_s)

    def find_origin(self, frame: str, timeout_s: float) -> Pose:
        return find_origin(self._name + "/odom", frame, timeout_s)

    def send_velocity(self, linear_m_s: float, angular_rad_s: float) -> None:
        twist = Twist()
        twist.linear.x, twist.angular.z = linear_m_s, angular_rad_s
        self._cmd_vel.publish(twist, is_stop=not (linear_m_s or angular_rad_s))

    def send_color(self, rgb: Tuple[float, float, float]) -> None:
        self._led.wait_until_connected()  # a script that ends with it would end before
        self._led.publish(ColorRGBA(*rgb, 1.0))

    def set_odometry(self, pose: Pose) -> None:
        name = self._namespace + "/set_odom"
        try:
            rospy.wait_for_service(name, SERVICE_TIMEOUT_S)
            answer = rospy.ServiceProxy(name, SetOdom)(*pose)
        except (rospy.ServiceException, rospy.ROSException) as error:
            raise RobotError(f"{name}: {one_line(error)}") from None
        if not answer.success:
            raise RobotError(f"{name}: the robot answers: {answer.message}")

    @property
    def is_stopped(self) -> bool:
        return self._drivers.is_robot_stopped(self._namespace)

    def describe_stop(self) -> str:
        driver = self._drivers.find(self._namespace)
        return (
            "the driver %s has stopped all robots. Release them with r in `rosrun hero_tools fleet`,"
            " Swarm.release_stop(), or: rosservice call %s/stop false" % (driver.strip("/"), driver)
        )

    def start(self, steps: Steps) -> BackgroundMotion:
        return ThreadMotion(steps)

    def log_warning(self, text: str) -> None:
        rospy.logwarn(text)
