#!/usr/bin/env python3
"""Ten random walkers among obstacles for two minutes, judged by the simulator's ground truth."""

import sys
import unittest
from functools import partial

import rosnode
import rospy
import rostest

from hero_sim.world.arena import measure_clearance
from hero_sim.world.arena_file import load_arena
from hero_test.swarm_watch import SwarmWatch
from hero_test.waiting import wait_for

WALK_S = 120.0

CELL_M = 0.2
"""Side of a cell: what one robot with its sensors covers."""


class RandomWalkTest(unittest.TestCase):
    def test_walkers_touch_nothing_visit_most_cells_and_stop_at_the_end(self):
        watch = SwarmWatch(range(10))
        watch.wait_until_complete(60.0)
        start_s = rospy.get_time()
        wait_for(lambda: rospy.get_time() - start_s > WALK_S, "the end of the walk", 3.0 * WALK_S)
        rosnode.kill_nodes(["/random_walk"])
        ids = sorted(watch.rows)

        def all_rest():
            return all(abs(watch.rows[robot_id][-1][4]) < 0.001 for robot_id in ids)

        wait_for(all_rest, "robots at rest after the walk", 3.0)
        watch.close()
        arena = load_arena("obstacles")
        clearance = partial(measure_clearance, arena=arena)
        touches = watch.seen_touches(clearance)
        share = watch.visited_share(arena.bounds_m, clearance, CELL_M)
        lengths_m = watch.lengths_m()
        sys.stdout.write(
            "touches %s\nvisited %.2f\nlengths %s\nthis machine stood still %d times\n"
            % (touches, share, lengths_m, len(watch.stalls_s))
        )
        self.assertEqual([], touches)
        self.assertGreaterEqual(share, 0.8)
        self.assertGreater(min(lengths_m.values()), 2.0)


if __name__ == "__main__":
    rospy.init_node("test_random_walk")
    rostest.rosrun("hero_examples", "random_walk", RandomWalkTest, sys.argv)
