"""Who a robot is by the names of its topics, and which names it may use."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hero_driver.fleet.namespaces import RESERVED, Identity, find_refusal, identify, resolve


@pytest.mark.parametrize(
    "name, identity",
    [
        ("/hero_0/laser", Identity("/hero_0", 0)),
        ("hero_0/laser_enable", Identity("/hero_0", 0)),
        ("/hero_12/velocity_controller/cmd_vel", Identity("/hero_12", 12)),
        ("/hero_999999/odom", Identity("/hero_999999", 999999)),
    ],
)
def test_a_hero_is_known_by_its_namespace(name, identity):
    assert identify(name) == identity


@pytest.mark.parametrize(
    "name",
    [
        "/tf",
        "tf",
        "/hero_0",
        "/hero_0/",
        "/hero/odom",
        "/hero_/odom",
        "/hero_x/odom",
        "/hero_01/odom",  # another text for the same number would be another namespace
        "/hero_-1/odom",
        "/hero_1000000/odom",
        "/hero_0_1/odom",
        "/other_0/odom",
        "/Hero_0/odom",
        "//hero_0/odom",
        "/x/hero_0/odom",
        "/hero_٣/odom",
        "",
    ],
)
def test_other_names_are_no_heros(name):
    assert identify(name) is None


def test_a_hero_may_use_its_own_namespace_with_or_without_a_slash_and_tf():
    identity = Identity("/hero_1", 1)
    assert resolve("/hero_1/odom", identity) == "/hero_1/odom"
    assert resolve("hero_1/laser_enable", identity) == "/hero_1/laser_enable"
    assert resolve("/hero_1/velocity_controller/cmd_vel", identity) == "/hero_1/velocity_controller/cmd_vel"
    assert resolve("/tf", identity) == "/tf"
    assert resolve("tf", identity) == "/tf"


@pytest.mark.parametrize(
    "name",
    ["/hero_2/odom", "/hero_10/odom", "/hero_1", "/hero_1x/odom", "/tf_static", "/tf/x", "/clock", "~odom", "odom"],
)
def test_a_hero_may_not_use_other_names(name):
    assert resolve(name, Identity("/hero_1", 1)) is None


@given(number=st.integers(0, 999999), rest=st.text("abc_/", min_size=1, max_size=10))
def test_what_identifies_a_hero_is_a_name_that_it_may_use(number, rest):
    name = "/hero_%d/%s" % (number, rest)
    identity = identify(name)
    assert identity == Identity("/hero_%d" % number, number)
    assert resolve(name, identity) == name
    assert resolve(name[1:], identity) == name
    assert resolve(name, Identity("/hero_%d" % (number + 1), number + 1)) is None


def find(name, message_type="std_msgs/String", node="/lab/hero_driver", is_from_robot=True):
    return find_refusal(name, message_type, Identity("/hero_1", 1), node, is_from_robot)


@pytest.mark.parametrize(
    "name", ["measured_pose", "pose", "ground_truth", "neighbors", "proximity", "goal", "go_to/goal", "cmd_vel"]
)
def test_no_robot_may_send_what_would_move_it_in_the_map_or_drive_it(name):
    for slash in ("/", ""):
        assert "robots do not send it" in find(slash + "hero_1/" + name)
    assert find("/hero_1/" + name, is_from_robot=False) is None
    assert find("/hero_1/own/" + name) is None


@pytest.mark.parametrize("message_type", ["hero_msgs/RobotArray", "hero_common/RobotArray"])
def test_no_robot_may_declare_the_type_by_which_drivers_are_found(message_type):
    assert find("/hero_1/friends", message_type) == RESERVED


@pytest.mark.parametrize("name", ["/hero_1/hero_driver", "/hero_1/hero_driver/stop", "hero_1/hero_driver/stop_request"])
def test_no_robot_may_use_the_names_of_a_driver_within_its_namespace(name):
    assert find(name, node="/hero_1/hero_driver") == RESERVED
    assert find(name) is None


@pytest.mark.parametrize(
    "name", ["/hero_10/odom", "/chatter", "chatter", "/lab/hero_driver/stop", "~stop", "/rosout", "/clock"]
)
def test_a_hero_stays_within_its_namespace(name):
    assert find(name) == "outside /hero_1"
    assert find("/hero_1/odom") is None
