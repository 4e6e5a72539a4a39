"""The messages under the stock package's name."""

import pytest

import hero_common.msg
import hero_common.srv


@pytest.mark.parametrize(
    "kind, md5",
    [
        (hero_common.msg.Encoder, "b5586cdbae9b740afc6a1f403a2d7dde"),
        (hero_common.msg.Motor, "44d4249d207ce6a89de3d72080e4d0b5"),
        (hero_common.srv.SetIRCalibration, "fc55fd34ad2ef676815ba2e14521ac73"),
        (hero_common.srv.SetOdom, "4ed90569b1afd039b963e42a12637d2b"),
        (hero_common.srv.SetMotor, "07e32bced0fc14456815cdd097819b89"),
        (hero_common.srv.SetPID, "69c16eccc66fd6b477afb5e5500b4b47"),
    ],
)
def test_types_have_the_md5_sums_of_the_stock_package(kind, md5):
    assert kind._md5sum == md5


def test_a_request_is_made_as_with_the_stock_package():
    request = hero_common.srv.SetMotorRequest(left_motor_pwm=1500, right_motor_pwm=1490)
    assert (request.left_motor_pwm, request.right_motor_pwm) == (1500, 1490)
