"""Topics and services of the programs: kinds, queues, and what comes at once or to who joins later."""

from unittest import mock

import pytest

pytest.importorskip("rospy", reason="topics are those of ROS")
pytest.importorskip("cv2")
import rospy

from hero_localization.camera import frame_source
from hero_localization.nodes import localize, map_arena, track
from hero_localization.simulated_camera import camera_node
from hero_node.parameters import check_parameters


@pytest.fixture
def declared(monkeypatch):
    """Return a list of what is subscribed to, published and served: (topic, type, keywords that differ from none)."""
    found = []

    def declare(topic, kind, *_, **given):
        found.append((topic, kind if isinstance(kind, str) else kind.__name__, *sorted(given.items())))
        return mock.Mock(get_num_connections=lambda: 0)

    for name in ("Subscriber", "Publisher", "Service"):
        monkeypatch.setattr(rospy, name, declare)
    monkeypatch.setattr(rospy, "resolve_name", lambda name: "/" + name)
    monkeypatch.setattr(rospy, "get_time", lambda: 7.0)
    monkeypatch.setattr(rospy, "get_rostime", lambda: rospy.Time(7))
    monkeypatch.setattr(frame_source, "keep_freed_memory", lambda: None)
    return found


AT_ONCE = ("tcp_nodelay", True)


def queue(size):
    return ("queue_size", size)


def test_localize_hears_of_robots_and_images_at_once(declared):
    localize.LocalizationNode(check_parameters(localize.PARAMETERS, {"robots": "3"}))
    assert declared == [
        ("~poses", "RobotPoses", queue(2)),
        ("/tf", "TFMessage", queue(10)),
        ("/diagnostics", "DiagnosticArray", queue(2)),
        ("/hero_3/pose", "PoseWithCovarianceStamped", queue(2)),
        ("/hero_3/odom", "AnyMsg", queue(30), AT_ONCE),
        ("/hero_3/measured_pose", "AnyMsg", queue(30), AT_ONCE),
        ("/track/measured_poses", "RobotPoses", queue(10), AT_ONCE),
        ("/tf_static", "TFMessage", queue(10)),
    ]


def test_track_keeps_its_outline_for_who_joins_later_and_one_image_only(declared, tmp_path):
    track.TrackNode(check_parameters(track.PARAMETERS, {"file": str(tmp_path / "camera.yaml")}))
    assert declared == [
        ("/tf_static", "TFMessage", ("latch", True), queue(1)),
        ("~measured_poses", "RobotPoses", queue(5)),
        ("~objects", "ObjectPoses", queue(5)),
        ("~picture", "Image", queue(1)),
        ("~picture/compressed", "CompressedImage", queue(1)),
        ("~picture/outline", "PolygonStamped", ("latch", True), queue(1)),
        ("/diagnostics", "DiagnosticArray", queue(2)),
        ("/localization/poses", "RobotPoses", queue(2), AT_ONCE),
        ("/camera/image_raw", "UncopiedImage", ("buff_size", 2**20), queue(1), AT_ONCE),
        ("/camera/camera_info", "CameraInfo", queue(1)),
    ]


def test_map_arena_keeps_its_map_and_hears_each_robot_once(declared, tmp_path):
    node = map_arena.MapNode(check_parameters(map_arena.PARAMETERS, {"file": str(tmp_path / "map.yaml")}))
    kept = ("latch", True), queue(1)
    assert declared == [
        ("/map", "OccupancyGrid", *kept),
        ("~frontiers", "PoseArray", *kept),
        ("~known_share", "Float32", *kept),
        ("/localization/poses", "RobotPoses", queue(10), AT_ONCE),
        ("~save", "Trigger"),
    ]
    declared.clear()
    for _ in range(2):
        node._receive_poses(map_arena.RobotPoses(robots=[map_arena.RobotPose(id=number) for number in (4, 2)]))
    assert declared == [(f"/hero_{number}/proximity", "LaserScan", queue(5), AT_ONCE) for number in (4, 2)]


def test_the_simulated_camera_shows_the_simulators_world(declared):
    options = camera_node.parse_options(["--count", "2", "--width", "320", "--tag-size", "0.2"])
    node = camera_node.CameraNode(options)
    true = [(f"/hero_{number}/ground_truth", "Odometry", queue(10), AT_ONCE) for number in (0, 1)]
    assert declared == [
        *true,
        ("~hand", "Point"),
        ("/tf_static", "TFMessage", ("latch", True), queue(1)),
        ("camera/image_raw", "Image", queue(1)),
        ("camera/image_raw/compressed", "CompressedImage", queue(1)),
        ("camera/camera_info", "CameraInfo", queue(1)),
    ]
    ((message,),) = [call.args for call in node._world.publish.call_args_list]
    (transform,) = message.transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", "world")
    place, turn = transform.transform.translation, transform.transform.rotation
    assert (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w) == (0, 0, 0, 0, 0, 0, 1)


def test_the_simulated_camera_publishes_what_is_listened_to_only(declared):
    node = camera_node.CameraNode(camera_node.parse_options(["--width", "320", "--tag-size", "0.2", "--seed", "3"]))
    outputs = {"image": node._image, "jpeg": node._jpeg, "info": node._info}

    def publish(*heard):
        for name, output in outputs.items():
            output.publish.reset_mock()
            output.get_num_connections = lambda name=name: int(name in heard)
        node._publish(rospy.Time(5), 4.9)
        return {name: output.publish.call_args.args[0] for name, output in outputs.items() if output.publish.called}

    assert publish(*outputs) == {}, "no robot was heard of"
    node._true._receive(camera_node.Odometry(), 0)
    assert publish() == {}
    for heard in outputs:
        (sent,) = publish(heard).items()
        assert sent[0] == heard and sent[1].header.stamp == rospy.Time(5)
        assert sent[1].header.frame_id == "camera_optical"
    sent = publish(*outputs)
    info, image, jpeg = sent["info"], sent["image"], sent["jpeg"]
    assert (info.width, info.height, image.width, image.height, image.step, len(image.data)) == (
        320, 180, 320, 180, 320, 320 * 180,
    )  # fmt: skip
    focal_px = 1390.0 / 6.0
    assert info.K[0] == info.K[4] == pytest.approx(focal_px) and info.K[8] == 1.0
    assert [info.P[index] for index in (0, 5, 2, 6, 3, 10)] == [info.K[index] for index in (0, 4, 2, 5)] + [0.0, 1.0]
    assert list(info.R) == [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0] and info.distortion_model == "plumb_bob"
    assert list(info.D) == [-0.09, 0.02, 0.0006, -0.0004, 0.0] and image.encoding == "mono8"
    shades = frame_source.np.frombuffer(image.data, "uint8").reshape(180, 320)
    decoded = frame_source.cv2.imdecode(frame_source.np.frombuffer(jpeg.data, "uint8"), 0)
    assert decoded.shape == shades.shape and abs(decoded.mean() - shades.mean()) < 2.0 and len(jpeg.data) > 10_000
