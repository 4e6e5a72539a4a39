"""The ROS side of the benchmark: raw subscribers on every odom and on /tf, or publishers of cmd_vel.

ros_load.py listen --count N     counts messages and their age until SIGINT, then prints one JSON line
ros_load.py command --count N    sends cmd_vel at 10 Hz to every robot, with the time in linear.y
"""

import argparse
import json
import signal
import struct
import threading
import time

import rospy
from geometry_msgs.msg import Twist

COMMAND_PERIOD_S = 0.1


class Raw(rospy.AnyMsg):
    """Message bytes, unread."""


def listen(count, first, ended):
    """Count until ended is set; return the result."""
    odoms_s = []  # pairs: stamp, arrival
    counts = {"transforms": 0, "transform_messages": 0}
    lock = threading.Lock()

    def take_odom(message):
        secs, nsecs = struct.unpack_from("<II", message._buff, 4)
        odoms_s.append((secs + nsecs * 1e-9, time.time()))

    def take_transforms(message):
        with lock:
            counts["transforms"] += struct.unpack_from("<I", message._buff)[0]
            counts["transform_messages"] += 1

    for number in range(first, first + count):
        rospy.Subscriber("/hero_%d/odom" % number, Raw, take_odom, queue_size=50, tcp_nodelay=True)
    rospy.Subscriber("/tf", Raw, take_transforms, queue_size=100, tcp_nodelay=True)
    ended.wait()
    return dict(counts, odoms_s=odoms_s)


def command(count, first, linear_m_s, keeps_times, ended):
    """Send commands until ended is set; return the result."""
    commands = 0
    publishers = [
        rospy.Publisher("/hero_%d/velocity_controller/cmd_vel" % n, Twist, queue_size=10, tcp_nodelay=True)
        for n in range(first, first + count)
    ]
    sent_s = []
    if not publishers:
        ended.wait()
    round_s = time.monotonic()
    while not ended.is_set():
        # Spread over the period, as programs of many robots do.
        for index, publisher in enumerate(publishers):
            delay_s = round_s + COMMAND_PERIOD_S * index / len(publishers) - time.monotonic()
            if delay_s > 0.0:
                ended.wait(delay_s)
            if publisher.get_num_connections():
                message = Twist()
                message.linear.x, message.angular.z = linear_m_s, 5.0 * linear_m_s
                message.linear.y = time.time()
                publisher.publish(message)
                commands += 1
                if keeps_times:
                    sent_s.append(message.linear.y)
        round_s += COMMAND_PERIOD_S
    return {"commands": commands, "commands_s": sent_s}


def main():
    """Run from the command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("role", choices=("listen", "command"))
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--first-id", type=int, default=0)
    parser.add_argument("--speed", type=float, default=0.01, metavar="M/S", help="of the commands")
    parser.add_argument("--counts", action="store_true", help="keep no times of commands, for runs of hours")
    options = parser.parse_args()
    rospy.init_node("bench_" + options.role, anonymous=True, disable_signals=True)
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        # On a thread of its own: the main thread may be inside the lock of the event.
        signal.signal(number, lambda *_: threading.Thread(target=ended.set).start())
    if options.role == "listen":
        result = listen(options.count, options.first_id, ended)
    else:
        result = command(options.count, options.first_id, options.speed, not options.counts, ended)
    print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
