"""Makes the pictures of the courses as their pages say: RViz with a square, the path of a walk. For script/pictures."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib.image
import rospy
from nav_msgs.msg import Odometry
from picture_program import make_pictures

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "test" / "bench"))
from running_suite import RunningSuite  # noqa: E402

from hero_test.screens.virtual_screen import MISSING, VirtualScreen  # noqa: E402

PICTURES_FOLDER = ROOT / "docs" / "tutorial" / "pictures"
SCREEN = (1200, 800)  # the size that the configuration of RViz gives its window
FOURTH_SIDE_M = 8.0  # of the 10 m that are left of the square: the picture is taken there
SQUARE_TIMEOUT_S = 150.0
WALK_S = 30


def start_script(stage, name, *arguments):
    """Start a node of hero_tutorial."""
    return stage.start(["rosrun", "hero_tutorial", name, *arguments])


def odometry(picture):
    """The window of RViz, when the square is three and a half sides long."""
    if MISSING:
        sys.exit(f"tutorial_pictures: not installed: {', '.join(MISSING)} (script/bootstrap --test)")
    screen = VirtualScreen(*SCREEN)
    os.environ.update(screen.environment())
    try:
        with RunningSuite(0) as stage:
            poses = []
            rospy.Subscriber("/odom", Odometry, lambda message: poses.append(message.pose.pose.position), queue_size=10)
            start_script(stage, "odometry_node_solution.py")
            launch = ["roslaunch", "--no-summary", "hero_tutorial", "odometry.launch"]
            stage.start(launch, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            stage.wait_for(lambda: poses and poses[-1].y > 9.99 and poses[-1].x < 0.01, "a square", SQUARE_TIMEOUT_S)
            stage.wait_for(lambda: poses[-1].y < FOURTH_SIDE_M, "the fourth side", SQUARE_TIMEOUT_S)
            matplotlib.image.imsave(str(picture), screen.read())
    finally:
        screen.close()


def walk(picture):
    """The plot that the tutorial on recording makes."""
    with RunningSuite(1, "first_id:=3") as stage, tempfile.TemporaryDirectory() as folder:
        start_script(stage, "random_walk.py", "_robot:=3")
        rospy.wait_for_message("/hero_3/odom", Odometry, timeout=30.0)
        bag = folder + "/walk.bag"
        subprocess.run(["rosbag", "record", "-O", bag, "--duration=%d" % WALK_S, "/hero_3/odom"], check=True)
        subprocess.run(["rosrun", "hero_tutorial", "plot_path.py", bag, "/hero_3/odom", str(picture)], check=True)


PICTURES = {"odometry": odometry, "walk": walk}


if __name__ == "__main__":
    make_pictures(PICTURES, PICTURES_FOLDER, __doc__)
