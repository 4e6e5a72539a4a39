"""Program neighbors: publishes what robots sense of each other, computed from the poses of localize or the simulator.

rosrun hero_swarm neighbors _range_m:=1.0
"""

import math
from typing import Any, Callable, Dict, List, Sequence

import numpy as np
import rospy

from hero_client import Program, read_parameters
from hero_client.ros import share_drivers
from hero_client.swarm import ready_ids
from hero_client.values import Neighbors, list_neighbors, sense_neighbors
from hero_msgs.msg import Neighbor as NeighborMessage
from hero_msgs.msg import Neighbors as NeighborsMessage
from hero_node.parameters import flag, number, robot_ids, string, whole_number

from ..behavior import Random
from .pose_source import PoseSource

SENSING = {
    "robots": robot_ids("all", "ids; all: those that have joined a driver"),
    "frame": string("map", "frame of the poses: that of localize, or `world` for the simulator's ground truth"),
    "seed": whole_number(0, 0, 2**31 - 1, "", "of all that is random"),
    "rate_hz": number(10.0, 1.0, 50.0, "Hz", "of the messages"),
}
PARAMETERS = {
    **SENSING,
    "range_m": number(1000.0, 0.0, 1000.0, "m", "between the centers, of neighbors that are sensed"),
    "field_rad": number(2.0 * math.pi, 0.0, 2.0 * math.pi, "rad", "width of the field of view, centered on the front"),
    "range_noise_m": number(0.0, 0.0, 1.0, "m", "standard deviation of ranges"),
    "bearing_noise_rad": number(0.0, 0.0, 1.0, "rad", "the same of bearings and headings"),
    "dropout": number(0.0, 0.0, 1.0, "", "probability that a neighbor is missed"),
    "occlusion": flag(False, "whether bodies hide those behind them"),
}


def make_messages(
    ids: Sequence[int], poses: np.ndarray, ages_s: np.ndarray, sensor: Neighbors, random: Random
) -> List[NeighborsMessage]:
    """Return the message of each robot (N,), from the poses (N, 3), NaN for those not known, and their ages (N,)."""
    near = sense_neighbors(poses[None], sensor, random)
    ages_of = dict(zip(ids, ages_s.tolist()))
    messages = []
    for row, robot_id in enumerate(ids):
        message = NeighborsMessage(is_known=bool(np.isfinite(poses[row]).all()))
        message.header.frame_id = "hero_%d/base_link" % robot_id
        message.neighbors = [
            NeighborMessage(*neighbor, max(ages_of[robot_id], ages_of[neighbor.robot_id]))
            for neighbor in list_neighbors(near, row, ids)
        ]
        messages.append(message)
    return messages


class SensingNode:
    """Publishes what robots sense by their poses; robots that join a driver are added."""

    def __init__(self, parameters: Dict[str, Any]) -> None:
        """Begin with the robots of ~robots."""
        self._chosen, self._seed = parameters["robots"], parameters["seed"]
        self._source = PoseSource([], parameters["frame"])
        self._ids: List[int] = []
        self._random = Random([self._seed], 0)
        self._add_robots(self._chosen or [])

    def _add_robots(self, ids: Sequence[int]) -> None:
        new = [robot_id for robot_id in ids if robot_id not in self._ids]
        if not new:
            return
        self._source.add_robots(new)
        self._ids += new
        for robot_id in new:
            self._advertise(robot_id, "/hero_%d/" % robot_id)
        self._random = Random([self._seed], len(self._ids))

    def _advertise(self, robot_id: int, prefix: str) -> None:
        raise NotImplementedError

    def _publish(self, poses: np.ndarray, ages_s: np.ndarray) -> None:
        raise NotImplementedError

    def step(self) -> None:
        """Publish what all robots sense."""
        if self._chosen is None:
            report = share_drivers().read()
            self._add_robots(ready_ids(report) if report else [])
        if not self._ids:
            self._source.warn("no robot has joined a driver yet: are the robots on?")
            return
        self._publish(*self._source.read())
        missing = self._source.describe_missing()
        if missing:
            self._source.warn(missing + "; who has no pose senses nothing")


class NeighborsNode(SensingNode):
    """Publishes the neighbors of all robots."""

    def __init__(self, parameters: Dict[str, Any]) -> None:
        """Begin with the robots of ~robots."""
        self._sensor = Neighbors(**{name: parameters[name] for name in Neighbors._fields})
        self._publishers: List[rospy.Publisher] = []
        super().__init__(parameters)

    def _advertise(self, robot_id: int, prefix: str) -> None:
        topic = prefix + "neighbors"
        self._publishers.append(rospy.Publisher(topic, NeighborsMessage, queue_size=1, tcp_nodelay=True))

    def _publish(self, poses: np.ndarray, ages_s: np.ndarray) -> None:
        messages = make_messages(self._ids, poses, ages_s, self._sensor, self._random)
        for publisher, message in zip(self._publishers, messages):
            message.header.stamp = rospy.Time.now()
            publisher.publish(message)


def run_sensing(name: str, declared: Dict[str, Any], make_node: Callable[[Dict[str, Any]], SensingNode]) -> None:
    """Publish what robots sense until the program is to end. Raises: ProgramError for a wrong parameter."""
    with Program(name) as program:
        parameters = read_parameters(declared)
        node = make_node(parameters)
        for _ in program.rate(parameters["rate_hz"]):
            node.step()


def main() -> None:
    """Run the program."""
    run_sensing("neighbors", PARAMETERS, NeighborsNode)
