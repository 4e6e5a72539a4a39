"""Sensors of the robots themselves, and of users, in behaviors: values, order, and what is refused."""

from typing import NamedTuple

import numpy as np
import pytest

from hero_client.values import sense_binary, sense_neighbors
from hero_sim.stepped import StepSwarm
from hero_sim.world import compiled
from hero_sim.world.arena import build_rectangle
from hero_swarm.behavior import Behavior, Binary, Distance, NeighborColors, Neighbors, Odometry, Proximity, Random
from hero_swarm.sensors import Surroundings, read_sensor
from hero_swarm.sensors.pair_loops import find_near, find_touched
from hero_swarm.trial import Trial
from hero_test.nonempty import nonempty

STARTS = np.array([[(0.1, 0.0, 0.0), (-0.5, 0.3, 1.0)]] * 2)


class Sensing(Behavior):
    near = Neighbors(range_m=5.0)
    eyes = Proximity()
    ahead = Distance()
    wheels = Odometry()
    lights = NeighborColors()

    def step(self, sensed, memory, random):
        return 0.05, np.where(sensed.numbers == 0, 0.0, 1.0), sensed

    def colors(self, memory):
        return np.column_stack((memory.numbers == 0, memory.numbers == 1, memory.numbers * 0)).astype(float)


def watch(steps):
    trial = Trial(Sensing(), build_rectangle(0.4, 2.0, 1), robots=2, seeds=[1, 2], starts=STARTS, errors=0.0)
    for _ in range(steps):
        trial.step()
    return trial, trial.state.sensed


def test_infrared_sensors_see_the_wall_in_front_first():
    _, sensed = watch(1)
    eyes = sensed.eyes
    assert eyes.ranges_m.shape == eyes.counts.shape == (4, 8)
    assert eyes.ranges_m[0, 0] == pytest.approx(0.1, abs=0.01), "the wall is 0.1 m ahead of the first robot's center"
    assert eyes.counts[0].argmax() == 0 and eyes.counts[0, 0] > 5.0 * eyes.counts[0, 4]
    assert np.isnan(sensed.ahead).all(), "a stock robot has no such sensor"


def test_odometry_is_what_the_wheels_rolled():
    trial, sensed = watch(30)
    moved_m = np.hypot(*(trial.poses - STARTS)[..., :2].reshape(-1, 2).T)
    assert np.hypot(*sensed.wheels.poses[:, :2].T)[1::2] == pytest.approx(moved_m[1::2], abs=0.01)
    assert sensed.wheels.angular_rad_s[1] > 0.5 > abs(sensed.wheels.angular_rad_s[0])


def test_readings_over_ros_are_those_of_the_rows_but_of_silent_robots(monkeypatch):
    own_readings = pytest.importorskip("hero_swarm.ros.own_readings", reason="readings of robots need ROS")
    with StepSwarm(4, first_id=3, seed=2, model="hero_plus,robot=5") as swarm:
        swarm.drive(0.1, 0.5, duration_s=0.5)
        asked = {robot: [] for robot in swarm}
        for robot in swarm:
            monkeypatch.setattr(robot._link, "subscribe", asked[robot].append)
        readings = own_readings.OwnReadings(swarm, Sensing().sensors())
        assert {tuple(sorted(topics)) for topics in asked.values()} == {("distance", "laser", "odom", "proximity")}
        monkeypatch.setattr(swarm[4]._link, "age_s", lambda topic: 1.1)
        for name in ("proximity_m", "counts", "distance_m", "odometry", "velocities"):
            expected = np.array(getattr(swarm.rows, name), dtype=float)
            expected[1] = np.nan
            np.testing.assert_array_equal(getattr(readings, name), expected, name)
        assert np.isfinite(readings.distance_m).tolist() == [False, False, True, False]


def test_colors_of_neighbors_are_those_of_the_last_step():
    _, first = watch(0)
    assert (first.lights == 0.0).all()
    _, sensed = watch(2)
    assert sensed.lights.shape == (4, 2, 3)
    assert sensed.lights[0].tolist() == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    assert sensed.lights[sensed.near.seen][:, :2].tolist() == [[0.0, 1.0], [1.0, 0.0]] * 2


def test_what_sensors_gave_stays_as_it_was():
    trial, sensed = watch(1)
    before = sensed.wheels.poses.copy(), sensed.eyes.counts.copy()
    for _ in range(20):
        trial.step()
    assert (sensed.wheels.poses == before[0]).all() and (sensed.eyes.counts == before[1]).all()
    with pytest.raises(ValueError, match="read-only"):
        sensed.wheels.poses[0] = 0.0


class Compass(NamedTuple):
    """A sensor of a user, which counts its steps."""

    gain: float = 1.0

    def read(self, around):
        around.kept["steps"] = around.kept.get("steps", 0) + 1
        return self.gain * around.poses[..., 2].ravel() + around.kept["steps"]


class Turning(Behavior):
    compass = Compass(gain=2.0)

    def step(self, sensed, memory, random):
        return 0.0, 0.0, sensed.compass


def test_a_user_writes_a_sensor_as_a_named_tuple_with_read():
    trial = Trial(Turning(), robots=2, seeds=[1, 2], starts=STARTS, errors=0.0)
    trial.step()
    trial.step()
    assert trial.memory == pytest.approx(2.0 * STARTS[..., 2].ravel() + 2.0)
    assert list(Turning().sensors()) == ["compass"]


@pytest.mark.parametrize("given", ["text", None, np.zeros(3), np.array(["a"] * 4), 1.0])
def test_a_sensor_that_gives_no_row_per_robot_is_named(given, monkeypatch):
    monkeypatch.setattr(Compass, "read", lambda sensor, around: given)
    trial = Trial(Turning(), robots=2, seeds=[1, 2], starts=STARTS)
    with pytest.raises(ValueError, match=r"sensor compass gives .*: read\(\) must return an array .* each of 4 robots"):
        trial.step()


def test_a_sensor_that_a_page_sets_meanwhile_is_read_as_set():
    trial, sensed = watch(1)
    assert sensed.near.seen.any()
    trial.behavior.near = Neighbors(range_m=0.05)
    trial.step()
    assert not trial.state.sensed.near.seen.any()


@pytest.mark.option("numba")
@pytest.mark.parametrize("sensor", [Binary(), Binary(range_m=0.3), Binary(range_m=0.0), Binary(half_angle_rad=0.1)])
def test_compiled_beams_see_what_others_see(monkeypatch, sensor):
    """Also of robots that touch, of some without a pose, and with errors."""
    poses = np.random.RandomState(0).uniform(-0.4, 0.4, (20, 15, 3)) * (1.0, 1.0, 10.0)
    poses[0, 3] = np.nan
    for error in (0.0, 0.2):
        seen = []
        for rows in (10**9, 0):
            monkeypatch.setattr(compiled, "COMPILED_ROWS", rows)
            around = Surroundings(0.0, poses, Random(range(20), 15))
            seen.append(read_sensor("sees", sensor._replace(error=error), around).tolist())
        assert seen[0] == seen[1] and len(set(seen[0])) == 2


@pytest.mark.parametrize("range_m", [0.3, float("inf")])
def test_loops_over_pairs_see_what_arrays_do(range_m):
    poses = np.random.RandomState(1).uniform(-0.4, 0.4, (5, 9, 3)) * (1.0, 1.0, 10.0)
    poses[0, 3] = np.nan
    poses[4] = (0.1, 0.2, 0.0)  # in each other: the sensors are right on the rims
    sees = sense_binary(poses, Binary(range_m=range_m), None, find_touched)
    assert sees.tolist() == sense_binary(poses, Binary(range_m=range_m)).tolist() and len(set(sees.tolist())) == 2
    near, others = (sense_neighbors(poses, Neighbors(range_m), None, find) for find in (find_near, None))
    for name, values, expected in nonempty(zip(near._fields, near, others)):
        np.testing.assert_array_equal(values, expected, name)


@pytest.mark.option("numba")
@pytest.mark.parametrize("range_m", [0.3, float("inf")])
def test_compiled_neighbors_are_those_that_others_see(monkeypatch, range_m):
    """Also of robots at the same place, and of some without a pose."""
    poses = np.random.RandomState(0).uniform(-0.4, 0.4, (20, 15, 3)) * (1.0, 1.0, 10.0)
    poses[0, 3], poses[1, 4] = np.nan, poses[1, 5]
    found = []
    for rows in (10**9, 0):
        monkeypatch.setattr(compiled, "COMPILED_ROWS", rows)
        near = read_sensor("near", Neighbors(range_m=range_m), Surroundings(0.0, poses, Random(range(20), 15)))
        found.append([values.tolist() for values in near])
    assert found[0] == found[1] and 0 < near.counts[:15].sum() <= 14 * 13 and not near.seen[3].any()


def test_a_reading_of_a_sensor_that_is_not_there_is_named():
    _, sensed = watch(1)
    with pytest.raises(AttributeError, match="^the behavior has no sensor 'eye'$"):
        sensed.eye  # noqa: B018
