"""Program virtual_sensors: publishes what robots sense by their poses: each other, floor, light, messages, pheromone.

rosrun hero_swarm virtual_sensors _arena:=foraging.yaml _frame:=world

Any program sends the messages of a robot to /hero_N/send_message, and leaves pheromone by /hero_N/deposit.
"""

import math
import time
from functools import partial
from typing import Any, Dict, List, Sequence

import numpy as np
import rospy
from geometry_msgs.msg import Vector3
from std_msgs.msg import ColorRGBA, Float32, Float32MultiArray, MultiArrayDimension, MultiArrayLayout

from hero_client import Program, read_parameters
from hero_client.ros import share_drivers
from hero_client.values import Neighborhood, Neighbors, list_neighbors
from hero_msgs.msg import Neighbor as NeighborMessage
from hero_msgs.msg import Neighbors as NeighborsMessage
from hero_node.parameters import flag, number, robot_ids, string, whole_number
from hero_sim.world import load_arena

from ..behavior import Random
from ..sensors import Surroundings, read_sensor
from ..sensors.virtual import Floor, Light, Messages, Pheromone, RangeAndBearing
from .pose_source import PoseSource

PARAMETERS = {
    "robots": robot_ids("all", "ids; all: those that have joined a driver"),
    "frame": string("map", "frame of the poses: that of localize, or `world` for the simulator's ground truth"),
    "seed": whole_number(0, 0, 2**31 - 1, "", "of all that is random"),
    "rate_hz": number(10.0, 1.0, 50.0, "Hz", "of the messages"),
    "range_m": number(1000.0, 0.0, 1000.0, "m", "between the centers, of neighbors that are sensed"),
    "field_rad": number(2.0 * math.pi, 0.0, 2.0 * math.pi, "rad", "width of the field of view, centered on the front"),
    "range_noise_m": number(0.0, 0.0, 1.0, "m", "standard deviation of ranges"),
    "bearing_noise_rad": number(0.0, 0.0, 1.0, "rad", "the same of bearings and headings"),
    "dropout": number(0.0, 0.0, 1.0, "", "probability that a neighbor is missed"),
    "occlusion": flag(False, "whether bodies hide those behind them"),
    "arena": string("empty", "a name or file of the simulator, with areas and lamps, in the frame of the poses"),
    "message_range_m": number(0.5, 0.0, 1000.0, "m", "of messages"),
    "message_loss": number(0.0, 0.0, 1.0, "", "probability that a message is lost"),
    "light_reach_m": number(1.0, 0.01, 1000.0, "m", "distance at which the light of a lamp is half as strong"),
    "half_life_s": number(30.0, 0.1, 1e6, "s", "of pheromone"),
}

DEPOSIT_S = 1.0
"""Time for which a robot goes on to leave pheromone after its program's last word."""

TOPICS = {
    "neighbors": NeighborsMessage, "floor": ColorRGBA, "light": Vector3, "pheromone": Vector3,
    "messages": Float32MultiArray,
}  # fmt: skip
MAX_NUMBERS = 16
"""Numbers in a message of a robot."""


def describe_neighbors(
    near: Neighborhood, row: int, ids: Sequence[int], poses: np.ndarray, ages_s: np.ndarray
) -> NeighborsMessage:
    """Return what the robot of a row senses of the others, whose poses (N, 3) are ages_s old (N,); NaN: not known."""
    ages_of = dict(zip(ids, ages_s.tolist()))
    message = NeighborsMessage(is_known=bool(np.isfinite(poses[row]).all()))
    message.header.frame_id, message.header.stamp = "hero_%d/base_link" % ids[row], rospy.Time.now()
    message.neighbors = [
        NeighborMessage(*neighbor, max(ages_of[ids[row]], ages_of[neighbor.robot_id]))
        for neighbor in list_neighbors(near, row, ids)
    ]
    return message


class VirtualSensorsNode:
    """Publishes the virtual sensors of all robots; those that join a driver are added."""

    def __init__(self, parameters: Dict[str, Any]) -> None:
        """Begin with the robots of ~robots. Raises: OptionError for an arena that cannot be used."""
        self._arena = load_arena(parameters["arena"])
        self._sensors: Dict[str, Any] = {
            "neighbors": Neighbors(**{name: parameters[name] for name in Neighbors._fields}),
            "floor": Floor(), "light": Light(parameters["light_reach_m"]),
            "messages": RangeAndBearing(parameters["message_range_m"], parameters["message_loss"]),
            "pheromone": Pheromone(parameters["half_life_s"]),
        }  # fmt: skip
        self._kept: Dict[str, Dict[str, Any]] = {name: {} for name in self._sensors}
        self._publishers: List[Dict[str, rospy.Publisher]] = []
        self._sent: Dict[int, List[float]] = {}
        self._deposits: Dict[int, Any] = {}
        self._start_s = time.monotonic()
        self._chosen, self._seed = parameters["robots"], parameters["seed"]
        self._source = PoseSource([], parameters["frame"])
        self._ids: List[int] = []
        self._add_robots(self._chosen or [])

    def _add_robots(self, ids: Sequence[int]) -> None:
        new = [robot_id for robot_id in ids if robot_id not in self._ids]
        self._source.add_robots(new)
        self._ids += new
        for robot_id in new:
            prefix = "/hero_%d/" % robot_id
            made = {name: rospy.Publisher(prefix + name, kind, queue_size=1, tcp_nodelay=True)
                    for name, kind in TOPICS.items()}  # fmt: skip
            self._publishers.append(made)
            receive, deposit = partial(self._receive, robot_id), partial(self._deposit, robot_id)
            rospy.Subscriber(prefix + "send_message", Float32MultiArray, receive, queue_size=1, tcp_nodelay=True)
            rospy.Subscriber(prefix + "deposit", Float32, deposit, queue_size=1, tcp_nodelay=True)
        if new:
            self._random = Random([self._seed], len(self._ids))

    def _receive(self, robot_id: int, message: Float32MultiArray) -> None:
        if 0 < len(message.data) <= MAX_NUMBERS:
            self._sent[robot_id] = list(message.data)
        else:
            self._source.warn("hero_%d: send_message holds %d numbers, but must hold 1 to %d" % (
                robot_id, len(message.data), MAX_NUMBERS))  # fmt: skip

    def _deposit(self, robot_id: int, message: Float32) -> None:
        amount = message.data if math.isfinite(message.data) else 0.0
        self._deposits[robot_id] = amount, time.monotonic()

    def step(self) -> None:
        """Publish what all robots sense."""
        if self._chosen is None:
            self._add_robots(share_drivers().list_ready())
        if not self._ids:
            self._source.warn("no robot has joined a driver yet: are the robots on?")
            return
        self._publish(*self._source.read())
        missing = self._source.describe_missing()
        if missing:
            self._source.warn(missing + "; who has no pose senses nothing")

    def _publish(self, poses: np.ndarray, ages_s: np.ndarray) -> None:
        now_s, sent = time.monotonic(), dict(self._sent)
        width = max(map(len, sent.values()), default=1)
        numbers = np.full((len(self._ids), width), np.nan)
        for robot_id, values in sent.items():
            numbers[self._ids.index(robot_id), : len(values)] = values
        left = [self._deposits.get(robot_id, (0.0, -math.inf)) for robot_id in self._ids]
        deposits = np.array([amount if now_s - told_s < DEPOSIT_S else 0.0 for amount, told_s in left])
        around = Surroundings(
            now_s - self._start_s, poses[None], self._random, arena=self._arena, messages=numbers, deposits=deposits
        )
        read = {
            name: read_sensor(name, sensor, around._replace(kept=self._kept[name]))
            for name, sensor in self._sensors.items()
        }
        light = read["light"]
        for row, publishers in enumerate(self._publishers):
            if publishers["neighbors"].get_num_connections():  # a hundred messages of a hundred neighbors take long
                near = describe_neighbors(read["neighbors"], row, self._ids, poses, ages_s)
                publishers["neighbors"].publish(near)
            if not np.isfinite(poses[row]).all():
                continue  # it senses nothing
            ahead, to_left = math.cos(light.bearing_rad[row]), math.sin(light.bearing_rad[row])
            publishers["floor"].publish(ColorRGBA(*read["floor"].color[row], 1.0))
            publishers["light"].publish(Vector3(light.intensity[row] * ahead, light.intensity[row] * to_left, 0.0))
            publishers["pheromone"].publish(Vector3(*(part[row] for part in read["pheromone"])))
            publishers["messages"].publish(self._pack(read["messages"], row))

    def _pack(self, near: Messages, row: int) -> Float32MultiArray:
        """Return a row for each message: id of its robot, range m, bearing rad, its numbers."""
        came = near.seen[row] & ~np.isnan(near.data[row]).all(axis=1)
        columns = np.array(self._ids, dtype=float), near.range_m[row], near.bearing_rad[row], near.data[row]
        rows = np.column_stack(columns)[came]
        sizes = MultiArrayDimension("message", len(rows), rows.size), MultiArrayDimension("", *rows.shape[1:] * 2)
        return Float32MultiArray(MultiArrayLayout(list(sizes), 0), rows.ravel().tolist())


def main() -> None:
    """Publish what robots sense until the program is to end. Raises: ProgramError for a wrong parameter."""
    with Program("virtual_sensors") as program:
        parameters = read_parameters(PARAMETERS)
        node = VirtualSensorsNode(parameters)
        for _ in program.rate(parameters["rate_hz"]):
            node.step()
