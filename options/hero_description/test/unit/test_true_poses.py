"""The frames of simulated robots where they truly are."""

from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock, create_autospec

import pytest

true_poses = pytest.importorskip("hero_description.true_poses", reason="imports rospy")
import rospy  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from sensor_msgs.msg import LaserScan  # noqa: E402
from std_msgs.msg import ColorRGBA  # noqa: E402

from hero_description import lights  # noqa: E402

URDF = (Path(__file__).resolve().parents[2] / "urdf" / "hero.urdf").read_text()


def test_links_hang_on_the_true_base_as_on_the_robots_own():
    links = {link.child_frame_id: link for link in true_poses.make_links("hero_7", URDF)}
    names = ("left_wheel_link", "right_wheel_link", "hat_link", "laser_link")
    assert set(links) == {f"hero_7/true/{name}" for name in names}
    assert {link.header.frame_id for link in links.values()} == {"hero_7/true/base_link"}
    left, right = (links[f"hero_7/true/{side}_wheel_link"].transform.translation.y for side in ("left", "right"))
    assert left == pytest.approx(0.0315) and right == pytest.approx(-0.0315)
    assert {link.transform.rotation.w for link in links.values()} == {1.0}


def test_the_base_is_where_the_ground_truth_says():
    truth = Odometry()
    truth.header.frame_id, truth.header.stamp.secs = "world", 7
    truth.pose.pose.position.x, truth.pose.pose.position.y = 0.3, -0.2
    truth.pose.pose.orientation.z, truth.pose.pose.orientation.w = 0.6, 0.8
    base = true_poses.make_base("hero_7", truth)
    assert (base.header.frame_id, base.header.stamp.secs, base.child_frame_id) == ("world", 7, "hero_7/true/base_link")
    place, turn = base.transform.translation, base.transform.rotation
    assert (place.x, place.y, place.z, turn.z, turn.w) == (0.3, -0.2, 0.0, 0.6, 0.8)


def run_main(monkeypatch, module, publisher, steps=(), **parameters):
    """Run the program with these parameters; return the type, callback and argument of each subscription."""
    received = []
    monkeypatch.setattr(rospy, "Publisher", lambda *arguments, **options: publisher)
    monkeypatch.setattr(
        rospy, "Subscriber", lambda topic, kind, *receive, queue_size: received.append((kind, *receive))
    )
    monkeypatch.setattr(rospy, "get_param", lambda name: URDF)
    monkeypatch.setattr(true_poses, "StaticTransformBroadcaster", Mock)
    monkeypatch.setattr(module, "read_parameters", lambda declared: {name: parameters[name] for name in declared})
    program = SimpleNamespace(running=False, rate=lambda rate_hz: steps)
    monkeypatch.setattr(module, "Program", lambda name: nullcontext(program))
    module.main()
    return received


@pytest.mark.parametrize(("module", "messages"), [(true_poses, [Odometry(), LaserScan()]), (lights, [ColorRGBA()])])
def test_what_comes_while_the_node_ends_is_dropped_silently(module, messages, monkeypatch):
    closed = create_autospec(rospy.Publisher, instance=True)
    closed.publish.side_effect = rospy.ROSException("topic was closed during publish()")
    received = run_main(monkeypatch, module, closed, robots=[7], hero_plus=(), simulated=())
    assert [kind for kind, *_ in received] == [type(message) for message in messages]
    for (_, receive, argument), message in zip(received, messages):
        receive(message, argument)
    assert closed.publish.call_count == len(messages)


def test_scans_are_seen_from_true_places_at_the_newest_pose(monkeypatch):
    publisher, scan = create_autospec(rospy.Publisher, instance=True), LaserScan(ranges=[0.1])
    scan.header.frame_id, scan.header.stamp = "hero_7/laser_link", rospy.Time(5)
    (_, receive, seen) = run_main(monkeypatch, true_poses, publisher, robots=[7])[1]
    receive(scan, seen)
    (shown,) = seen.publish.call_args.args
    assert (shown.header.frame_id, shown.header.stamp) == ("hero_7/true/laser_link", rospy.Time(0))
    assert seen is publisher and shown.ranges == [0.1]


def test_names_rings_and_lights_are_those_of_each_robots_model_and_place(monkeypatch):
    publisher = create_autospec(rospy.Publisher, instance=True)
    received = run_main(monkeypatch, lights, publisher, [0.0], robots=[4, 6, 7], hero_plus=[6], simulated=[6, 7])
    _, receive, robot_id = received[2]
    receive(ColorRGBA(1.0, 0.0, 0.0, 1.0), robot_id)
    (identities,), (lit,) = (call.args for call in publisher.publish.call_args_list)
    rings = [marker for marker in identities.markers if marker.ns == "rings"]
    assert [ring.points[0].x - lights.RING_GAP_M for ring in rings] == pytest.approx([0.036835, 0.06, 0.036835])
    frames = ["hero_4/base_link", "hero_6/true/base_link", "hero_7/true/base_link"]
    assert [marker.header.frame_id for marker in identities.markers] == [frame for frame in frames for _ in range(2)]
    assert [marker.header.frame_id for marker in lit.markers] == ["hero_7/true/hat_link"]
