"""Types equal those of the stock firmware (v3.8): md5 sums and order of fields, measured on the wire."""

import re
from pathlib import Path

import pytest

from hero_msgs import msg, srv

PACKAGE = Path(__file__).resolve().parents[2]
FLOAT64_FIELDS_OF_ENCODER = (
    "left_ticks right_ticks left_diff right_diff left_dist right_dist timestep left_speed right_speed"
    " left_speed_filtered right_speed_filtered"
).split()
RESPONSE_MD5 = "937c9679a518e3a18d831e57125ea522"


@pytest.mark.parametrize(
    ("message", "md5"),
    [(msg.Encoder, "b5586cdbae9b740afc6a1f403a2d7dde"), (msg.Motor, "44d4249d207ce6a89de3d72080e4d0b5")],
)
def test_messages_have_the_md5_that_the_robot_declares(message, md5):
    assert message._md5sum == md5


@pytest.mark.parametrize(
    ("service", "md5", "request_md5"),
    [
        (srv.SetIRCalibration, "fc55fd34ad2ef676815ba2e14521ac73", "27748d949ad62e65750ad22074426005"),
        (srv.SetOdom, "4ed90569b1afd039b963e42a12637d2b", "938fa65709584ad8e77d238529be13b8"),
        (srv.SetMotor, "07e32bced0fc14456815cdd097819b89", "44d4249d207ce6a89de3d72080e4d0b5"),
        (srv.SetPID, "69c16eccc66fd6b477afb5e5500b4b47", "f0d0bdba02bc62a48d52638e38dc8a4b"),
    ],
)
def test_services_have_the_md5s_that_the_robot_declares(service, md5, request_md5):
    assert service._md5sum == md5
    assert service._request_class._md5sum == request_md5
    assert service._response_class._md5sum == RESPONSE_MD5


def test_set_frequency_has_one_number_and_the_common_response():
    """Firmware v3.8 does not serve it, so its md5 was never measured."""
    assert srv.SetFrequencyRequest.__slots__ == ["frequency"]
    assert srv.SetFrequencyRequest._slot_types == ["float64"]
    assert srv.SetFrequencyResponse._md5sum == RESPONSE_MD5


@pytest.mark.parametrize(
    ("message", "names", "types"),
    [
        (msg.Encoder, ["header", *FLOAT64_FIELDS_OF_ENCODER], ["std_msgs/Header", *["float64"] * 11]),
        (msg.Motor, ["left_motor_pwm", "right_motor_pwm"], ["int16"] * 2),
        (srv.SetMotorRequest, ["left_motor_pwm", "right_motor_pwm"], ["int16"] * 2),
        (srv.SetOdomRequest, ["x", "y", "theta"], ["float64"] * 3),
        (srv.SetPIDRequest, ["lkp", "lki", "lkd", "rkp", "rki", "rkd"], ["float32"] * 6),
        (srv.SetIRCalibrationRequest, ["IR%d" % index for index in range(8)], ["float64"] * 8),
        (srv.SetPIDResponse, ["success", "message"], ["bool", "string"]),
    ],
)
def test_fields_are_in_the_order_of_the_wire(message, names, types):
    assert message.__slots__ == names
    assert message._slot_types == types


def definition_files():
    return sorted([*PACKAGE.glob("msg/*.msg"), *PACKAGE.glob("srv/*.srv"), *PACKAGE.glob("action/*.action")])


@pytest.mark.parametrize("path", definition_files(), ids=lambda path: path.name)
def test_every_field_is_documented_on_its_line(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("# "), "begins with the purpose of the type"
    for line in lines:
        if line.strip() and not line.startswith(("#", "---")):
            assert re.search(r"\S +# \S", line), line


@pytest.mark.parametrize("path", definition_files(), ids=lambda path: path.name)
def test_every_type_is_built_and_in_the_readme(path):
    module = msg if path.suffix == ".msg" else srv
    assert hasattr(module, path.stem) or path.suffix == ".action"
    assert "`%s`" % path.stem in (PACKAGE / "README.md").read_text(encoding="utf-8")
