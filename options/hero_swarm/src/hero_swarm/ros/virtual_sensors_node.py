"""Program virtual_sensors: publishes floor, light, messages and pheromone that robots sense by their poses in an arena.

rosrun hero_swarm virtual_sensors _arena:=foraging.yaml _frame:=world

Any program sends the messages of a robot to /hero_N/send_message, and leaves pheromone by /hero_N/deposit.
"""

import math
import time
from functools import partial
from typing import Any, Dict, List

import numpy as np
import rospy
from geometry_msgs.msg import Vector3
from std_msgs.msg import ColorRGBA, Float32, Float32MultiArray, MultiArrayDimension, MultiArrayLayout

from hero_node.parameters import number, string
from hero_sim.world import load_arena

from ..sensors import Surroundings
from ..sensors.virtual import Floor, Light, Messages, Pheromone, RangeAndBearing
from .neighbors_node import SENSING, SensingNode, run_sensing

PARAMETERS = {
    **SENSING,
    "arena": string("empty", "a name or file of the simulator, with areas and lamps, in the frame of the poses"),
    "range_m": number(0.5, 0.0, 1000.0, "m", "of messages"),
    "loss": number(0.0, 0.0, 1.0, "", "probability that a message is lost"),
    "light_reach_m": number(1.0, 0.01, 1000.0, "m", "distance at which the light of a lamp is half as strong"),
    "half_life_s": number(30.0, 0.1, 1e6, "s", "of pheromone"),
}

DEPOSIT_S = 1.0
"""Time for which a robot goes on to leave pheromone after its program's last word."""

TOPICS = {"floor": ColorRGBA, "light": Vector3, "pheromone": Vector3, "messages": Float32MultiArray}
MAX_NUMBERS = 16
"""Numbers in a message of a robot."""


class VirtualSensorsNode(SensingNode):
    """Publishes the virtual sensors of all robots."""

    def __init__(self, parameters: Dict[str, Any]) -> None:
        """Begin with the robots of ~robots. Raises: OptionError for an arena that cannot be used."""
        self._arena = load_arena(parameters["arena"])
        self._sensors: Dict[str, Any] = {
            "floor": Floor(), "light": Light(parameters["light_reach_m"]),
            "messages": RangeAndBearing(parameters["range_m"], parameters["loss"]),
            "pheromone": Pheromone(parameters["half_life_s"]),
        }  # fmt: skip
        self._kept: Dict[str, Dict[str, Any]] = {name: {} for name in self._sensors}
        self._publishers: List[Dict[str, rospy.Publisher]] = []
        self._sent: Dict[int, List[float]] = {}
        self._deposits: Dict[int, Any] = {}
        self._start_s = time.monotonic()
        super().__init__(parameters)

    def _advertise(self, robot_id: int, prefix: str) -> None:
        made = {name: rospy.Publisher(prefix + name, kind, queue_size=1) for name, kind in TOPICS.items()}
        self._publishers.append(made)
        receive, deposit = partial(self._receive, robot_id), partial(self._deposit, robot_id)
        rospy.Subscriber(prefix + "send_message", Float32MultiArray, receive, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber(prefix + "deposit", Float32, deposit, queue_size=1, tcp_nodelay=True)

    def _receive(self, robot_id: int, message: Float32MultiArray) -> None:
        if 0 < len(message.data) <= MAX_NUMBERS:
            self._sent[robot_id] = list(message.data)
        else:
            self._source.warn("hero_%d: send_message holds %d numbers, but must hold 1 to %d" % (
                robot_id, len(message.data), MAX_NUMBERS))  # fmt: skip

    def _deposit(self, robot_id: int, message: Float32) -> None:
        amount = message.data if math.isfinite(message.data) else 0.0
        self._deposits[robot_id] = amount, time.monotonic()

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
        read = {name: sensor.read(around._replace(kept=self._kept[name])) for name, sensor in self._sensors.items()}
        light = read["light"]
        for row, publishers in enumerate(self._publishers):
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
    """Run the program."""
    run_sensing("virtual_sensors", PARAMETERS, VirtualSensorsNode)
