"""Turns robots to and fro, measures how late odometry arrives and how soon robots move, and saves a plot."""

import numpy as np
import rospy
from nav_msgs.msg import Odometry

from hero_client import Program, open_swarm, read_parameters
from hero_node import import_optional, wrap_angle, yaw_of
from hero_node.parameters import robot_ids, whole_number
from hero_node.ros import read_duration_clock_s


def measure(program, robot, turns):
    """Return lists in ms: arrival minus stamp of odometry, and time from a command to the first 0.03 rad."""
    log = []  # delay (s), arrival (s, by the monotonic clock) and yaw (rad) of each message

    def receive(odometry):
        delay_s = rospy.get_time() - odometry.header.stamp.to_sec()
        log.append((delay_s, read_duration_clock_s(), yaw_of(odometry.pose.pose.orientation)))

    subscriber = rospy.Subscriber(robot.namespace + "/odom", Odometry, receive, tcp_nodelay=True)
    motions_ms = []
    for turn in range(turns):
        robot.drive(0.0, 0.0)
        if not program.sleep(1.0) or not log:
            break
        start_s, first_yaw_rad = read_duration_clock_s(), log[-1][2]
        robot.drive(0.0, 2.0 if turn % 2 == 0 else -2.0)
        while read_duration_clock_s() - start_s < 2.0 and program.sleep(0.002):
            _, arrival_s, yaw_rad = log[-1]
            if abs(wrap_angle(yaw_rad - first_yaw_rad)) > 0.03:  # one encoder tick is 0.017 rad
                motions_ms.append(1000.0 * (arrival_s - start_s))
                break
    robot.stop()
    subscriber.unregister()
    return {"message delay": [1000.0 * delay_s for delay_s, _, _ in log], "command to motion": motions_ms}


def main():
    with Program("measure_delay") as program:
        parameters = read_parameters(
            {"robots": robot_ids("all"), "turns": whole_number(10, 1, 1000), "plot": "measure_delay.png"}
        )
        figure = import_optional("matplotlib.figure", "python3-matplotlib").Figure(figsize=(10, 4))
        plots = figure.subplots(1, 2)
        figure.savefig(parameters["plot"])  # a path that cannot be written is an error now
        with open_swarm(program, parameters["robots"], proximity=False) as swarm:
            for robot in swarm:
                while robot.missing() and program.sleep(0.1):
                    swarm.report_missing({robot.name: robot.missing()})
                for plot, (title, ms) in zip(plots, measure(program, robot, parameters["turns"]).items()):
                    shares_ms = np.percentile(ms or [np.nan], [50, 99])
                    rospy.loginfo("%s %s: p50 %.1f ms, p99 %.1f ms (%d)", robot.name, title, *shares_ms, len(ms))
                    plot.boxplot([ms], positions=[robot.robot_id], whis=(1, 99), showfliers=False)
                    plot.set(title=title, xlabel="robot", ylabel="ms")
        figure.savefig(parameters["plot"])
