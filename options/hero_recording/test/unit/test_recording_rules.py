"""Limits of the analysis, the columns of all tables, and a recording that the disk, the user or nobody ends."""

import math
import signal
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rospy
import synthetic_bag
from geometry_msgs.msg import Quaternion, Twist
from sensor_msgs.msg import Imu, LaserScan, Range
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from hero_msgs.msg import Encoder, Motor, Robot, RobotArray
from hero_recording import disk_guard, plot, record, step_recorder
from hero_recording.bags import plain_reader
from hero_recording.bags.tables import TABLES, read_rows, to_seconds
from hero_recording.bags.topics import Message
from hero_recording.errors import RecordingError
from hero_recording.plots import analysis
from hero_recording.plots.observations import Observations, Origin, RobotObservations
from hero_recording.record import Recording
from hero_recording.step_recorder import StepRecorder
from hero_sim.stepped import LATCHED, StepSwarm

CHECK_PERIOD_S, CLOSING_S, COMMAND_TIMEOUT_S, EMPTY_BAG_BYTES = 0.5, 10.0, 2.0, 10000
MAX_VALUE, ODOMETRY_GAP_S, SAME_TIME_S, SILENCE_S = 1000000.0, 0.5, 0.2, 15.0

PERIOD_S = 0.034


def make_robot(*rows, true_rows=()):
    """Rows: stamp s, x m, y m, yaw rad; each arrives 0.02 s later."""
    robot = RobotObservations()
    for series, values in ((robot.odometry, rows), (robot.ground_truth, true_rows)):
        for stamp_s, *pose in values:
            series.add(stamp_s + 0.02, stamp_s, *pose, 0.0, 0.0)
    return robot


def test_a_pose_is_compared_only_with_ground_truth_of_its_time():
    true_rows = [(10.0, 0.0, 0.0, 0.0), (11.0, 1.0, 0.0, 0.0), (20.0, 1.0, 0.0, 0.0)]
    stamps_s = (10.0 - SAME_TIME_S - 0.01, 10.0 - SAME_TIME_S + 0.01, 10.19, 10.5, 10.81, 20.19, 20.21)
    robot = make_robot(*((stamp_s, 0.0, 0.0, 0.0) for stamp_s in stamps_s), true_rows=true_rows)
    robot.origins.append(Origin(0.0, 0.0, 0.0, 0.0))
    errors = analysis.compute_odometry_errors(robot)
    assert errors.times_s - 0.02 == pytest.approx([stamps_s[1], 10.19, 10.81, 20.19])
    assert errors.position_m == pytest.approx([0.0, 0.19, 0.81, 1.0]), "in between by its stamp"
    assert analysis.compute_odometry_errors(make_robot((10.5, 0.0, 0.0, 0.0), true_rows=true_rows)) is None
    assert analysis.compute_odometry_errors(make_robot((10.0, 0.0, 0.0, 0.0), true_rows=true_rows[:1])) is None
    assert analysis.compute_odometry_errors(make_robot(true_rows=true_rows)) is None


def test_odometry_without_an_origin_is_laid_on_the_first_true_pose():
    true_rows = [(0.1 * step, 2.0, 1.0 + 0.1 * step, math.pi / 2.0) for step in range(5)]
    robot = make_robot(*((0.1 * step, 5.0 + 0.2 * step, 7.0, 0.0) for step in range(5)), true_rows=true_rows)
    errors = analysis.compute_odometry_errors(robot)
    assert errors.position_m == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert errors.yaw_rad == pytest.approx(np.zeros(5), abs=1e-12)


def test_gaps_begin_beyond_their_limits():
    times_s = np.array([0.0, ODOMETRY_GAP_S, 2.0 * ODOMETRY_GAP_S + 0.1, 1.2])
    broken_s, values = analysis.break_at_gaps(times_s, np.arange(4.0))
    assert broken_s.tolist() == [0.0, 0.5, 1.1, 1.1, 1.2] and np.isnan(values[2]) and values[3] == 2.0
    ended = analysis.end_commands(np.array([0.0, COMMAND_TIMEOUT_S, 5.0]), np.ones(3), np.ones(3))
    assert ended[0].tolist() == [0.0, 2.0, 4.0, 5.0, 7.0] and ended[1].tolist() == ended[2].tolist() == [1, 1, 0, 1, 0]


def test_numbers_beyond_what_robots_measure_are_not_drawn():
    robot = make_robot((1.0, MAX_VALUE, 0.0, 0.0), (2.0, 0.0, -1.01 * MAX_VALUE, 0.0), (3e9, 0.0, 0.0, math.nan))
    assert len(robot.odometry) == 1 and robot.skipped == 2


def test_the_table_gives_errors_as_a_share_only_of_a_drive():
    def describe(length_m):
        true_rows = [(0.1 * step, 0.0, 0.0, 0.0) for step in range(11)]
        robot = make_robot(*((0.1 * step, 0.1 * length_m * step, 0.0, 0.0) for step in range(11)), true_rows=true_rows)
        robot.origins.append(Origin(0.0, 0.0, 0.0, 0.0))
        robot.reconnects = 3
        return plot.describe_robot(robot)

    cells = describe(0.2)
    assert (cells["DISTANCE"], cells["FINAL ERROR"]) == ("0.20 m", "200 mm (100.0 % of the distance)")
    assert (cells["ODOM"], cells["LONGEST GAP"], cells["MESSAGE DELAY"], cells["99 %"]) == (
        "10.0 Hz",
        "0.10 s",
        "20 ms",
        "20 ms",
    )
    assert (cells["RECONNECTS"], cells["LOCALIZATION RMS"]) == ("3", "-")
    assert describe(0.049)["FINAL ERROR"] == "49 mm"
    assert describe(0.051)["FINAL ERROR"] == "51 mm (100.0 % of the distance)"
    assert set(plot.describe_robot(RobotObservations()).values()) == {"0.00 m", "-"}


def test_origins_count_once_and_walls_lie_as_their_markers():
    seen = Observations({1})
    transforms = synthetic_bag.make_origins((1, 2))
    for time_s, x_m in ((1.0, 1.0), (2.0, 1.0), (3.0, 4.0), (4.0, math.nan)):
        transforms.transforms[1].transform.translation.x = x_m
        seen.receive(Message("/tf_static", "tf2_msgs/TFMessage", transforms, time_s))
    assert seen.robots[1].origins == [(1.0, 1.0, 0.0, 0.0), (3.0, 4.0, 0.0, 0.0)] and list(seen.robots) == [1]
    wall, post = Marker(type=Marker.CUBE), Marker(type=Marker.CYLINDER)
    wall.pose.position.x, wall.pose.position.y = 1.0, 2.0
    wall.pose.orientation = synthetic_bag.make_quaternion(math.pi / 2.0)
    wall.scale.x = post.scale.x = 0.5
    for _ in range(2):
        seen.receive(Message("/hero_sim/arena", "visualization_msgs/MarkerArray", MarkerArray([wall, post]), 1.0))
    assert seen.walls_m == [pytest.approx((1.0, 1.75, 1.0, 2.25))] and seen.circles_m == [(0.0, 0.0, 0.25)]
    for topic, kind, is_wanted in (
        ("/hero_1/odom", "nav_msgs/Odometry", True),
        ("/hero_2/odom", "nav_msgs/Odometry", False),
        ("/hero_1/led", "std_msgs/ColorRGBA", False),
        ("/tf_static", "tf/tfMessage", True),
        ("/tf_static", "std_msgs/String", False),
        ("/hero_driver/robots", "hero_msgs/RobotArray", True),
    ):
        assert seen.wants(topic, kind) == is_wanted


def test_every_column_holds_the_number_of_its_name():
    def read(topic, kind, content):
        ((robot_id, table, row),) = read_rows("/hero_7/" + topic, kind, content, 9.0)
        assert robot_id == 7 and row[0] == 9.0
        return dict(zip(TABLES[table], row[1:]))

    encoder = Encoder(
        left_ticks=1, right_ticks=2, left_speed=3, right_speed=4, left_speed_filtered=5, right_speed_filtered=6
    )
    assert list(read("encoder", "hero_msgs/Encoder", encoder).values()) == [0.0, 1, 2, 3, 4, 5, 6]
    scan = read("proximity", "sensor_msgs/LaserScan", LaserScan(ranges=[0, 1, 2, 3, 4, 5, 6]))
    beams = ("rear", "rear_right", "right", "front_right", "front", "front_left", "left")
    assert [scan[beam + "_m"] for beam in beams] == list(range(7)) and math.isnan(scan["rear_left_m"])
    assert read("range", "sensor_msgs/Range", Range(range=0.3))["range_m"] == 0.3
    twist = Twist()
    twist.linear.x, twist.linear.y, twist.angular.x, twist.angular.z = 1.0, 2.0, 3.0, 4.0
    for topic in ("cmd_vel", "velocity_controller/cmd_vel", "position_controller/cmd_vel"):
        assert read(topic, "geometry_msgs/Twist", twist) == {"linear_m_s": 1.0, "angular_rad_s": 4.0}
    motor = read("cmd_motor", "hero_msgs/Motor", Motor(left_motor_pwm=1400, right_motor_pwm=1600))
    assert motor == {"left_us": 1400, "right_us": 1600}
    assert list(read("led", "std_msgs/ColorRGBA", ColorRGBA(0.1, 0.2, 0.3, 0.4)).values()) == [0.1, 0.2, 0.3, 0.4]
    imu = Imu(orientation=Quaternion(1, 2, 3, 4))
    for number, axis in enumerate("xyz"):
        setattr(imu.angular_velocity, axis, 5 + number)
        setattr(imu.linear_acceleration, axis, 8 + number)
    assert list(read("imu", "sensor_msgs/Imu", imu).values()) == [0.0, *range(1, 11)]
    robot = Robot(
        id=7, state=Robot.AWAY, address="a:1", packets_per_s=1.0, bytes_per_s=2.0, clock_offset=3.0, reconnects=4
    )
    robot.dropped_messages, robot.bad_packets, robot.last_error = 5, 6, "e"
    rows = read_rows("/hero_driver/robots", "hero_msgs/RobotArray", RobotArray(robots=[robot, Robot(id=-1)]), 9.0)
    assert rows == [(7, "status", (9.0, "away", "a:1", 1.0, 2.0, 3.0, 4, 5, 6, "e"))]
    pose = synthetic_bag.make_localized(5.0, 1.0, 2.0, 0.5)
    pose.pose.covariance = [-float(index) for index in range(36)]  # by rounding they may be below zero
    row = read("pose", "geometry_msgs/PoseWithCovarianceStamped", pose)
    assert list(row.values()) == pytest.approx([5.0, 1.0, 2.0, 0.5, 0.0, math.sqrt(7.0), math.sqrt(35.0)])
    odometry = read("odom", "nav_msgs/Odometry", synthetic_bag.make_pose("odom", 5.0, 1.0, 2.0, 0.5, 0.4))
    assert list(odometry.values()) == pytest.approx([5.0, 1.0, 2.0, 0.5, 0.4, 2.0])


def test_stamps_of_both_generations_of_ros_are_seconds():
    assert to_seconds(SimpleNamespace(sec=5, nanosec=250_000_000)) == 5.25
    assert to_seconds(rospy.Time(5, 250_000_000)) == 5.25


def test_a_disk_is_full_below_its_limit(monkeypatch, tmp_path):
    free = {"bytes": 5_000_000}
    monkeypatch.setattr(disk_guard.shutil, "disk_usage", lambda folder: SimpleNamespace(free=free["bytes"]))
    folder = str(tmp_path / "new" / "folder")
    assert disk_guard.prepare_folder(folder, 5.0) == 5.0 and disk_guard.find_reason_to_stop(folder, 5.0) is None
    free["bytes"] -= 1
    assert "only 5 MB are left in" in disk_guard.find_reason_to_stop(folder, 5.0)
    with pytest.raises(RecordingError, match="only 5 MB are free in .* so nothing is recorded"):
        disk_guard.prepare_folder(folder, 5.0)
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file/folder"):
        disk_guard.prepare_folder(str(tmp_path / "file" / "folder"), 0.0)
    monkeypatch.setattr(disk_guard.os, "access", lambda path, mode: False)
    with pytest.raises(RecordingError, match="is not writable"):
        disk_guard.prepare_folder(folder, 0.0)


@pytest.fixture(name="recording")
def make_recording(monkeypatch, tmp_path):
    """A Recording in virtual time, whose recorder writes what a test writes."""
    made = SimpleNamespace(now_s=100.0, said=[], errors=[], reasons={}, ends_s=math.inf, code=0)

    def sleep(duration_s):
        made.now_s += duration_s
        for at_s in sorted(made.reasons):
            if made.now_s >= 100.0 + at_s and made.reasons[at_s]:
                made.reasons.pop(at_s)()

    monkeypatch.setattr(record, "time", SimpleNamespace(monotonic=lambda: made.now_s, sleep=sleep))
    monkeypatch.setattr(record, "say", made.said.append)
    monkeypatch.setattr(record.command_line, "print_error", made.errors.append)
    monkeypatch.setattr(record.signal, "signal", lambda *arguments: None)
    monkeypatch.setattr(record.roslib.packages, "find_node", lambda package, name: ["/opt/record"])
    made.reason = None
    monkeypatch.setattr(record, "find_reason_to_stop", lambda folder, limit_mb: made.reason)
    poll = SimpleNamespace(poll=lambda: None if made.now_s < 100.0 + made.ends_s else 1)
    made.is_writing = False

    def repair(path):
        assert not made.is_writing, "its recorder still writes to it"
        return "repaired " + path

    def end(process, patience_s):
        assert process is poll and patience_s == CLOSING_S
        made.is_writing = False
        return made.code

    monkeypatch.setattr(record, "repair_bag", repair)
    monkeypatch.setattr(record, "end_process", end)

    def start(command, **options):
        made.is_writing = True
        made.commands.append(command)
        made.logging = Path(options["env"]["ROSCONSOLE_CONFIG_FILE"]).read_text()
        return poll

    monkeypatch.setattr(record.subprocess, "Popen", start)
    made.commands = []
    made.folder = tmp_path

    def run(*arguments):
        made.recording = Recording(
            record.parse_options(["--folder", str(tmp_path), "--min-free-mb", "0", *arguments]), []
        )
        return record.command_line.call(made.recording.run)

    made.run = run
    return made


def test_a_recording_ends_by_its_time_a_signal_or_the_disk(recording):
    bag = recording.folder / "hero_2026_0.bag"

    def write():
        bag.write_bytes(bytes(EMPTY_BAG_BYTES + 1))

    recording.reasons[1.0] = write
    assert recording.run("--seconds", "20") == 0
    assert recording.now_s == 120.0 and recording.errors == []
    assert recording.said[-2:] == ["%s  0.0 MB" % bag, "0.0 MB in 20 s"] and "nothing" not in "".join(recording.said)
    recording.now_s, recording.reasons = 100.0, {3.0: lambda: recording.recording._receive_signal(signal.SIGINT, None)}
    assert recording.run() == 0 and recording.now_s == pytest.approx(103.0, abs=CHECK_PERIOD_S)
    assert "nothing was recorded: no robot and no driver published anything" in recording.said, (
        "the old file is not its own"
    )
    recording.now_s, recording.reasons = 100.0, {3.0: lambda: setattr(recording, "reason", "only 5 MB are left")}
    assert recording.run() == 1 and recording.errors == ["stopped: only 5 MB are left"]


def test_files_that_vanish_while_they_are_listed_hide_no_others(recording):
    kept = [recording.folder / ("hero_2026_%d.bag" % number) for number in range(20)]

    def write():
        for path in kept:
            path.write_bytes(bytes(EMPTY_BAG_BYTES + 1))
            (recording.folder / (path.name + ".gone")).symlink_to(recording.folder / "nothing")

    recording.reasons[1.0] = write
    assert recording.run("--seconds", "2") == 0
    assert sorted(recording.said[-21:-1]) == sorted("%s  0.0 MB" % path for path in kept)
    assert recording.said[-1] == "0.2 MB in 2 s"


def test_a_file_that_cannot_be_repaired_keeps_no_other_from_it(recording, monkeypatch):
    paths = [recording.folder / ("hero_2026_%d.bag.active" % number) for number in range(2)]

    def repair(path):
        monkeypatch.setattr(record, "repair_bag", lambda path: "repaired " + path)
        raise RecordingError("nothing can be read")

    def write():
        for path in paths:
            path.write_bytes(bytes(EMPTY_BAG_BYTES + 1))

    monkeypatch.setattr(record, "repair_bag", repair)
    recording.reasons[0.5], recording.ends_s = write, 1.0
    assert recording.run() == 1
    assert recording.errors[0] == "nothing can be read" and "repaired %s" % paths[1] in recording.said


def test_whatever_breaks_the_watch_ends_the_recorder(recording, monkeypatch):
    active = recording.folder / "hero_2026_1.bag.active"
    recording.reasons = {0.5: lambda: active.write_bytes(bytes(2 * EMPTY_BAG_BYTES)), 1.0: lambda: 1 / 0}
    with pytest.raises(ZeroDivisionError):
        recording.run()
    assert not recording.is_writing and recording.said[-1] == "repaired %s" % active


def test_silence_and_a_recorder_that_fails_are_told(recording):
    recording.ends_s, recording.code = SILENCE_S + 5.0, 3
    assert recording.run() == 1
    assert [
        text for text in recording.said if "nothing received in 15 s" in text
    ] and "exit code 3" in recording.errors[0]
    recording.now_s, recording.ends_s, recording.code = 100.0, 1.0, -signal.SIGTERM
    active = recording.folder / "hero_2026_1.bag.active"
    recording.reasons[0.5] = lambda: active.write_bytes(bytes(2 * EMPTY_BAG_BYTES))
    recording.said.clear()
    assert recording.run() == 1 and "repaired %s" % active in recording.said
    recording.now_s, recording.reasons = 100.0, {}
    recording.said.clear()
    assert recording.run() == 0
    assert any("was cut off, or is being recorded" in text for text in recording.said)


def test_the_recorder_is_told_folder_split_compression_and_topics(recording):
    recording.ends_s = 0.1
    recording.run(
        "--max-files", "3", "--split-mb", "7", "--topics", "/a /b", "--compression", "none", "--robots", "1 2"
    )
    (command,) = recording.commands
    assert recording.logging == "log4j.logger.ros=WARN\n", "it would name every topic"
    assert command[:3] == ["setpriv", "--pdeathsig", "INT"], "it ends with its program"
    assert command[3:6] == ["/opt/record", "--quiet", "--regex"] and "--repeat-latched" in command
    pairs = list(zip(command, command[1:]))
    for pair in (("--size", "7"), ("--max-splits", "3"), ("--min-space", "1k"), ("-o", str(recording.folder / "hero"))):
        assert pair in pairs
    assert "--lz4" not in command and command[-2:] == ["/a", "/b"] and any("/hero_(1|2)/" in word for word in command)
    recording.run("--min-free-mb", "1.024")
    assert ("--min-space", "100k") in list(zip(recording.commands[1], recording.commands[1][1:]))
    assert "--lz4" in recording.commands[1] and "--max-splits" not in recording.commands[1]
    assert record.parse_options(["--repair", "a.bag.active", "b.bag.active"]).repair == ["a.bag.active", "b.bag.active"]
    assert record.format_size(999_900_000) == "999.9 MB" and record.format_size(1e9) == "1.0 GB"


@pytest.mark.parametrize(("missing", "package"), [("find_node", "python3-rosbag"), ("which", "util-linux")])
def test_a_program_that_recordings_need_is_named_with_its_package(recording, monkeypatch, missing, package):
    owner = {"find_node": record.roslib.packages, "which": record.shutil}[missing]
    monkeypatch.setattr(owner, missing, lambda *_: None)
    with pytest.raises(record.RecordingError, match=f"is missing: apt install {package}"):
        recording.run()
    assert not recording.commands


def test_a_reader_without_ros_names_types_and_times_as_ros_does(monkeypatch):
    def connect(topic, kind, count):
        return SimpleNamespace(topic=topic, msgtype=kind, msgcount=count)

    light = "std_msgs/msg/ColorRGBA"
    bag = SimpleNamespace(
        connections=[
            connect("/hero_0/led", light, 2),
            connect("/hero_0/led", light, 3),
            connect("/tf", "tf2_msgs/msg/TFMessage", 1),
        ],
        start_time=1_500_000_000,
        end_time=9_000_000_001,  # behind the last message
        messages=lambda chosen: ((each, 2_500_000_000, bytearray(b"abc")) for each in chosen),
        deserialize=lambda content, kind: (kind, bytes(content)),
        open=lambda: None,
        close=lambda: None,
    )
    library = SimpleNamespace(AnyReader=lambda paths: bag)
    monkeypatch.setattr(plain_reader, "import_optional", lambda module, requirement: library)
    with plain_reader.Reader("a.bag") as reader:
        assert reader.list_topics() == {"/hero_0/led": ("std_msgs/ColorRGBA", 5), "/tf": ("tf2_msgs/TFMessage", 1)}
        assert reader.find_span() == (1.5, 9.0)
        content = (light, b"abc")
        assert list(reader.read(["/hero_0/led"])) == [("/hero_0/led", "std_msgs/ColorRGBA", content, 2.5)] * 2


class WriterError(Exception):
    pass


class Types:
    """What rosbags knows of types."""

    Stores = SimpleNamespace(ROS1_NOETIC="ROS 1")

    def __init__(self, names):
        self.names = names

    def register(self, definitions):
        self.names += definitions

    @staticmethod
    def get_typestore(store):
        assert store == "ROS 1"
        return Types([])

    @staticmethod
    def get_types_from_msg(text, name):
        assert text == "geometry_msgs/TransformStamped[] transforms"
        return {name: text}


class FakeWriter:
    """What rosbags has, without a file."""

    def __init__(self, path):
        if path == "taken.bag":
            raise WriterError("exists already")
        self.connections, self.written, self.calls = {}, [], []
        FakeWriter.made = self

    def open(self):
        self.calls.append("open")

    def close(self):
        self.calls.append("close")

    def add_connection(self, topic, kind, **options):
        assert topic not in self.connections
        self.connections[topic] = (kind, options)
        return topic

    def write(self, connection, time_ns, content):
        self.written.append((connection, time_ns, content))


def test_stepped_robots_are_recorded_from_beginning_to_end(monkeypatch):
    modules = {"rosbags.rosbag1": SimpleNamespace(Writer=FakeWriter, WriterError=WriterError), "rosbags.typesys": Types}
    monkeypatch.setattr(step_recorder, "import_optional", lambda module, requirement: modules[module])
    with StepSwarm(2, arena="maze") as swarm:
        with StepRecorder(swarm.rows, range(2), "run.bag") as recorder:
            writer = FakeWriter.made
            swarm.sleep(0.5)
            count = len(writer.written)
            assert count > 20 and writer.calls == ["open"]
            recorder.close()
            swarm.sleep(0.5)
        assert len(writer.written) == count and writer.calls == ["open", "close"]
        with pytest.raises(RecordingError, match="taken.bag: exists already; move it away or choose another name"):
            StepRecorder(swarm.rows, range(2), "taken.bag")
    assert {topic for topic, _, _ in writer.written} == set(writer.connections) >= {"/hero_1/odom", "/hero_sim/arena"}
    kind, options = writer.connections["/hero_1/odom"]
    assert kind == "nav_msgs/msg/Odometry" and options["typestore"].names == ["tf2_msgs/msg/TFMessage"]
    latched = {topic for topic, (_, options) in writer.connections.items() if options["latching"]}
    assert latched == set(writer.connections) & set(LATCHED) != set()
