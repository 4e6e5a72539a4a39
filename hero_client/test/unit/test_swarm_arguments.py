"""What a Swarm is made of: numbers of robots, or an error that says so before anything is connected."""

from types import SimpleNamespace
from unittest.mock import call, create_autospec

import pytest

pytest.importorskip("rospy", reason="Swarm imports rospy")
from hero_client import swarm as swarm_module
from hero_client.ros import drivers as drivers_module
from hero_client.ros.drivers import Drivers
from hero_client.swarm import Swarm
from hero_client.values.errors import RobotNotReadyError
from hero_msgs.msg import Robot, RobotArray
from hero_node import ProgramError


def test_a_program_opens_its_swarm_or_waits_for_robots(monkeypatch):
    opened, logged = [], []
    program = SimpleNamespace(running=True, sleep=None)
    monkeypatch.setattr(swarm_module, "Swarm", lambda *given: opened.append(given) or "swarm")
    assert swarm_module.open_swarm(program, [1]) == "swarm" and opened == [([1], True, True)]
    assert swarm_module.open_swarm(program, [], False, False) == "swarm" and opened[1] == ([], False, False)
    answers = [RobotNotReadyError("no driver"), RobotNotReadyError("ends")]

    def discover(timeout_s, *given):
        if not answers:
            return (timeout_s, *given)
        program.running = len(answers) > 1
        raise answers.pop(0)

    monkeypatch.setattr(swarm_module, "Swarm", SimpleNamespace(discover=discover))
    monkeypatch.setattr(swarm_module.rospy, "logwarn", lambda *said: logged.append(said[1]))
    with pytest.raises(ProgramError, match="ended before any robot was there"):
        swarm_module.open_swarm(program, None)
    assert list(map(str, logged)) == ["no driver"]
    program.running = True
    assert swarm_module.open_swarm(program, None) == (5.0, True, True, None)


def test_a_swarm_is_discovered_by_the_drivers(monkeypatch):
    made, drivers = [], create_autospec(Drivers)
    drivers.wait_for_robots.return_value = [2, 5]
    monkeypatch.setattr(swarm_module, "start_node", lambda: None)
    monkeypatch.setattr(swarm_module, "share_drivers", lambda: drivers)
    monkeypatch.setattr(Swarm, "__init__", lambda self, *given: made.append(given))
    Swarm.discover(3.0, proximity=False, sleep=bool)
    drivers.wait_for_robots.assert_called_once_with(3.0, bool)
    assert made == [([2, 5], True, False)]


def test_robots_are_waited_for_until_all_drivers_are_known(monkeypatch):
    clock = SimpleNamespace(now_s=100.0)

    def sleep(duration_s):
        clock.now_s += duration_s
        return True

    rows = [Robot(id=number, state=Robot.READY) for number in (5, 0, -1)] + [Robot(id=3)]
    monkeypatch.setattr(drivers_module, "time", SimpleNamespace(monotonic=lambda: clock.now_s))
    drivers = Drivers.__new__(Drivers)
    drivers.read_each = lambda: {} if drivers.report is None else {"/hero_driver": drivers.report}
    drivers.read = lambda: drivers.report
    monkeypatch.setattr(Drivers, "is_settled", False)
    for report, says in (
        (None, "nothing on /hero_driver/robots within 3 s"),
        (RobotArray(robots=rows[2:]), "no robot joined"),
    ):
        drivers.report, clock.now_s = report, 100.0
        with pytest.raises(RobotNotReadyError, match=says):
            drivers.wait_for_robots(3.0, sleep)
        assert clock.now_s == pytest.approx(103.0, abs=0.03)
    drivers.report, clock.now_s = RobotArray(robots=rows), 100.0
    assert drivers.wait_for_robots(3.0, sleep, [5]) == [0, 5] and clock.now_s == pytest.approx(100.02)
    assert drivers.wait_for_robots(3.0, sleep, [5, 3]) == [0, 5] and clock.now_s == pytest.approx(103.02, abs=0.03)
    with pytest.raises(RobotNotReadyError):
        drivers.wait_for_robots(3.0, sleep)
    monkeypatch.setattr(Drivers, "is_settled", True)
    assert drivers.wait_for_robots(3.0, sleep) == [0, 5]


@pytest.mark.parametrize("wrong", [3, "012", True, None])
def test_a_swarm_of_no_list_is_refused_with_what_to_write(wrong):
    with pytest.raises(ValueError, match=r"such as \[0, 1, 2\] or range\(3\), not by %r" % (wrong,)):
        Swarm(wrong)


def test_a_swarm_stops_and_releases_all_drivers_and_tells_the_outcome():
    swarm = Swarm.__new__(Swarm)
    swarm.drivers = create_autospec(Drivers, instance=True)
    for change, stopped in ((swarm.emergency_stop, True), (swarm.release_stop, False)):
        swarm.drivers.reset_mock()
        assert change() is swarm.drivers.wait_for_stop.return_value
        assert swarm.drivers.mock_calls == [call.request_stop(stopped), call.wait_for_stop()]
