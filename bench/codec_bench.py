"""Times the pure layers on the bytes of one stock robot: frames, session, cleaning. One core, no sockets."""

import struct
import time
import timeit

import emulated_swarm
from measuring import measure_machine_us, print_machine

from hero_driver.cleaning import CleaningSettings, MessageCleaner
from hero_driver.message_types import apply_aliases
from hero_driver.odometry import WheelGeometry
from hero_driver.rosserial import frames
from hero_driver.rosserial.session import Session, SessionLimits, TopicDeclared
from hero_driver.wheel_motion import WheelMotion

BURSTS = 3000
REPEATS = 5
BURST_NS = 34 * 10**6


class NoSink:
    """A topic that somebody listens to, at no cost."""

    is_wanted = True

    def publish(self, payload):
        """Take payload."""


def best_us(run, count):
    """Return the best time (us) of one of count things that run() does."""
    return min(timeit.repeat(run, number=1, repeat=REPEATS)) / count * 1e6


def main():
    """Print the table."""
    robot = emulated_swarm.Templates(0)
    start_ns = time.time_ns()
    stamps = [struct.pack("<II", *divmod(start_ns + index * BURST_NS, 10**9)) for index in range(BURSTS)]
    bursts = [b"".join(robot.make_burst(number, stamp)) for number, stamp in enumerate(stamps)]
    burst_frames = frames.FrameReader().receive_bytes(bursts[0])
    session = Session(SessionLimits(), 0.0)
    declared = session.receive_bytes(emulated_swarm.declare(0), 0.0, 0.0)
    settings = CleaningSettings("ticks", WheelGeometry(), (0.0,) * 6, (0.0,) * 6, "robot", 0.05, 5.0)

    def write():
        for _ in bursts:
            for topic_id, payload in burst_frames:
                frames.encode_frame(topic_id, payload)

    def read():
        reader = frames.FrameReader()
        for burst in bursts:
            reader.receive_bytes(burst)

    def receive():
        for burst in bursts:
            session.receive_bytes(burst, 1.0, 1.0)

    messages = [session.receive_bytes(burst, 1.0, 1.0) for burst in bursts]

    def clean():
        cleaner = MessageCleaner("/hero_0", settings, lambda name: NoSink(), NoSink().publish, WheelMotion())
        for event in declared:
            if isinstance(event, TopicDeclared) and event.topic.kind.is_from_robot:
                info = event.topic.info
                event.topic.receive = cleaner.choose(info.name, apply_aliases(info.message_type))
        for index, events in enumerate(messages):
            for topic, payload in events:
                topic.receive(payload, start_ns + index * BURST_NS)

    print_machine(measure_machine_us())
    print(
        "bytes of a burst: %d (odom, 5 transforms, encoder), 29.4 bursts per robot and second"
        % len(bursts[0])
    )
    print("| layer | us per burst |")
    print("|---|---|")
    print("| frames written | %.1f |" % best_us(write, BURSTS))
    print("| frames read | %.1f |" % best_us(read, BURSTS))
    print("| session (with frames) | %.1f |" % best_us(receive, BURSTS))
    print("| cleaning, everything wanted | %.1f |" % best_us(clean, BURSTS))


if __name__ == "__main__":
    main()
