#!/usr/bin/env python3
"""Plots the path in a bag of odometry: plot_path.py BAG TOPIC PICTURE."""

import sys

import matplotlib
import rosbag

matplotlib.use("Agg")  # renders to files, needs no display
from matplotlib import pyplot


def main():
    bag_file, topic, picture_file = sys.argv[1:4]
    with rosbag.Bag(bag_file) as bag:
        positions = [message.pose.pose.position for _, message, _ in bag.read_messages([topic])]
    if not positions:
        sys.exit("%s has no messages on %s" % (bag_file, topic))
    figure, axes = pyplot.subplots(figsize=(5, 5), constrained_layout=True)
    axes.plot([position.x for position in positions], [position.y for position in positions])
    axes.plot(positions[-1].x, positions[-1].y, "o")  # the last pose
    axes.set_aspect("equal", "datalim")
    axes.set_xlabel("x in m")
    axes.set_ylabel("y in m")
    figure.savefig(picture_file)
    print("%d poses of %s plotted in %s" % (len(positions), topic, picture_file))


if __name__ == "__main__":
    main()
