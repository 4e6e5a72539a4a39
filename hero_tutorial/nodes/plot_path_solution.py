#!/usr/bin/env python3
"""Plots the speed over time in a bag of odometry: plot_path_solution.py BAG TOPIC PICTURE."""

import sys

import matplotlib
import rosbag

matplotlib.use("Agg")
from matplotlib import pyplot


def main():
    bag_file, topic, picture_file = sys.argv[1:4]
    with rosbag.Bag(bag_file) as bag:
        messages = [message for _, message, _ in bag.read_messages([topic])]
    if not messages:
        sys.exit("%s has no messages on %s" % (bag_file, topic))
    start = messages[0].header.stamp
    times_s = [(message.header.stamp - start).to_sec() for message in messages]
    speeds_m_s = [message.twist.twist.linear.x for message in messages]
    figure, axes = pyplot.subplots(figsize=(6, 3), constrained_layout=True)
    axes.plot(times_s, speeds_m_s)
    axes.set_xlabel("time in s")
    axes.set_ylabel("speed in m/s")
    figure.savefig(picture_file)
    print("%.1f s plotted, mean speed %.3f m/s" % (times_s[-1], sum(speeds_m_s) / len(speeds_m_s)))


if __name__ == "__main__":
    main()
