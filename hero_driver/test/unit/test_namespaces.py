"""Who a robot is by the names of its topics, and which names it may use."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hero_driver.fleet.namespaces import RESERVED, Identity, NameRules, identify, identify_any, resolve


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


def test_a_device_is_known_by_a_name_like_a_heros_or_by_its_address():
    assert identify_any("/rover_7/odom", "10.42.0.9") == Identity("/rover_7", 7)
    assert identify_any("/hero_3/odom", "10.42.0.9") == Identity("/hero_3", 3)
    assert identify_any("chatter", "10.42.0.9") == Identity("/device_10_42_0_9_chatter", -1)
    assert identify_any("chatter", "fe80::1%wlan0") == Identity("/device_fe80_1_wlan0_chatter", -1)


@given(number=st.integers(0, 999999), rest=st.text("abc_/", min_size=1, max_size=10))
def test_what_identifies_a_hero_is_a_name_that_it_may_use(number, rest):
    name = "/hero_%d/%s" % (number, rest)
    identity = identify(name)
    assert identity == Identity("/hero_%d" % number, number)
    assert resolve(name, identity) == name
    assert resolve(name[1:], identity) == name
    assert resolve(name, Identity("/hero_%d" % (number + 1), number + 1)) is None


@given(name=st.text(max_size=30), host=st.text(max_size=20))
def test_any_name_gives_a_namespace_that_ros_can_use(name, host):
    namespace = identify_any(name, host).namespace
    assert namespace[0] == "/"
    assert namespace[1:].replace("_", "").isalnum()


HERO = Identity("/hero_1", 1)
DEVICE = Identity("/arm_2", 2)
ANY = NameRules("any", "/lab/hero_driver")


@pytest.mark.parametrize(
    "name, resolved",
    [("/chatter", "/chatter"), ("chatter", "/lab/chatter"), ("tf", "/tf"), ("/hero_1/odom", "/hero_1/odom")],
)
def test_where_any_name_goes_a_device_uses_it_as_ros_resolves_it(name, resolved):
    assert ANY.find_refusal(name, "std_msgs/String", True, DEVICE) is None
    assert ANY.resolve(name, DEVICE) == resolved


def test_a_hero_among_devices_keeps_its_own_names():
    assert ANY.resolve("hero_1/laser_enable", HERO) == "/hero_1/laser_enable"
    assert ANY.find_refusal("/hero_1/stop", "std_msgs/Bool", False, HERO) is None


@pytest.mark.parametrize("identity", [HERO, DEVICE, Identity("/hero_driver_2", 2)])
@pytest.mark.parametrize("is_published", [True, False])
@pytest.mark.parametrize(
    "name",
    [
        "/lab/hero_driver/stop",
        "/lab/hero_driver/set_logger_level",
        "/lab/hero_driver",
        "hero_driver/stop",
        "~stop",
        "~anything",
        "/other/stop",
        "/hero_driver_2/robots",
        "/hero_driver_2/stop_request",
        "stopped",
        "/x/y/robots",
    ],
)
def test_what_drivers_serve_is_refused_under_any_name(name, is_published, identity):
    assert ANY.find_refusal(name, "std_msgs/Bool", is_published, identity) == RESERVED


@pytest.mark.parametrize(
    "name", ["/rosout", "/rosout_agg", "/diagnostics", "/diagnostics_agg", "/clock", "/tf_static"]
)
def test_devices_may_listen_to_what_all_of_ros_reads_but_not_speak_there(name):
    assert ANY.find_refusal(name, "std_msgs/String", True, DEVICE) == RESERVED
    assert ANY.find_refusal(name, "std_msgs/String", False, DEVICE) is None


@pytest.mark.parametrize("policy", ["robot", "any"])
@pytest.mark.parametrize("message_type", ["hero_msgs/RobotArray", "hero_common/RobotArray"])
def test_no_robot_may_declare_the_type_by_which_drivers_are_found(policy, message_type):
    rules = NameRules(policy, "/hero_driver")
    assert rules.find_refusal("/hero_1/friends", message_type, True, HERO) == RESERVED


def test_a_hero_stays_within_its_namespace_where_the_policy_says_so():
    rules = NameRules("robot", "/hero_driver")
    assert rules.find_refusal("/hero_1/odom", "nav_msgs/Odometry", True, HERO) is None
    assert "outside /hero_1" in rules.find_refusal("/hero_10/odom", "nav_msgs/Odometry", True, HERO)
