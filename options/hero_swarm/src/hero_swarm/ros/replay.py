"""Publishes one run as the simulator publishes its world: markers of robots, objects and arena, in real time."""

import rospy
from visualization_msgs.msg import MarkerArray

from hero_client import Program
from hero_sim.ground_truth import make_markers
from hero_sim.scene import draw_arena, draw_objects, draw_robots

from ..trial import Trial

PERIOD_S = 0.1


def replay(trial: Trial, time_s: float, speed: float) -> None:
    """Run trial, of one world, for time_s, speed times as fast as time passes, or until the program is to end."""
    with Program("show") as program:
        arena, objects, robots = (
            rospy.Publisher("/hero_sim/" + name, MarkerArray, queue_size=2, latch=True)
            for name in ("arena", "object_markers", "replay")
        )
        world = trial.rows.world
        arena.publish(make_markers(draw_arena(world.arena)))
        names = ["hero_%d" % number for number in range(len(world.poses))]
        for _ in zip(trial.run(time_s, PERIOD_S * speed), program.rate(1.0 / PERIOD_S)):
            robots.publish(make_markers(draw_robots(world, names, trial.rows.lights.tolist())))
            objects.publish(make_markers(draw_objects(world.list_objects())))
