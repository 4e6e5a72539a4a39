"""Records stepped robots, without ROS, into a bag that export, plot and every tool of ROS 1 reads.

    with StepSwarm(5) as swarm, StepRecorder(swarm.rows, range(5), "run.bag"):
        ...

Times are simulated; the same run gives the same messages.
"""

from contextlib import ExitStack
from typing import Any, Dict, Sequence

from hero_node import import_optional
from hero_node.files import name_file
from hero_sim.stepped import LATCHED, RobotRows, StepTopics

from .errors import RecordingError


class StepRecorder(ExitStack):
    """A bag that is complete after close()."""

    def __init__(self, rows: RobotRows, robot_ids: Sequence[int], path: str) -> None:
        """Record the robots of the first world from now on.

        Raises: RecordingError if the file exists. OSError. ProgramError without the package rosbags.
        """
        super().__init__()
        rosbag1: Any = import_optional("rosbags.rosbag1", "rosbags")
        typesys: Any = import_optional("rosbags.typesys", "rosbags")
        self._types: Any = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
        # The one type that it lacks.
        transforms = typesys.get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage")
        self._types.register(transforms)
        self._path = path
        self._connections: Dict[str, Any] = {}
        try:
            self._writer = rosbag1.Writer(path)
            self._writer.open()
        except rosbag1.WriterError as error:
            raise RecordingError(f"{path}: {error}; move it away or choose another name") from None
        self.callback(self._complete)
        self.callback(StepTopics(rows, robot_ids, self._write).close)

    def _write(self, topic: str, kind: str, content: bytes, time_ns: int) -> None:
        with name_file(self._path):
            if topic not in self._connections:
                names = topic, kind.replace("/", "/msg/")
                self._connections[topic] = self._writer.add_connection(
                    *names, typestore=self._types, callerid="/hero_sim", latching=int(topic in LATCHED)
                )
            self._writer.write(self._connections[topic], time_ns, content)

    def _complete(self) -> None:
        with name_file(self._path):
            self._writer.close()
