"""Results that are kept of programs for robots in process, and what viewers and bags get (see kept_results)."""

import re

import numpy as np
import pytest

from hero_client import GoalError
from hero_sim.stepped.swarm import StepSwarm
from hero_sim.stepped.topics import StepTopics
from hero_test.checks.kept_results import Digest


def run_program(swarm, digest):
    """Let robots of two worlds do what programs ask for."""
    first, second, third = swarm.worlds[0].robots
    motions = [first.start_go_to(0.3, 0.1, frame="robot"), second.start_go_to(0.0, 0.0, yaw_rad=2.0, frame="robot")]
    third.drive(0.1, -0.8)
    swarm.sleep(0.7)
    swarm.worlds[1].robots[1].set_pose(0.5, -0.5, 1.0)
    second.led("green")
    swarm.worlds[1].drive(0.15, 0.3)
    for time_s in swarm.rate(7):
        digest.add(round(time_s, 6), [robot.proximity for robot in swarm], [robot.infrared_counts for robot in swarm])
        digest.add([np.round(near, 4).tolist() for robot in swarm.worlds[1] for near in robot.neighbors])
        if time_s > 2.0:
            break
    motions[0].cancel()
    motions.append(swarm.worlds[1].robots[2].start_go_to(-0.05, 0.0, frame="robot"))
    swarm.worlds[0].emergency_stop()
    swarm.sleep(0.5)
    swarm.worlds[0].release_stop()
    third.drive(0.05, 0.0)
    swarm.sleep(1.0)
    for motion in motions:
        try:
            digest.add(motion.result(20.0), round(swarm.now_s, 6))
        except GoalError as error:
            digest.add(re.sub(r"\d+\.\d+", "", str(error)), round(swarm.now_s, 6))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wifi", "kept"),
    [("ideal", "1674 126 8b7f7ff71560f80f"), ("hotspot", "1975 125 963a5404981a20ad")],
    ids=["ideal", "hotspot"],
)
def test_programs_in_process_make_robots_do_what_they_did(wifi, kept):
    swarm = StepSwarm(3, seed=2, first_id=4, arena="discs", wifi=wifi, worlds=2, model="hero_plus,robot=5")
    digest, sent = Digest(), []
    rows = swarm.log(ranges=True)
    topics = StepTopics(swarm.rows, [4, 5, 6], lambda *message: sent.append(message))
    with swarm:
        run_program(swarm, digest)
    topics.close()
    digest.add([(topic, kind, len(content), time_ns) for topic, kind, content, time_ns in sent])
    # Whole contents but for those with sines of angles, and commands that come from them.
    digest.add(*[content for topic, _, content, _ in sent if topic.endswith(("/proximity", "/distance"))])
    digest.add(
        rows.time_s, rows.pose, rows.true_pose, rows.velocity, np.round(rows.command, 6), np.minimum(rows.range_m, 9.0)
    )
    digest.add([robot.light for robot in swarm], [robot.age_s("odom") for robot in swarm])
    assert f"{len(sent)} {len(rows)} {digest}" == kept
