"""Runs the example programs with simulated robots and draws what these truly did. Started by script/pictures.

Every picture is recorded in its own process, with a ROS master, a driver and a simulator of its own.
"""

import json
import math
import sys
from pathlib import Path

import rospy
from drawing import draw_lights, draw_paths
from geometry_msgs.msg import PoseStamped
from picture_program import make_pictures

from hero_client import Robot
from hero_sim.world import load_arena

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "test" / "bench"))
from running_suite import RunningSuite  # noqa: E402

from hero_test.watches.light_watch import LightWatch  # noqa: E402
from hero_test.watches.swarm_watch import SwarmWatch  # noqa: E402

DOCS = ROOT / "hero_examples" / "docs"


def arena_file(name):
    """Return the path of an arena of the tests."""
    return str(ROOT / "test" / "hero_test" / "arenas" / (f"{name}_arena.yaml"))


class Recording:
    """A stage, and what its robots truly do from begin() on."""

    def __init__(self, robots, arena, *arguments):
        """robots: how many. arena: a name or a file. arguments: more of hero_bringup.launch."""
        self.arena = load_arena(arena)
        self.stage = RunningSuite(robots, "arena:=" + arena, *arguments)
        self.watch = SwarmWatch(range(robots))
        self.watch.wait_until_complete()
        self.first = {}
        self.begin()

    def begin(self):
        """Forget what was before."""
        self.first = {robot_id: len(rows) - 1 for robot_id, rows in self.watch.rows.items()}

    def paths(self, *robot_ids):
        """Return the rows of these robots, of all without any, since begin()."""
        chosen = robot_ids or self.first
        return {robot_id: self.watch.path(robot_id)[self.first[robot_id] :] for robot_id in chosen}

    def go_on(self, seconds):
        """Return when the robots have had so much more time."""
        rows = self.watch.rows[0]
        end_s = rows[-1][0] + seconds
        self.stage.wait_for(lambda: rows[-1][0] >= end_s, f"{seconds:g} s of robots", 2.0 * seconds + 10.0)

    def wait_until_all_rest(self, what, timeout_s):
        """Wait until nobody has moved or turned for a second."""

        def rest():
            return all(math.dist(rows[-1][1:4], rows[-20][1:4]) < 0.002 for rows in self.watch.rows.values())

        self.stage.wait_for(rest, what, timeout_s)

    def wait_until_all_are_at(self, goals, near_m, timeout_s):
        """Wait until every robot stands near its goal: [(x, y)] in the order of the ids."""

        def there():
            return all(math.dist(self.watch.pose(robot_id)[:2], goal) < near_m for robot_id, goal in enumerate(goals))

        self.stage.wait_for(there, "robots at their goals", timeout_s)
        self.wait_until_all_rest("robots at rest at their goals", timeout_s)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.stage.close()


def random_walk(picture):
    """Ten robots for a minute."""
    with Recording(10, "obstacles") as recording:
        recording.stage.start_example("random_walk", "_robots:=0-9", "_seed:=1")
        recording.go_on(60.0)
        draw_paths(picture, "random_walk: ten robots, one minute", recording.arena, recording.paths())


def go_to_goal(picture):
    """Ten robots, three goals each, from the topic."""
    arena = Path(__file__).with_name("plots_arena.yaml")
    with Recording(10, str(arena)) as recording:
        recording.stage.start_example("go_to_goal", "_robots:=0-9")
        publishers = [rospy.Publisher("/hero_%d/goal" % i, PoseStamped, queue_size=1) for i in range(10)]
        recording.stage.wait_for(lambda: all(p.get_num_connections() for p in publishers), "go_to_goal")
        starts = [recording.watch.pose(robot_id) for robot_id in range(10)]
        goals = []
        for turn_rad in (0.6, 2.9, 4.7):
            round_goals = [(x_m + 0.3 * math.cos(turn_rad), y_m + 0.3 * math.sin(turn_rad)) for x_m, y_m, _ in starts]
            for publisher, goal in zip(publishers, round_goals):
                target = PoseStamped()
                target.header.frame_id = "world"
                target.pose.position.x, target.pose.position.y = goal
                target.pose.orientation.w = 1.0
                publisher.publish(target)
            goals += round_goals
            recording.wait_until_all_are_at(round_goals, 0.25, 60.0)
        draw_paths(
            picture,
            "go_to_goal: three goals each, all with heading 0",
            recording.arena,
            recording.paths(),
            goals,
            size_inch=(9, 4.2),
        )


def swarm_go_to(picture):
    """Ten robots that swap places."""
    with Recording(10, arena_file("circle")) as recording:
        goals = [(-x_m, -y_m) for x_m, y_m, _ in map(recording.watch.pose, range(10))]
        swap = json.dumps({"shape": "points", "points": goals})
        recording.stage.start_example("swarm_go_to", "_robots:=0-9", "_formation:=" + swap, "_assign:=false")
        recording.wait_until_all_are_at(goals, 0.3, 120.0)
        near = ((-0.85, 0.85), (-0.85, 0.85))
        draw_paths(picture, "swarm_go_to: ten robots swap places", recording.arena, recording.paths(), only_m=near)


def follow(picture):
    """A leader on a curve, two followers."""
    with Recording(3, arena_file("examples")) as recording:
        recording.stage.start_example("follow", "_robots:=0 1 2")
        with Robot(0) as leader:
            leader.wait_until_ready()
            leader.drive(0.08, 0.0, duration_s=4.0)
            leader.drive(0.08, 0.35, duration_s=9.0)
            leader.drive(0.08, -0.35, duration_s=9.0)
        recording.wait_until_all_rest("followers that have caught up", 20.0)
        near = ((-0.65, 0.65), (-0.15, 1.0))
        draw_paths(
            picture,
            "follow: hero_0 is driven, the others follow",
            recording.arena,
            recording.paths(),
            only_m=near,
            size_inch=(6, 5),
        )


def led_show(picture):
    """The three patterns on eight robots, two rounds each."""
    with Recording(8, "empty") as recording:
        lights = LightWatch()
        shows = {}
        for pattern in ("rainbow", "chase", "blink"):
            program = recording.stage.start_example("led_show", "__name:=" + pattern, "_pattern:=" + pattern)
            lights.rows.clear()
            # Every robot has some red within a round of each pattern; dark, or in its own blue, it does not listen yet.
            recording.stage.wait_for(lambda: count_reddened(lights) == 8, "robots that listen")
            recording.go_on(1.0)
            lights.rows.clear()
            recording.go_on(8.0)
            shows["pattern:=" + pattern] = list(lights.rows)
            program.terminate()
            program.wait()
            recording.stage.wait_for(lambda: max(map(max, lights.colors.values())) < 0.5, "darkness")
        draw_lights(picture, shows)


def count_reddened(lights):
    """Return how many robots have had red in their light in the recorded rows."""
    return len({robot for _, colors in list(lights.rows) for robot, color in colors.items() if color[0] > 0.5})


def measure_delay(picture):
    """The program's own plot, for four robots in a router's network."""
    with Recording(4, "empty", "wifi:=router") as recording:
        program = recording.stage.start_example("measure_delay", "_turns:=10", f"_plot:={picture}")
        if program.wait(180.0):
            raise SystemExit("measure_delay ended with %d" % program.returncode)


PICTURES = {item.__name__: item for item in (random_walk, go_to_goal, swarm_go_to, follow, led_show, measure_delay)}


if __name__ == "__main__":
    make_pictures(PICTURES, DOCS, __doc__)
