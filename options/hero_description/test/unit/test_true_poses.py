"""The frames of simulated robots where they truly are."""

from pathlib import Path

import pytest

true_poses = pytest.importorskip("hero_description.true_poses", reason="imports rospy")
from nav_msgs.msg import Odometry  # noqa: E402

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
