from types import SimpleNamespace
from unittest.mock import call, create_autospec

import numpy as np
import pytest
from driver_side import parse_options

from hero_sim import faults
from hero_sim.build import build_simulator
from hero_sim.errors import OptionError
from hero_sim.simulator import Simulator


def test_a_fault_is_read_with_time_robot_and_values():
    assert faults.parse_fault("vanish@5:robot=1,for=3") == faults.Fault("vanish", 5.0, 1, 3.0)


def test_what_is_left_out_has_its_default():
    assert faults.parse_fault("garbage") == faults.Fault("garbage", 0.0, None, 200.0)


def test_a_clock_may_jump_backwards():
    assert faults.parse_fault("clock-jump:by=-30").value == -30.0


@pytest.mark.parametrize(
    "text, named",
    [
        ("explode", "explode"),
        ("", "''"),
        ("vanish@soon", "soon"),
        ("vanish@-1", "-1"),
        ("vanish@nan", "nan"),
        ("vanish:robot", "'robot'"),
        ("vanish:bytes=3", "bytes=3"),
        ("garbage:bytes=many", "many"),
    ],
)
def test_a_wrong_fault_is_refused_by_name(text, named):
    with pytest.raises(OptionError, match="fault") as caught:
        faults.parse_fault(text)
    assert named in str(caught.value)


def test_every_kind_of_fault_can_be_injected():
    reports = []
    simulator, injector = build_simulator(parse_options("--port", "9"), reports.append)
    for kind in faults.KINDS:
        injector.add(faults.parse_fault(kind))
        injector.run(0)
    simulator.link.close_all()
    assert reports[1:] == ["fault %s for hero_0" % kind for kind in faults.KINDS]


@pytest.mark.parametrize(
    ("kind", "value", "acts"),
    [
        ("vanish", 0.0, [call.switch_off(1)]),
        ("vanish", 1.5, [call.switch_off(1), call.reboot(1, after_ms=1500)]),
        ("duplicate", -1.0, [call.reboot(1, 4)]),
        ("duplicate", 0.0, [call.reboot(1, 0)]),
        ("leave", 0.25, [call.leave(1, 250)]),
    ],
)
def test_a_fault_does_to_its_robot_what_its_value_says(kind, value, acts):
    simulator = create_autospec(Simulator, instance=True)
    simulator.swarm = SimpleNamespace(robots=[SimpleNamespace(robot_id=4), SimpleNamespace(robot_id=5)])
    faults.KINDS[kind].act(simulator, 1, value)
    assert simulator.mock_calls == acts


def test_garbage_is_the_start_of_a_packet_and_random_bytes():
    simulator, sent = create_autospec(Simulator, instance=True), []
    robot = SimpleNamespace(send=sent.append, rng=np.random.RandomState(1))
    simulator.swarm = SimpleNamespace(robots=[None, robot])
    faults.KINDS["garbage"].act(simulator, 1, 20.0)
    assert sent[0].startswith(b"\xff\xfe") and len(sent[0]) == 22 and len(set(sent[0])) > 10
    assert simulator.mock_calls == [call.serve_robot(1)]


def test_faults_come_in_order_of_time_to_the_robots_that_they_name():
    reports, acts = [], []
    simulator, injector = build_simulator(parse_options("--port", "9", "--count", "2"), lambda line: None)
    injector._report = lambda line: reports.append((now_ms, line))
    simulator.leave = lambda index, for_ms: acts.append((index, for_ms))
    for text in ("frozen@3:for=2", "stall@1:robot=1,for=4", "clock-jump@2:robot=0,by=-7.5", "slow-service:by=0.25"):
        injector.add(faults.parse_fault(text))
    injector.add(faults.parse_fault("leave@2.5:robot=1,for=1.5"))
    for now_ms in range(0, 3100, 50):
        simulator.swarm.robots[0].clock.jump = acts.append
        injector.run(now_ms)
    simulator.link.close_all()
    assert reports == [
        (0, "fault slow-service for hero_0"),
        (0, "fault slow-service for hero_1"),
        (1000, "fault stall for hero_1"),
        (2000, "fault clock-jump for hero_0"),
        (2500, "fault leave for hero_1"),
        (3000, "fault frozen for hero_0"),
        (3000, "fault frozen for hero_1"),
    ]
    robots, start_ms = simulator.swarm.robots, simulator.swarm.now_ms
    assert acts == [-7.5, (1, 1500)] and [robot.answer_delay_ms for robot in robots] == [250, 250]
    assert [radio.stalled_until_ms for radio in simulator.radios] == [0, start_ms + 4000]
    assert [robot.due_ms for robot in robots] == [start_ms + 2000] * 2
