import pytest
from driver_side import parse_options

from hero_sim import faults
from hero_sim.build import build_simulator
from hero_sim.errors import OptionError


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
