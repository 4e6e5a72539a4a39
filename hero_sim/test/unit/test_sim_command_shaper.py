"""CommandShaper against the driver's VelocityShaper, robot by robot."""

import struct

import numpy as np
import pytest

from hero_driver.commands import STOP_REPEATS, velocity_shaper
from hero_driver.commands.velocity_shaper import VelocityShaper
from hero_sim.stepped.rules.command_shaper import INTERVAL_MS, MAX_AGE_MS, CommandShaper

STOP = struct.pack("<2d", 0.0, 0.0)


class ScalarShapers:
    """One VelocityShaper for each robot, asked every millisecond as the driver's queue asks it."""

    def __init__(self, count):
        self.shapers = [VelocityShaper(STOP) for _ in range(count)]
        self.offered_ms = [0] * count
        self.sent = []

    def offer(self, now_ms, row, *values):
        self.shapers[row].offer(struct.pack("<2d", *np.float32(values).tolist()))
        self.offered_ms[row] = now_ms
        self.send(now_ms, row)

    def send(self, now_ms, row):
        if now_ms - self.offered_ms[row] > MAX_AGE_MS:
            self.shapers[row].discard_motion()
        payload = self.shapers[row].take(now_ms)
        if payload is not None:
            self.sent.append((now_ms, row, *struct.unpack("<2d", payload)))

    def take(self):
        sent, self.sent = self.sent, []
        return sent


@pytest.mark.parametrize("seed", range(5))
def test_each_robot_gets_what_the_drivers_shaper_sends(seed, monkeypatch):
    monkeypatch.setattr(velocity_shaper, "COMMAND_INTERVAL_S", INTERVAL_MS)  # it counts whole ms, as the simulator does
    rng, count = np.random.RandomState(seed), 3
    rows, scalar = CommandShaper(count, 0.0), ScalarShapers(count)
    sent = 0
    for now_ms in range(10000):
        for row in range(count):
            scalar.send(now_ms, row)
        while rng.random_sample() < 0.04:
            row, values = int(rng.randint(count)), rng.choice([0.0, rng.uniform(-1.0, 1.0)]) * np.ones(2)
            rows.offer(now_ms, row, *values.tolist())
            scalar.offer(now_ms, row, *values)
        if rng.random_sample() < 0.0005:  # a command is still on its way
            row, next_ms = int(rng.randint(count)), now_ms + int(rng.randint(100, 2 * MAX_AGE_MS))
            rows.take(now_ms)
            scalar.take()
            rows.delay_until(np.array([row]), np.array([next_ms]))
            scalar.shapers[row].delay_until(next_ms)
        if now_ms % 51 == 0:
            taken = rows.take(now_ms)
            found = [tuple(each) for each in zip(taken.at_ms.tolist(), taken.rows.tolist(), *taken.values.tolist())]
            assert sorted(found) == sorted(scalar.take())
            sent += len(found)
    assert sent > 100


def test_an_array_of_commands_is_shaped_as_single_ones_are():
    arrays, single, rng = CommandShaper(4, 0.0), CommandShaper(4, 0.0), np.random.RandomState(0)
    for now_ms in range(0, 2000, 17):
        rows = rng.permutation(4)[: rng.randint(1, 5)]
        values = rng.choice([0.0, 0.1, 0.2], (2, len(rows)))
        arrays.offer(now_ms, rows, *values)
        for row, first, second in zip(rows.tolist(), *values.tolist()):
            single.offer(now_ms, row, first, second)
        taken = [[each.tolist() for each in shaper.take(now_ms)] for shaper in (arrays, single)]
        assert taken[0] == taken[1]


def test_commands_of_one_instant_for_one_robot_keep_their_order():
    shaper = CommandShaper(1, 0.0)
    for value in (0.1, 0.0, 0.2):
        shaper.offer(0, 0, value, 0.0)
    sent = [shaper.take(now_ms).values[0].tolist() for now_ms in (0, 60, 120, 180)]
    assert sent == [[np.float32(0.1)], [0.0], [np.float32(0.2)], []]


def test_motion_that_waits_too_long_is_dropped_but_a_stop_is_sent():
    shaper = CommandShaper(2, 0.0)
    shaper.offer(0, [0, 1], 0.1, 0.1)
    shaper.take(0)
    shaper.delay_until(np.arange(2), np.array([10 + MAX_AGE_MS + 1] * 2))
    shaper.offer(10, [0, 1], [0.2, 0.0], 0.0)
    sent = shaper.take(10 + MAX_AGE_MS + 1)
    assert sent.rows.tolist() == [1] and not sent.values.any()


def test_motion_that_grew_old_behind_a_stop_is_not_sent_as_its_repeat():
    shaper = CommandShaper(1, 0.0)
    shaper.delay_until(np.array([0]), np.array([MAX_AGE_MS + 1]))
    shaper.offer(0, 0, 0.0, 0.0)
    shaper.offer(0, 0, 0.2, 0.0)
    sent = [shaper.take(MAX_AGE_MS + 1 + index * INTERVAL_MS).values.tolist() for index in range(STOP_REPEATS + 2)]
    assert sent == [[[0.0], [0.0]]] * (STOP_REPEATS + 1) + [[[], []]]


@pytest.mark.parametrize("rows", [(0, 0), (0, np.array([0])), (np.array([0]), 0), ([0], [0])])
def test_of_two_commands_at_one_time_the_later_one_is_sent_last(rows):
    shaper, sent = CommandShaper(2, 0.0), []
    for number, row in enumerate(rows, 1):
        shaper.offer(0, row, 0.5 * number, 0.25)
    shaper.offer(0, 1, 0.75, -0.5)
    for now_ms in (0, INTERVAL_MS - 1, INTERVAL_MS):
        taken = shaper.take(now_ms)
        sent += zip(taken.rows.tolist(), taken.at_ms.tolist(), *taken.values.tolist())
    assert sent == [(0, 0, 0.5, 0.25), (1, 0, 0.75, -0.5), (0, INTERVAL_MS, 1.0, 0.25)]
