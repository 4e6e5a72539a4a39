"""One robot whose messages go through a RobotCorrections, for the tests of corrections."""

from robot_messages import build_burst, read_odometry, read_transform

from hero_driver.corrections.correction_settings import CorrectionSettings
from hero_driver.corrections.robot_corrections import TRANSFORMS, RobotCorrections
from hero_driver.corrections.wheel_motion import WheelMotion

TYPES = {
    "/hero_0/odom": "nav_msgs/Odometry",
    "/hero_0/encoder": "hero_msgs/Encoder",
    "/hero_0/laser": "sensor_msgs/LaserScan",
    "/hero_0/imu": "sensor_msgs/Imu",
    "/tf": "tf2_msgs/TFMessage",
}


class ListSink:
    """A topic of which everything is kept.

    Attributes:
        is_wanted: whether somebody listens.
    """

    def __init__(self, name, outputs, is_wanted=True):
        self.is_wanted = is_wanted
        self._name = name
        self._outputs = outputs

    def publish(self, payload):
        """Keep payload as (name, payload)."""
        self._outputs.append((self._name, payload))


def make_corrections(namespace, outputs, **settings):
    """Return corrections whose transforms come to the list outputs, as (name, payload)."""
    return RobotCorrections(namespace, CorrectionSettings(**settings), ListSink(TRANSFORMS, outputs).publish)


def make_handler(corrections, name, message_type, outputs, is_wanted=lambda name: True):
    """Return the handler of a topic whose messages, and those derived from them, come to the list outputs, too."""
    topics = list_topics(corrections, name, message_type)
    return corrections.handler_for(name, message_type, [ListSink(topic, outputs, is_wanted(topic)) for topic in topics])


def list_topics(corrections, name, message_type):
    """Return the topics that the messages of a topic become, with their types."""
    return dict(corrections.list_outputs(name, message_type))


class CorrectedRobot:
    """hero_0 with its stock topics, or those in types.

    Attributes:
        outputs: everything that came out, as (name, payload).
    """

    def __init__(self, types=None, is_wanted=lambda name: True, **settings):
        self.outputs = []
        self._is_wanted = is_wanted
        self.corrections = make_corrections("/hero_0", self.outputs, **settings)
        self.declare(TYPES if types is None else types)

    def declare(self, types):
        """Declare topics, as at the start of a connection."""
        self._clean = {
            name: make_handler(self.corrections, name, message_type, self.outputs, self._is_wanted)
            for name, message_type in types.items()
        }

    def reconnect(self, rebooted):
        """Begin a new connection with the stock topics."""
        self.corrections.odometry.restart(rebooted, WheelMotion())
        self.declare(TYPES)

    def receive(self, name, payload, arrival_ns):
        """Give one message; return what came out because of it."""
        known = len(self.outputs)
        self._clean[name](payload, arrival_ns)
        return self.outputs[known:]

    def receive_burst(self, stamp_ns, ticks, arrival_ns=None, **changes):
        """Give one burst of odometry, transforms and encoder; return what came out because of it."""
        outputs = []
        for name, _, payload in build_burst(stamp_ns, ticks, **changes):
            outputs += self.receive(name, payload, stamp_ns if arrival_ns is None else arrival_ns)
        return outputs


def list_odometry(outputs):
    """Return the read odometry messages among outputs."""
    return [read_odometry(payload) for name, payload in outputs if name == "/hero_0/odom"]


def list_transforms(outputs):
    """Return the read transforms among outputs."""
    return [read_transform(payload) for name, payload in outputs if name == TRANSFORMS]


def list_payloads(outputs, name):
    """Return the payloads of one topic among outputs."""
    return [payload for output_name, payload in outputs if output_name == name]
