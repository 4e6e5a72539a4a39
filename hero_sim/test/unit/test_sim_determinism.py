"""The same seed gives the same bytes: alone, in a batch, and on every machine."""

import hashlib

import numpy as np
import pytest

from hero_node.robot_constants import BODY_RADIUS_M
from hero_sim.world import contacts
from hero_sim.world.arena import place_robots
from hero_sim.world.arena_file import load_arena
from hero_sim.world.robot_errors import RobotErrors, draw_errors
from hero_sim.world.world import World

ROBOTS = 20
STEPS = 6000
COMMAND_STEPS = 40
SCAN_STEPS = 20

HASH = "476f5f6d3e120d10fdd12e0622f4aa22b7c3a5f55681a1589bf57018e928e7e4"
"""Of seed 7, with numpy 1.17 to 2.2 and with and without AVX2, AVX-512 and FMA."""


def build_world(seeds):
    arena = load_arena("obstacles")
    poses = [place_robots(arena, ROBOTS, np.random.RandomState(seed)) for seed in seeds]
    errors = [draw_errors([np.random.RandomState([seed, robot]) for robot in range(ROBOTS)]) for seed in seeds]
    rngs = [np.random.RandomState(seed) for seed in seeds]
    return World(arena, np.concatenate(poses), rngs, RobotErrors(*map(np.concatenate, zip(*errors))))


def drive(*seeds, steps=STEPS):
    """Drive each seed's robots, all in one batch; return the hashes of their logs and how often they met."""
    world = build_world(seeds)
    everybody = np.arange(len(world.poses))
    rngs = [np.random.RandomState(seed) for seed in seeds]
    hashes, meetings = [hashlib.sha256() for _ in seeds], 0
    for step in range(steps):
        if step % COMMAND_STEPS == 0:
            # At random, and every fifth stops.
            world.write_pulses(True, np.concatenate([rng.randint(1250, 1751, (ROBOTS, 2)) for rng in rngs]).T)
            world.release(everybody[step // COMMAND_STEPS % 5 :: 5])
        world.step()
        logs = [world.poses, world.travels_m]
        if step % SCAN_STEPS == 0:
            logs.append(world.read_infrared(everybody))
            meetings += count_meetings(world)
        for log in logs:
            for part, log_hash in zip(np.split(log, len(seeds)), hashes):
                log_hash.update(part.tobytes())
    return [log_hash.hexdigest() for log_hash in hashes], meetings


def count_meetings(world):
    places_m = world.poses[:, :2].reshape(world.worlds, -1, 1, 2)
    apart_m = np.hypot(*(places_m - places_m.swapaxes(1, 2)).transpose(3, 0, 1, 2))
    return int((apart_m[apart_m > 0.0] < 2.0 * BODY_RADIUS_M + 1e-6).sum() // 2)


@pytest.mark.slow
def test_a_world_gives_the_same_bytes_on_every_machine():
    hashes, meetings = drive(7)
    assert hashes == [HASH]
    assert meetings > 50


@pytest.mark.slow
def test_a_world_in_a_batch_gives_the_same_bytes_as_alone():
    seeds = (3, 7, 5)
    together, meetings = drive(*seeds, steps=500)
    assert together == [drive(seed, steps=500)[0][0] for seed in seeds]
    assert meetings > 5
    assert len(set(together)) == len(seeds)


@pytest.mark.slow
def test_it_changes_nothing_how_seldom_neighbors_are_looked_up(monkeypatch):
    usual, meetings = drive(7, steps=600)
    for margin_m in 0.0, 0.2:
        monkeypatch.setattr(contacts, "_MARGIN_M", margin_m)
        assert drive(7, steps=600) == (usual, meetings)
    assert meetings > 1
