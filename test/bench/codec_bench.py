"""Times the pure layers on the bytes of one stock robot: packets, session, corrections. One core, no sockets."""

import struct
import time
import timeit

import emulated_swarm
from measuring import print_machine

from hero_driver.corrections.correction_settings import CorrectionSettings
from hero_driver.corrections.robot_corrections import RobotCorrections
from hero_driver.ros.message_types import apply_aliases
from hero_driver.rosserial import packets
from hero_driver.rosserial.session import MessagesReceived, Session, SessionLimits, Topic

BURSTS = 3000
REPEATS = 5
BURST_NS = 34 * 10**6


class NoSink:
    """A topic with a subscriber that costs nothing."""

    is_wanted = True

    def publish(self, payload):
        """Take payload."""


def best_us(run, count):
    """Return the best time (us) of one of count things that run() does."""
    return min(timeit.repeat(run, timer=time.process_time, number=1, repeat=REPEATS)) / count * 1e6


def main():
    """Print the table."""
    robot = emulated_swarm.Templates(0)
    start_ns = time.time_ns()
    stamps = [struct.pack("<II", *divmod(start_ns + index * BURST_NS, 10**9)) for index in range(BURSTS)]
    bursts = [b"".join(robot.make_burst(number, stamp)) for number, stamp in enumerate(stamps)]
    burst_packets = packets.PacketReader().receive_bytes(bursts[0])
    session = Session(SessionLimits(), 0.0)
    declared = session.receive_bytes(emulated_swarm.declare(0), 0.0, 0.0)

    def write():
        for _ in bursts:
            for topic_id, payload in burst_packets:
                packets.encode_packet(topic_id, payload)

    def read():
        reader = packets.PacketReader()
        for burst in bursts:
            reader.receive_bytes(burst)

    def receive():
        for burst in bursts:
            session.receive_bytes(burst, 1.0, 1.0)

    received = [event for burst in bursts for event in session.receive_bytes(burst, 1.0, 1.0)]
    messages = [event.messages for event in received if isinstance(event, MessagesReceived)]

    def correct():
        sink = NoSink()
        corrections = RobotCorrections("/hero_0", CorrectionSettings(), sink.publish)
        for event in declared:
            if isinstance(event, Topic) and event.kind.is_from_robot:
                info = event.info
                ros_type = apply_aliases(info.message_type)
                outputs = corrections.list_outputs(info.name, ros_type)
                event.receive = corrections.handler_for(info.name, ros_type, [sink for _ in outputs])
        for index, of_burst in enumerate(messages):
            for topic, payload in of_burst:
                topic.receive(payload, start_ns + index * BURST_NS)

    print_machine()
    print(f"bytes of a burst: {len(bursts[0])} (odom, 5 transforms, encoder), 29.4 bursts per robot and second")
    print("| layer | us per burst |")
    print("|---|---|")
    print(f"| packets written | {best_us(write, BURSTS):.1f} |")
    print(f"| packets read | {best_us(read, BURSTS):.1f} |")
    print(f"| session (with packets) | {best_us(receive, BURSTS):.1f} |")
    print(f"| corrections, everything wanted | {best_us(correct, BURSTS):.1f} |")


if __name__ == "__main__":
    main()
