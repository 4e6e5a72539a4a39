"""The file of a camera: what calibrations write is what the tracker reads; wrong files are refused with a remedy."""

import errno
import math
import os
import threading
from contextlib import contextmanager

import numpy as np
import pytest
import yaml

from hero_localization.camera.camera_model import Camera, Intrinsics
from hero_localization.errors import SettingsError
from hero_localization.tracking import settings
from hero_localization.tracking.detectors import DEFAULT_BACKEND
from hero_localization.tracking.tag_pose import TagLayout
from hero_node import Pose
from hero_test.checks.bad_yaml import make_bad_yaml

MATRIX = (1390.0, 0.0, 950.0, 0.0, 1391.0, 550.0, 0.0, 0.0, 1.0)
LENS = Intrinsics.from_camera_info(1920, 1080, MATRIX, "plumb_bob", (-0.1, 0.02, 0.0, 0.0))
CAMERA = Camera(LENS, np.diag((1.0, -1.0, -1.0)), np.array((0.1, 0.2, 2.2)))

LENS_TEXT = "lens: {width_px: 10, height_px: 10, matrix: [9, 0, 5, 0, 9, 5, 0, 0, 1], distortion: []}\n"


@pytest.fixture
def path(tmp_path):
    return str(tmp_path / "new" / "camera.yaml")


def write(path, text):
    settings.update(path, {})
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


def read(path):
    with open(path, encoding="utf-8") as file:
        return yaml.safe_load(file)


def test_without_a_file_the_camera_is_uncalibrated(path):
    found = settings.load(path)
    assert found.lens is None and found.camera is None
    assert (found.family, found.detector) == ("36h11", DEFAULT_BACKEND)
    assert found.layout.find_robot(7) == 7
    assert found.layout.size_m == 0.04


def test_what_calibrations_write_is_read_again(path):
    settings.update(path, settings.describe_camera(CAMERA, {100: Pose(0.5, -0.5, math.pi / 2.0)}))
    settings.update(path, {"delay_s": 0.07})
    found = settings.load(path)
    np.testing.assert_allclose(found.lens.matrix, LENS.matrix)
    np.testing.assert_allclose(found.lens.distortion, LENS.distortion)
    np.testing.assert_allclose(found.camera.rotation, CAMERA.rotation)
    np.testing.assert_allclose(found.camera.position_m, CAMERA.position_m)
    assert found.seen_references[100] == pytest.approx((0.5, -0.5, math.pi / 2.0))
    assert found.delay_s == 0.07


def test_what_people_wrote_stays_when_a_calibration_writes(path):
    own = "family: 16h5\nreferences: {20: [0.5, 0.5, 90]}\nobjects: {9: box}\n"
    write(path, own + "tag_robots: {3: 0}\nmounts: {3: [0.01, 0, 90]}\n")
    settings.update(path, settings.describe_lens(LENS))
    found = settings.load(path)
    assert found.family == "16h5" and found.layout.objects == {9: "box"}
    assert found.layout.find_robot(3) == 0 and found.layout.find_robot(9) is None
    assert found.layout.find_mount(3).yaw_rad == pytest.approx(math.pi / 2.0)
    assert found.layout.references[20] == pytest.approx((0.5, 0.5, math.pi / 2.0))


def test_only_what_a_calibration_finds_changes_in_the_text(path):
    before = "# camera over the long table\n\nfamily: 16h5  # old prints\n"
    after = "\n# measured on Monday\nreferences:\n  20: [0.5, 0.5, 90]  # by the door\n"
    write(path, before + "delay_s: 0.06\nmounts:\n  3:\n  - 0.01\n\n  - 0\n  - 90\n" + after.rstrip("\n"))
    settings.update(path, {"delay_s": 0.07, "mounts": {3: [0.02, 0, 90]}, **settings.describe_lens(LENS)})
    lens = yaml.safe_dump(settings.describe_lens(LENS), sort_keys=False, default_flow_style=None)
    with open(path, encoding="utf-8") as file:
        assert file.read() == before + "delay_s: 0.07\nmounts:\n  3: [0.02, 0, 90]\n" + after + lens


@pytest.mark.parametrize(
    "text",
    [
        '{"family": "16h5", "delay_s": 0.06}',
        "family: 16h5\n'delay_s': 0.06\n...\n",
        "family: &name 16h5\ndelay_s: {\n}\n",
        "mounts: {3: &zero [0, 0, 0],\n# all of them\n}\nreferences: {20: *zero}\nfamily: 16h5\n",
    ],
)
def test_yaml_of_any_form_keeps_its_values(path, text):
    write(path, text)
    settings.update(path, {"delay_s": 0.07, "mounts": {}})
    assert {**yaml.safe_load(text), "delay_s": 0.07, "mounts": {}} == read(path)


@pytest.mark.parametrize(
    "text, reason",
    [
        ("family 36h11", "must hold names and values"),
        ("a: [", "line 1: not YAML"),
        ("sizes: 3", "line 1: unknown 'sizes'; allowed are: detector, family"),
        ("detector: zbar", "detector is 'zbar', but must be one of: apriltag, aruco"),
        ("detector: [apriltag]", "detector is a list, but must be one of: apriltag, aruco"),
        ("family: 25h9", "family is '25h9', but must be one of: 16h5, 36h11"),
        ("decimate: .nan", "decimate is nan, but must be a number from 1 to 8"),
        ("tag_size_m: large", "tag_size_m is 'large', but must be a number from 0.005 to 1"),
        ("references: {100: [0.5]}", r"references.100 is a list, but must be \[x_m, y_m, yaw_deg\]"),
        ("references: {100: '123'}", r"references.100 is '123', but must be \[x_m, y_m, yaw_deg\]"),
        ("references: {1.5: [0, 0, 0]}", r"references has '1.5' for a tag, but must have its number"),
        ("mounts: {0: [.nan, 0, 0]}", "mounts.0 is nan, but must be a number"),
        ("mounts: 0", "mounts is 0, but must be a mapping"),
        ("tag_robots: {17: 2.7}", "tag_robots.17 is 2.7, but must be a whole number"),
        ("tag_robots: {17: -2}", "tag_robots.17 is -2, but must be a whole number"),
        ("tag_robots: {17: 2, 18: 2}", "tag_robots names robot 2 more than once"),
        ("references: {100: [%s, 0, 0]}" % (400 * "9"), "references.100 is 9+.* must be a number"),
        ("references: {100: [1e300, 0, 0]}", "references.100 is '1e300', but must be a number"),
        ("decimate: " + 400 * "9", "decimate is 9+.* must be a number from 1 to 8"),
        ("delay_s: -" + 400 * "9", "delay_s is -9+.* must be a number"),
        (LENS_TEXT.replace("[9, 0", "[%s, 0" % (400 * "9")), "lens: .*: calibrate the lens"),
        (LENS_TEXT.replace("10", 400 * "9", 1), "lens.width_px is 9+.* must be a whole number"),
        (LENS_TEXT.replace("10", "-1920", 1), "lens: images must have 1 to 20000 pixels .* not -1920 x 10"),
        (
            LENS_TEXT + "camera: {rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], position_m: [%s, 0, 0]}" % (400 * "9"),
            "camera.position_m is 9+.* must be a number",
        ),
        ("references: {5: [0, 0, 0]}\nobjects: {5: box}", "tag 5 is named in references and in objects, but has one"),
        ("tag_robots: {5: 3}\nobjects: {5: box}", "tag 5 is named in objects and in tag_robots"),
        ("tag_robots: {7: 3, 5: 4}\nreferences: {5: [0, 0, 0]}", "tag 5 is named in references and in tag_robots"),
        ("objects: [box]", "objects is a list, but must be a mapping"),
        ("objects: {9: }", "objects.9 is None, but must be"),
        ("lens: 5", "lens is 5, but must be a mapping"),
        ("lens: {width_px: 10}", "height_px is missing in lens"),
        (LENS_TEXT + "camera:", "camera is None, but must be a mapping"),
        (
            LENS_TEXT + "camera: {rotation: [1], position_m: [0, 0, 2]}",
            "must be rotation .nine numbers.*: calibrate the arena",
        ),
        (
            LENS_TEXT + "camera: {rotation: [1, 0, 0, 0, 1, 0, 0, 0, -1], position_m: [0, 0, 2]}",
            "camera.rotation .* a turn, without mirroring",
        ),
        ("camera: {rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], position_m: [0, 0, 2]}", "calibrate the lens, then"),
        ("lens: {width_px: 10, height_px: 10, matrix: [0], distortion: []}", "not calibrated"),
        ("exposure_s: 8", "exposure_s is 8, but must be a number from 0.0001 to 1"),
        ("focus: auto", "focus is 'auto', but must be a whole number from 0 to"),
    ],
)
def test_a_wrong_file_is_refused_with_file_and_remedy(path, text, reason):
    write(path, text)
    with pytest.raises(SettingsError, match=reason) as error:
        settings.load(path)
    assert path in str(error.value)


def test_controls_of_a_camera_are_read(path):
    write(path, "exposure_s: 0.008\nfocus: 0\n")
    assert settings.load(path).controls == (0.008, None, 0)


def test_a_file_that_cannot_be_written_is_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SettingsError, match="cannot be"):
        settings.update(str(tmp_path / "file" / "camera.yaml"), {})


def test_what_another_program_writes_before_the_lock_is_taken_stays(path, monkeypatch):
    lock_file = settings.lock_file

    @contextmanager
    def lock_after_another(locked):
        monkeypatch.setattr(settings, "lock_file", lock_file)
        settings.update(path, {"decimate": 4.0})
        with lock_file(locked):
            yield

    monkeypatch.setattr(settings, "lock_file", lock_after_another)
    settings.update(path, {"delay_s": 0.07})
    assert read(path) == {"decimate": 4.0, "delay_s": 0.07}


def test_a_file_that_holds_no_names_and_values_is_not_written_over(path):
    write(path, "- 36h11\n")
    with pytest.raises(SettingsError, match="must hold names and values, such as family: 36h11"):
        settings.update(path, {"delay_s": 0.07})
    assert read(path) == ["36h11"]


@pytest.mark.slow
def test_no_part_is_lost_when_several_calibrations_write_a_file(path):
    def calibrate(first):
        for number in range(first, first + 12):
            settings.update(path, {"part_%d" % number: number})

    settings.update(path, {})
    threads = [threading.Thread(target=calibrate, args=(first,)) for first in (0, 100, 200)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(read(path)) == 36


def test_a_full_disk_leaves_the_settings_as_they_were(path, monkeypatch):
    settings.update(path, {"decimate": 1.0})

    def fail(fd):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(SettingsError, match=r"camera\.yaml cannot be read or written: No space left on device"):
        settings.update(path, {"decimate": 2.0})
    assert read(path) == {"decimate": 1.0} and os.listdir(os.path.dirname(path)) == ["camera.yaml"]


@pytest.mark.slow
@pytest.mark.parametrize("key", ["tag_robots", "camera", "family"])
def test_no_file_breaks_the_reader_or_the_writer(tmp_path, key):
    path = tmp_path / "camera.yaml"
    for content in make_bad_yaml(key):
        path.write_bytes(content)
        for use in (settings.load, lambda path: settings.update(path, {"mounts": {8: [0.003, 0.0, 5.0]}})):
            try:
                use(str(path))
            except SettingsError as error:
                assert str(error).isprintable() and len(str(error)) < 600


def test_poses_are_written_to_hundredths_of_a_millimeter():
    assert settings.describe_pose(Pose(0.1234567, -0.9876543, 1.0)) == [0.12346, -0.98765, 57.296]


@pytest.mark.parametrize(
    ("key", "low", "high"),
    [
        ("tag_size_m", 0.005, 1.0), ("tag_height_m", 0.0, 1.0), ("reference_size_m", 0.005, 1.0),
        ("decimate", 1.0, 8.0), ("delay_s", -1.0, 5.0), ("exposure_s", 0.0001, 1.0),
    ],
)  # fmt: skip
def test_numbers_are_taken_up_to_their_limits(path, key, low, high):
    for value in (low, high):
        write(path, "%s: %r\n" % (key, value))
        settings.load(path)
    for value in (low - 1e-5, high + 1e-5):
        write(path, "%s: %r\n" % (key, value))
        with pytest.raises(SettingsError, match="%s is .* must be a number from %g to %g" % (key, low, high)):
            settings.load(path)


def test_what_a_file_leaves_out_has_its_default(path):
    write(path, "references: {100: [1, 2, 90]}\nmounts: {3: [0.01, 0.02, -90]}\n")
    found = settings.load(path)
    assert (found.decimate, found.delay_s, found.controls) == (2.0, 0.0, (None, None, None))
    assert settings.Settings()[2:] == (2.0, TagLayout(), None, None, 0.0, {}, (None, None, None), 0.0)
    assert found.layout[-3:] == (0.04, 0.076, 0.1)
    assert found.layout.references[100] == Pose(1.0, 2.0, math.pi / 2.0)
    assert found.layout.mounts[3] == pytest.approx((0.01, 0.02, -math.pi / 2.0))


def test_a_place_of_the_camera_must_turn_without_mirroring_or_scaling(path):
    for rotation, is_right in (
        (np.diag((1.0, -1.0, -1.0)), True), (np.diag((1.0, -1.0, 1.0)), False), (1.01 * np.eye(3), False),
    ):  # fmt: skip
        text = LENS_TEXT + "camera: {rotation: %s, position_m: [0, 0, 2]}\n" % rotation.ravel().tolist()
        write(path, text)
        if is_right:
            assert settings.load(path).camera.position_m.tolist() == [0.0, 0.0, 2.0]
        else:
            with pytest.raises(SettingsError, match="calibrate the arena"):
                settings.load(path)


def test_a_file_that_is_no_text_is_refused_by_its_name(path):
    settings.update(path, {})
    with open(path, "wb") as file:
        file.write(b"family: \xff\xfe\x00")
    with pytest.raises(SettingsError, match="camera.yaml: not YAML"):
        settings.load(path)


def test_what_cannot_be_read_is_named(path, tmp_path):
    with pytest.raises(SettingsError, match="cannot be read: Is a directory"):
        settings.load(str(tmp_path))
    settings.update(path, {})
    assert settings.find_change_s(path) == os.stat(path).st_mtime and settings.find_change_s(path + ".none") == 0.0
