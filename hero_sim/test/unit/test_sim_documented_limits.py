"""What the documents tell users of the robot's numbers is what simulated robots do, as real ones did."""

import re
import struct
from pathlib import Path

import pytest
from driver_side import POSITION, RECEIVED, SENT, VELOCITY, DriverSide, read_text

DOCS = Path(__file__).resolve().parents[3] / "docs"
G_COUNTS = 8192
"""1 g of the hat's accelerometer: 16 bits over 4 g to either side."""


def find_number(page, pattern):
    """Return the number of a sentence that a page holds once."""
    (number,) = re.findall(pattern, " ".join((DOCS / page).read_text(encoding="utf-8").split()))
    return float(number)


def count_lost(monkeypatch, hz):
    """Return how many of the commands of 20 s a robot dropped."""
    driver = DriverSide()
    driver.start_streaming()
    controller, taken = driver.swarm.robots[0].motors.velocity, []
    command = controller.command
    monkeypatch.setattr(controller, "command", lambda now_ms, targets: (taken.append(now_ms), command(now_ms, targets)))
    count, start_ms = round(20.0 * hz), driver.swarm.now_ms
    for number in range(count):
        driver.send_twist(0, 0.1, 0.0, VELOCITY)
        driver.run(start_ms + round(1000.0 * (number + 1) / hz) - driver.swarm.now_ms)
    return count - len(taken)


@pytest.mark.slow
def test_the_documented_rate_of_commands_is_the_highest_that_is_taken(monkeypatch):
    most_hz = find_number("robot_interface.md", r"10 Hz is enough, (\d+) Hz the maximum")
    assert count_lost(monkeypatch, most_hz) <= 1, "the last one may wait"
    assert count_lost(monkeypatch, most_hz + 1.0) > 3


@pytest.mark.parametrize(
    ("topic", "send"),
    [
        ("/velocity_controller/cmd_vel", lambda driver: driver.send_twist(0, 0.1, 0.0, VELOCITY)),
        ("/position_controller/cmd_vel", lambda driver: driver.send_twist(0, 0.1, 0.0, POSITION)),
        ("/cmd_motor", lambda driver: driver.send(0, RECEIVED["cmd_motor"], struct.pack("<HH", 1400, 1600))),
    ],
)
def test_motors_are_off_the_documented_time_after_the_last_command(topic, send):
    after_s = find_number("robot_interface.md", re.escape(topic) + r"`.*?stops after (\d+) s")
    driver = DriverSide()
    driver.start_streaming()
    send(driver)
    driver.run(round(1000.0 * after_s) - 50)
    assert driver.swarm.robots[0].motors.motors.attached
    driver.run(200)
    assert not driver.swarm.robots[0].motors.motors.attached


def test_an_imu_message_is_in_the_documented_units():
    scale = find_number(
        "robot_interface.md", r"angular velocity is in raw counts, linear acceleration in raw counts / (\d+)"
    )
    assert find_number("recording.md", r"acceleration in (\d+) counts") == scale
    driver = DriverSide("--imu-hat")
    driver.start_streaming()
    payload = driver.list_packets(0, SENT["imu"])[-1].payload
    _, start = read_text(payload, 12)
    gravity = struct.unpack_from("<37d", payload, start)[27]
    assert gravity == pytest.approx(G_COUNTS / scale)
    assert gravity == pytest.approx(find_number("recording.md", r"1 g is ([\d.]+)\)"))
