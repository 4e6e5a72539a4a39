"""Reads ROS topics into the state that pages show.

While no page is open, only the drivers' reports and the log are subscribed to, and neither is decoded. Topics of robots
are subscribed to in the background, because the ROS master may block.
"""

import contextlib
import math
import re
import threading
import time
from collections import deque
from concurrent.futures import Future
from typing import Any, Callable, Deque, Dict, List, Optional, Sequence, Set, Tuple

import genpy
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import CompressedImage
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from hero_client.ros import Drivers, NewestMessage, RobotTrack, StopStatus, find_lost_commands, follow, load_fleet_file
from hero_client.values import (
    STATES,
    STOP_STATES,
    describe_counts,
    describe_gone,
    describe_stop_origin,
    finite,
    is_plausible,
    read_pose,
)
from hero_msgs.msg import Robot, RobotArray, RobotPose, RobotPoses
from hero_node import NodeError, Pose, make_printable, pose_of
from hero_node.ros import MasterWatch

from ..background import Background
from .camera_picture import CameraPicture
from .drawings import Drawings, encode_rgb
from .losses import MASTER_PERIOD_S, SILENT_S, LocalizationWatch, Loss, list_losses
from .page_state import LOG_LINES_KEPT, PageState, encode_pose, encode_range, shorten
from .placement import Placement
from .robot_feed import RobotFeed

ROW_PERIOD_S = 0.5
"""Time between two updates of the table without a report: rates."""

LOOK_PERIOD_S = 3.0
"""Time between two looks at the ROS master's list of topics: that of 100 robots takes it some 20 ms."""

LOST_SHOWN = 3
"""Lost commands, and goals outside the walls, that are named at once."""

LOG_LINES_PER_READ = 40
"""Decoding a line takes about 0.05 ms; a swarm that tunes its motors logs thousands a second."""

ROBOTS_MAX = 1000
"""Rows of the table."""

PICTURE_TOPICS = {"/track/picture/compressed", "/track/picture/outline"}

SIMULATOR_TOPICS = ("/hero_sim/arena", "/hero_sim/object_markers", "/hero_sim/markers", "/hero_sim/replay")
"""When the simulator, or a replay, ends, an empty message takes the place of what it published last."""

MARKERS_MAX = 2000
"""Markers of the arena, or of ground truth."""

LABEL = re.compile(r"(\S+?):? ")
"""Beginning of a driver's lines about one robot: "hero_0: voltage low", "hero_0 left (10.42.0.7:4242): ..."."""


class FleetFeed:
    """Everything that pages show."""

    def __init__(self, map_frame: str, background: Background) -> None:
        self._background = background
        self.page_state = PageState()
        self.placement = Placement(map_frame)
        self.picture = CameraPicture()
        self._drawings = Drawings()
        self.robots: Dict[str, Robot] = {}
        self.stopped = False
        self._feeds: Dict[str, RobotFeed] = {}
        self._scene: Dict[str, NewestMessage] = {}
        put = self.page_state.put
        # Topics of no single robot, in the order in which they are read: what places robots comes first.
        self._receivers: Dict[str, Tuple[Any, Callable[[Any, float], Any]]] = {
            "/tf_static": (TFMessage, self._receive_transforms),
            "/localization/poses": (RobotPoses, self._localize),
            "/diagnostics": (DiagnosticArray, self._receive_diagnostics),
            "/hero_sim/arena": (MarkerArray, self._receive_arena),
            "/hero_sim/object_markers": (MarkerArray, lambda message, now_s: put("objects", describe_arena(message))),
            "/hero_sim/markers": (MarkerArray, lambda message, now_s: put("ground_truth", find_true_poses(message))),
            "/hero_sim/replay": (MarkerArray, lambda message, now_s: put("replay", find_true_poses(message))),
            "/track/picture/outline": (PolygonStamped, lambda message, now_s: self.picture.receive_outline(message)),
            "/track/picture/compressed": (CompressedImage, self.picture.receive),
            "/behavior/markers": (MarkerArray, self._drawings.receive),
        }
        self._fleet_s = 0.0
        self._fleet_stamp_s: Optional[float] = None
        self._answering: Dict[str, bool] = {}
        self._localization = LocalizationWatch()
        self._tracked: Set[str] = set()
        self._master = MasterWatch()
        self._master.start(threading.Event(), background.warn, period_s=MASTER_PERIOD_S)
        self._pending_reads = 0
        self.lab_file = load_fleet_file()
        self._report = RobotArray()
        self._looked_s = 0.0
        self._lost_commands: List[str] = []
        self._extent: Optional[List[float]] = None
        self._goals_outside: List[str] = []
        self.stopper = ""
        """User who stopped the robots on a page."""
        self._rows: Sequence[Robot] = ()
        self._health: Dict[str, List[Any]] = {}
        self._change: Optional[Future[None]] = None
        self._log_bytes: Deque[bytes] = deque()
        self.drivers = Drivers()
        self._reports = 0
        # Not NewestMessage: of the log every line counts.
        self._rosout = rospy.Subscriber("/rosout", rospy.AnyMsg, self._keep_log_line, queue_size=100)

    def _keep_log_line(self, message: rospy.AnyMsg) -> None:
        if message._connection_header["md5sum"] == Log._md5sum:
            self._log_bytes.append(message._buff)
            if len(self._log_bytes) > LOG_LINES_KEPT:
                self._log_bytes.popleft()

    # ---------------------------------------------------------------- subscriptions

    def update_subscriptions(self, has_pages: bool, picture: bool) -> None:
        """Subscribe to robots only while a page is open, to the camera's picture on request; returns at once."""
        if self._change is not None and not self._change.done():
            return
        if self._change is not None:
            self._change.result()
        robots = {row.namespace for row in self._rows if row.namespace and row.state != Robot.REFUSED}
        namespaces = robots if has_pages else set()
        scene = set(self._receivers) if has_pages else set()
        scene -= set() if picture else PICTURE_TOPICS
        if namespaces != set(self._feeds) or scene != set(self._scene):
            self._change = self._background.submit(self._change_subscriptions, namespaces, scene)

    def _change_subscriptions(self, namespaces: Set[str], scene: Set[str]) -> None:
        follow(self._scene, scene, lambda topic: NewestMessage(topic, self._receivers[topic][0]))
        follow(self._feeds, namespaces, RobotFeed)

    # ---------------------------------------------------------------- reading

    def read(self) -> None:
        """Update the state."""
        self.read_stop()
        self._read_fleet()
        for feed in list(self._feeds.values()):
            feed.read_newest()
        self._read_scene()
        self.placement.set_robots(self.robots)
        self._put_robots()
        if time.monotonic() - self._looked_s >= LOOK_PERIOD_S:
            self._looked_s = time.monotonic()
            self._background.submit(self._look_for_lost_commands)
        self._list_losses()
        self._read_log()

    def _read_fleet(self) -> None:
        now_s = time.monotonic()
        answering = self.drivers.find_answering(SILENT_S)
        reports = self.drivers.count()
        message = self.drivers.read() if reports != self._reports else None
        self._reports = reports
        if message is not None:
            self._report, self.stopped = message, message.stopped
            self._fleet_stamp_s = message.header.stamp.to_sec()
            self._rows = sorted(message.robots, key=lambda row: row.id)[:ROBOTS_MAX]
            self.robots = {row.namespace.strip("/"): row for row in self._rows if row.state != Robot.REFUSED}
        elif answering == self._answering and now_s < self._fleet_s + ROW_PERIOD_S:
            return
        self._fleet_s, self._answering = now_s, answering
        has_driver = any(answering.values())
        self.stopped = self.stopped and all(answering.values())
        fleet = {
            "driver": has_driver,
            "listening": make_printable(self._report.listening),
            "stopped": self.stopped,
            "counts": self._describe_counts(),
            "frame": shorten(self.placement.frame),
            "localized": self.placement.is_localized,
            "robots": [self._make_row(row) for row in self._rows],
        }
        self.page_state.put("fleet", fleet)

    def _describe_counts(self) -> str:
        """Return how many robots are in which state; only how many are unknown, while some are."""
        unknown = sum(not self._is_known(row.namespace) for row in self.robots.values())
        return f"{unknown} of {len(self.robots)} robots unknown" if unknown else describe_counts(self._report)

    def _list_losses(self) -> None:
        losses = list_losses(self._answering, self._master.is_lost, self._localization, time.monotonic())
        gone = describe_gone(self._report, time.time()) if any(self._answering.values()) else ""
        if gone:
            losses.append(Loss("robots", shorten(gone), "Switch them on, or dismiss this"))
        lost = [*self._lost_commands, *self._goals_outside][:LOST_SHOWN]
        losses += [Loss("commands", "A command may have no effect", shorten(text)) for text in lost]
        self.page_state.put("losses", [loss._asdict() for loss in losses])

    def _look_for_lost_commands(self) -> None:
        """Ask the ROS master, which may take seconds."""
        with contextlib.suppress(NodeError):
            self._lost_commands = find_lost_commands()

    def _make_row(self, row: Robot) -> Dict[str, Any]:
        name = make_printable(row.namespace.strip("/"))
        # Topics and diagnostics under the name of a robot that was refused are those of another robot.
        refused = row.state == Robot.REFUSED
        feed = None if refused else self._feeds.get(row.namespace)
        track = None if feed is None else feed.listener.track
        since_s = row.since.to_sec()
        odom_hz = None if track is None else round(track.odometry.rate_hz(time.monotonic()), 1)
        velocity = track.velocity if track is not None and odom_hz else None
        return {
            "name": name,
            "id": row.id,
            "address": shorten(row.address),
            "state": STATES.get(row.state, str(row.state)),
            # Without an answer of its driver all the rest is what was known last.
            "known": self._is_known(row.namespace),
            "stop": "" if refused else STOP_STATES.get(row.stop_state, str(row.stop_state)),
            "firmware": shorten(row.firmware),
            "model": shorten(row.model),
            "hardware": shorten(row.hardware),
            "config": shorten(row.config),
            "since": round(self._fleet_stamp_s - since_s) if self._fleet_stamp_s is not None and since_s else None,
            "uptime": round(row.uptime.to_sec()),
            "reconnects": row.reconnects,
            "bytes": round(row.bytes_per_s),
            "odom": odom_hz,
            "speed": velocity and finite(round(abs(velocity.linear_m_s), 3)),
            "turn": velocity and finite(round(velocity.angular_rad_s, 3)),
            "distance": None if track is None else finite(round(track.distance_m, 2)),
            "nearest": "-" if track is None else encode_nearest(track),
            "dropped": row.dropped_messages,
            "bad": row.bad_packets,
            "clock": finite(round(row.clock_offset, 4)),
            "error": shorten(row.last_error),
            "source": "" if refused else self._name_pose_source(name),
            "note": "" if refused or row.id not in self.lab_file.robots else shorten(self.lab_file.robots[row.id].text),
            "values": {}
            if feed is None
            else {name: _encode_value(value) for name, value in feed.listener.values.items()},
            "health": [0, ""] if refused else self._health.get(name, [0, ""]),
        }

    def _is_known(self, namespace: str) -> bool:
        """Return whether the driver of a robot answers."""
        answers = self._answering.values()
        if all(answers) or not any(answers):
            return any(answers)
        return self._answering.get(self.drivers.find(namespace), False)

    def _name_pose_source(self, name: str) -> str:
        """Return what a robot's place on the map is known by: camera, odometry, unknown; empty if by nothing."""
        if not self.placement.knows(name):
            return ""
        if not self.placement.is_localized:
            return "odometry"
        if self._localization.is_lost(time.monotonic()):
            return "unknown"
        return "camera" if name in self._tracked else "odometry"

    def read_stop(self) -> bool:
        """Update the status of a stop; return whether it has changed."""
        status = self.drivers.stop_status()
        if status is None:
            # No page has asked; another program may have.
            moving = [name for name, row in self.robots.items() if row.stop_state == Robot.MOVING]
            status = describe_stop_of_others(self._describe_origin() if self.stopped else None, moving)
        elif status is not None and status.is_final and status.level != "error" and self.stopped:
            status = status._replace(text=f"{status.text} ({self._describe_origin()})")
        pending = status is not None and not status.is_final and status.level != "error"
        # Different each time while it is pending, which shows pages that the monitor is alive.
        self._pending_reads = self._pending_reads + 1 if pending else 0
        value = None if status is None else {**status._asdict(), "reads": self._pending_reads}
        return self.page_state.put("stop", value)

    def _describe_origin(self) -> str:
        """Return who stopped all robots, and since when."""
        origin = describe_stop_origin(self._report, time.time())
        is_own = self.stopper and self._report.stopped_by == rospy.get_name()
        return shorten(f"by {self.stopper}" + origin[len("by " + rospy.get_name().strip("/")) :] if is_own else origin)

    def _read_scene(self) -> None:
        now_s, put = time.monotonic(), self.page_state.put
        for topic, (_, receive) in self._receivers.items():
            newest = self._scene.get(topic)
            message = newest and newest.take()
            if message is not None:
                receive(message, now_s)
        for topic in SIMULATOR_TOPICS:
            if topic in self._scene and not self._scene[topic].has_publisher:
                self._receivers[topic][1](MarkerArray(), now_s)
        if "/localization/poses" not in self._scene:
            self._localization.pause(now_s)
        elif not self._localization.is_expected(now_s):
            self.placement.localize("", {})
        frame = self.placement.frame
        put("picture", self.picture.describe(frame, now_s))
        put("drawings", self._drawings.describe(frame, now_s))

    def _receive_transforms(self, message: TFMessage, now_s: float) -> None:
        for transform in message.transforms:
            pose = pose_of(transform.transform.translation, transform.transform.rotation)
            if is_plausible(pose):
                self.placement.receive_transform(transform.header.frame_id, transform.child_frame_id, pose)

    def _receive_diagnostics(self, message: DiagnosticArray, now_s: float) -> None:
        for status in message.status:
            name = status.name.rpartition(": ")[2]
            if name in self.robots:
                self._health[name] = [status.level, shorten(status.message)]

    def _receive_arena(self, message: MarkerArray, now_s: float) -> None:
        arena = describe_arena(message)
        self._extent = measure_extent(**arena)
        self.page_state.put("arena", {**arena, "extent": self._extent})

    def _localize(self, report: RobotPoses, now_s: float) -> None:
        self._tracked = {"hero_%d" % robot.id for robot in report.robots if robot.state == RobotPose.TRACKED}
        self._localization.receive(len(self._tracked), now_s)
        poses = {}
        for robot in report.robots[:ROBOTS_MAX]:
            name, pose = "hero_%d" % robot.id, Pose(robot.x, robot.y, robot.yaw)
            feed = self._feeds.get("/" + name)
            odom = None if feed is None else feed.listener.track.pose
            if robot.state != RobotPose.UNKNOWN and odom is not None and is_plausible(pose):
                poses[name] = pose, odom
        self.placement.localize(report.header.frame_id, poses)

    def _put_robots(self) -> None:
        poses, ranges, lights, goals = {}, {}, {}, {}
        self._goals_outside = []
        for feed in list(self._feeds.values()):
            track = feed.listener.track
            if track.pose is not None:
                poses[feed.name] = encode_pose(self.placement.to_map(feed.name, track.pose))
                ranges[feed.name] = [encode_range(range_m) for range_m in feed.listener.ranges_m]
            if feed.light is not None:
                lights[feed.name] = feed.light
            goal = feed.find_goal(self.placement)
            if goal is not None:
                goals[feed.name] = encode_pose(goal)
                if self._is_within_walls(poses.get(feed.name)) and not self._is_within_walls(goals[feed.name]):
                    self._goals_outside.append(f"the goal of {feed.name} lies outside the walls")
        for name, value in (("poses", poses), ("ranges", ranges), ("lights", lights), ("goals", goals)):
            self.page_state.put(name, value)

    def _is_within_walls(self, pose: Optional[List[int]]) -> bool:
        if pose is None or self._extent is None:
            return False
        left, low, right, high = self._extent
        return left <= pose[0] <= right and low <= pose[1] <= high

    def _read_log(self) -> None:
        log, drivers = self.page_state.log, self.drivers.names()
        limit = LOG_LINES_PER_READ if log.count else LOG_LINES_KEPT
        waiting = len(self._log_bytes)
        for _ in range(waiting - limit):
            self._log_bytes.popleft()
            log.skip(1)
        lines = []
        for _ in range(min(waiting, limit)):
            try:
                lines.append(Log().deserialize(self._log_bytes.popleft()))
            except genpy.DeserializationError:
                log.skip(1)
        # Nodes that were there before are connected to in any order.
        for line in sorted(lines, key=lambda line: line.header.stamp):
            label = LABEL.match(line.msg) if line.name in drivers else None
            robot = label.group(1) if label and label.group(1) in self.robots else ""
            log.append(line.header.stamp.to_sec(), line.level, line.name.lstrip("/"), robot, line.msg)


def encode_nearest(track: RobotTrack) -> Any:
    """Return the distance of the nearest obstacle, m; a word where there is none."""
    if track.nearest is not None:
        return round(track.nearest.range_m, 3)
    return "-" if not track.proximity_seen else "free" if track.is_free else "not calibrated"


def _encode_value(value: Any) -> Any:
    """Return the value of a topic that fleet.yaml declares for JSON."""
    return finite(round(value, 4)) if isinstance(value, float) else shorten(str(value))


def describe_stop_of_others(origin: Optional[str], moving: Sequence[str]) -> Optional[StopStatus]:
    """Return the status of a stop that another program requested; None if there is none.

    origin: who requested it, None: robots are not stopped.
    """
    if moving:
        verb = "moves" if len(moving) == 1 else "move"
        return StopStatus("error", f"NOT STOPPED: {', '.join(moving)} {verb}", is_final=False)
    return None if origin is None else StopStatus("info", f"stopped {origin}".strip(), is_final=True)


def describe_arena(message: MarkerArray) -> Dict[str, List[List[Any]]]:
    """Return boxes (x, y, yaw, length, width) and circles (x, y, radius) of the arena or of objects, in mm and mrad.

    The last value of each is the color of a painted area of the floor; None for what stands there.
    """
    boxes: List[List[Any]] = []
    circles: List[List[Any]] = []
    for marker in message.markers[:MARKERS_MAX]:
        pose = encode_pose(read_pose(marker.pose))
        size = encode_pose(Pose(marker.scale.x, marker.scale.y, 0.0))
        if pose is None or size is None or marker.action != Marker.ADD:
            continue
        color = encode_rgb(marker.color) if marker.ns == "areas" else None
        if marker.type == Marker.CUBE:
            boxes.append([*pose, size[0], size[1], color])
        elif marker.type == Marker.CYLINDER:
            circles.append([pose[0], pose[1], size[0] // 2, color])
    return {"boxes": boxes, "circles": circles}


def measure_extent(boxes: Sequence[Sequence[Any]], circles: Sequence[Sequence[Any]]) -> Optional[List[float]]:
    """Return left, low, right and high of what describe_arena() gives, mm; None of nothing."""
    places = [
        (x + side * length * math.cos(yaw / 1e3), y + side * length * math.sin(yaw / 1e3))
        for x, y, yaw, length, *_ in boxes
        for side in (-0.5, 0.5)
    ]
    places += [(x + side * radius, y + side * radius) for x, y, radius, _ in circles for side in (-1, 1)]
    return [round(edge(values)) for edge in (min, max) for values in zip(*places)] or None


def find_true_poses(message: MarkerArray) -> Dict[str, Optional[List[int]]]:
    """Return the ground truth of simulated robots; each has a marker with its name and one with its heading."""
    markers = message.markers[:MARKERS_MAX]
    headings = {marker.id: marker for marker in markers if marker.ns == "headings"}
    return {
        marker.text: encode_pose(read_pose(headings[marker.id].pose))
        for marker in markers
        if marker.ns == "names" and marker.id in headings
    }
