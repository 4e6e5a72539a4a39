"""Lens files of camera_calibration: read, or refused with one line."""

import pytest

from hero_localization.calibration.lens_calibration import load_lens
from hero_localization.errors import CalibrationError
from hero_test.checks.bad_yaml import make_bad_yaml

STOCK_LENS = """image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [438.7, 0., 305.6, 0., 437.3, 243.7, 0., 0., 1.]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.36, 0.114, -0.0014, 0.0006, 0.]
"""


def test_lens_of_camera_calibration_is_read(tmp_path):
    (tmp_path / "ost.yaml").write_text(STOCK_LENS)
    found = load_lens(str(tmp_path / "ost.yaml"))
    assert (found.width_px, found.height_px, found.matrix[1, 1], found.distortion[1]) == (
        640,
        480,
        437.3,
        0.114,
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "must hold names and values.*is it a file of camera_calibration"),
        ("{", "line 1: not YAML"),
        ("a: 1", "image_width is missing"),
        (STOCK_LENS.replace("438.7", "0.0"), "not calibrated"),
        (STOCK_LENS.replace("640", "-1920"), "1 to 20000 pixels in width and height, not -1920 x 480"),
        (STOCK_LENS.replace("480", 400 * "9"), "image_height is 9+.* must be a whole number"),
        (STOCK_LENS.replace("plumb_bob", "equidistant"), "equidistant"),
        (STOCK_LENS.replace("438.7", "[1, 2]"), "lens.yaml"),
    ],
)
def test_file_that_is_no_lens_is_refused_with_one_line(tmp_path, text, words):
    (tmp_path / "lens.yaml").write_text(text)
    with pytest.raises(CalibrationError, match=words) as refused:
        load_lens(str(tmp_path / "lens.yaml"))
    assert "\n" not in str(refused.value)


def test_missing_file_is_named(tmp_path):
    with pytest.raises(CalibrationError, match=r"lens.yaml: cannot be read: No such file"):
        load_lens(str(tmp_path / "lens.yaml"))


@pytest.mark.slow
def test_no_file_breaks_the_reader(tmp_path):
    for content in (*make_bad_yaml("image_width"), *(STOCK_LENS.encode() + bad for bad in make_bad_yaml("rows"))):
        (tmp_path / "lens.yaml").write_bytes(content)
        try:
            load_lens(str(tmp_path / "lens.yaml"))
        except CalibrationError as error:
            assert str(error).isprintable() and len(str(error)) < 400
