"""Saves what RViz and the fleet monitor show, on virtual screens. Started by script/pictures.

The robots are simulated and walk; every picture has a ROS master, a driver and a simulator of its own.
"""

import os
import socket
import subprocess
import sys
import time
from pathlib import Path

import matplotlib.image
import numpy as np
from picture_program import make_pictures
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "test" / "bench"))
from running_suite import RunningSuite  # noqa: E402

from hero_test.processes import find_free_port  # noqa: E402
from hero_test.screens.browser import MISSING as NO_BROWSER  # noqa: E402
from hero_test.screens.monitor_page import MonitorPage  # noqa: E402
from hero_test.screens.virtual_screen import MISSING, VirtualScreen  # noqa: E402

PICTURES_FOLDER = ROOT / "docs" / "pictures"
MISSIONS = ROOT / "options" / "hero_swarm" / "examples" / "missions"
SPOT = str(MISSIONS / "black_spot_arena.yaml")
WALK_S = 25.0
SCREEN = (1200, 800)  # the size that the configuration of RViz gives its window
VIEW = (slice(164, 768), slice(366, 1182))  # rows and columns of the arena in that window
ROBOT = (slice(250, 590), slice(560, 990))  # the part that shows one robot close up
DESIGNED = "black_spot_designed.controller"
CLOSE_UP = ("view:=close", "fixed_frame:=hero_0/base_link")
GROUND_SHARE = 0.5  # of the view is light ground as soon as RViz draws; its first window is dark
DRAW_TIMEOUT_S = 60.0
FILM_S, FRAMES_HZ = 12.0, 5


def wait_until_drawn(screen, stage):
    """Return when RViz shows the ground."""

    def drawn():
        return np.mean(np.all(screen.read()[VIEW][::4, ::4] > 230, axis=2)) > GROUND_SHARE

    stage.wait_for(drawn, "a picture in RViz", DRAW_TIMEOUT_S)


def wait_while_they_walk(stage):
    """Return after WALK_S."""
    end_s = time.monotonic() + WALK_S
    stage.wait_for(lambda: time.monotonic() > end_s, "robots that walk", 2.0 * WALK_S)


def start_moving(stage, robots, controller):
    """Let the robots walk, or run a controller's file by their true poses."""
    if controller is None:
        stage.start_example("random_walk", "_robots:=0-%d" % (robots - 1), "_seed:=4")
        return
    launch = ["roslaunch", "--no-summary", "hero_swarm", "behavior.launch", "behavior:=%s" % (MISSIONS / controller)]
    stage.start([*launch, "robots:=0-%d" % (robots - 1), "frame:=world"], stdout=subprocess.DEVNULL)


def film(screen, path, part, stage):
    """Save what a part of the screen shows for FILM_S, half as large, at twice the speed."""
    frames, begin_s = [], time.monotonic()
    for number in range(round(FILM_S * FRAMES_HZ)):
        due_s = begin_s + number / FRAMES_HZ
        stage.wait_for(lambda due_s=due_s: time.monotonic() >= due_s, "the next frame", 2.0)
        frame = Image.fromarray(np.ascontiguousarray(screen.read()[part]))
        frames.append(frame.resize((frame.width // 2, frame.height // 2)).quantize(32, dither=0))
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=500 / FRAMES_HZ, loop=0)


def photograph_rviz(picture, robots, arena, *options, part=VIEW, is_filmed=False, controller=None):
    """Let robots move in an arena, and save a part of the window of RViz, started with these options.

    is_filmed: save a film beside the picture, too.
    """
    screen = VirtualScreen(*SCREEN)
    os.environ.update(screen.environment())
    try:
        with RunningSuite(robots, "arena:=" + arena) as stage:
            start_moving(stage, robots, controller)
            launch = ["roslaunch", "--no-summary", "hero_description", "swarm.launch"]
            launch += [f"{group}:=0-{robots - 1}" for group in ("robots", "simulated")] + list(options)
            stage.start(launch, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            wait_until_drawn(screen, stage)
            wait_while_they_walk(stage)
            matplotlib.image.imsave(str(picture), screen.read()[part])
            if is_filmed:
                film(screen, picture.with_suffix(".gif"), part, stage)
    finally:
        screen.close()


def photograph_monitor(picture, robots, arena, controller=None):
    """Let robots move in an arena, and save the page of the fleet monitor, with one robot chosen."""
    port = find_free_port()
    with RunningSuite(robots, "arena:=" + arena) as stage:
        start_moving(stage, robots, controller)
        stage.start(["rosrun", "hero_monitor", "monitor", "_port:=%d" % port, "_control:=true"])
        stage.wait_for(lambda: is_open(port), "the monitor")
        page = MonitorPage("http://127.0.0.1:%d/" % port)
        try:
            page.open()
            wait_while_they_walk(stage)
            page.choose("hero_0")
            page.browser.save_screenshot(str(picture))
        finally:
            page.close()


def is_open(port):
    """Return whether somebody listens on a port of this machine."""
    with socket.socket() as sock:
        return sock.connect_ex(("127.0.0.1", port)) == 0


PICTURES = {
    "rviz_robot": lambda picture: photograph_rviz(picture, 1, "empty", *CLOSE_UP, part=ROBOT),
    "monitor": lambda picture: photograph_monitor(picture, 10, "obstacles"),
    "rviz_swarm": lambda picture: photograph_rviz(picture, 4, "empty"),
    "rviz_obstacles": lambda picture: photograph_rviz(picture, 8, "obstacles", is_filmed=True),
    "rviz_design": lambda picture: photograph_rviz(picture, 8, SPOT, controller=DESIGNED),
    "monitor_design": lambda picture: photograph_monitor(picture, 8, SPOT, DESIGNED),
}


if __name__ == "__main__":
    if MISSING or NO_BROWSER:
        sys.exit(f"screen_pictures: not installed: {', '.join([*MISSING, *NO_BROWSER])} (script/bootstrap --test)")
    make_pictures(PICTURES, PICTURES_FOLDER, __doc__)
