"""The file of one camera: intrinsics, extrinsics, tags. Calibrations write their parts of it, the tracker reads it all.

Pure but for the file. Lengths in m, angles in degrees, pixels as in camera_model.
"""

import itertools
import math
import os
from typing import Any, Callable, Dict, Iterable, List, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from hero_client.values import is_plausible
from hero_node import Pose, shorten
from hero_node.files import YamlError, lock_file, parse_yaml, read_text, replace_values, write_file
from hero_node.parameters import is_number, is_whole_number

from ..camera.camera_model import Camera, Intrinsics
from ..camera.device_controls import POWER_LINES_HZ, DeviceControls
from ..errors import SettingsError
from ..prints.tag_images import DEFAULT_SIZE_M, FAMILIES, REFERENCE_SIZE_M
from .detectors import BACKENDS, DEFAULT_BACKEND
from .tag_pose import DEFAULT_HEIGHT_M, TagLayout

DEFAULT_PATH = "~/hero_localization/camera.yaml"
POSE_FORM = "[x_m, y_m, yaw_deg]"


class Settings(NamedTuple):
    """Contents of a camera file; None: not calibrated yet."""

    detector: str = DEFAULT_BACKEND
    family: str = "36h11"
    decimate: float = 2.0
    layout: TagLayout = TagLayout()
    lens: Optional[Intrinsics] = None
    camera: Optional[Camera] = None
    delay_s: float = 0.0
    """Images were taken this long before their stamps."""
    seen_references: Mapping[int, Pose] = {}
    """Poses of the reference tags in the calibration of the arena."""
    controls: DeviceControls = DeviceControls()


def load(path: str) -> Settings:
    """Return the settings of a file; of one that does not exist, those of an uncalibrated camera.

    Raises: SettingsError with the file, the key and what it must be.
    """
    _, content = _read(path)
    try:
        return _build(content)
    except ValueError as error:
        raise SettingsError(f"{path}: {error}") from None


def find_change_s(path: str) -> float:
    """Return when a file was changed last, by the clock of its disk; 0 if it does not exist."""
    try:
        return os.stat(os.path.expanduser(path)).st_mtime
    except OSError:
        return 0.0


def update(path: str, parts: Mapping[str, Any]) -> None:
    """Write these parts into a file, or begin it; its comments and all other text stay. Raises: SettingsError."""
    path = os.path.expanduser(path)
    try:
        os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
        with lock_file(path):
            text, content = _read(path)
            write_file(path, replace_values(text, {**content, **parts}).encode())
    except OSError as error:
        raise SettingsError(f"{path} cannot be written: {error.strerror}") from None


def describe_lens(lens: Intrinsics) -> Dict[str, Any]:
    """Return the part of the file that holds the intrinsics."""
    return {
        "lens": {
            "width_px": lens.width_px,
            "height_px": lens.height_px,
            "matrix": np.asarray(lens.matrix).ravel().tolist(),
            "distortion": np.asarray(lens.distortion).tolist(),
        }
    }


def describe_camera(camera: Camera, seen: Mapping[int, Pose]) -> Dict[str, Any]:
    """Return the parts of the file that hold a camera's intrinsics, its pose, and the reference tags that it saw."""
    return {
        **describe_lens(camera.lens),
        "camera": {"rotation": camera.rotation.ravel().tolist(), "position_m": camera.position_m.tolist()},
        "seen_references": {tag_id: describe_pose(pose) for tag_id, pose in sorted(seen.items())},
    }


def describe_pose(pose: Pose) -> List[float]:
    """Return x, y (m) and yaw (degrees) as the file holds them."""
    return [round(float(pose.x_m), 5), round(float(pose.y_m), 5), round(math.degrees(pose.yaw_rad), 3)]


def _read(path: str) -> Tuple[str, Dict[str, Any]]:
    """Return the text of a file and what it says, nothing if it does not exist. Raises: SettingsError."""
    try:
        text = read_text(os.path.expanduser(path))
        content = parse_yaml(text)
    except FileNotFoundError:
        return "", {}
    except OSError as error:
        raise SettingsError(f"{path} cannot be read: {error.strerror}") from None
    except YamlError as error:
        raise SettingsError(f"{path} is no YAML file: {error}") from None
    if not isinstance(content, (dict, type(None))):
        raise SettingsError(f"{path} must hold keys and values, such as family: 36h11")
    return text, content or {}


def _build(content: Mapping[str, Any]) -> Settings:
    known = (
        "detector family decimate tag_size_m tag_height_m lens camera delay_s references reference_size_m"
        " seen_references objects tag_robots mounts exposure_s gain focus power_line_hz"
    ).split()
    for key in content:
        if key not in known:
            raise ValueError(f"unknown key {key}; known are: {', '.join(known)}")
    tag_robots = _by_tag(content, "tag_robots", "the number of a robot", _whole_number)
    for robot in tag_robots.values():
        if list(tag_robots.values()).count(robot) > 1:
            raise ValueError("tag_robots names robot %d more than once, but a robot wears one tag" % robot)
    layout = TagLayout(
        tag_robots=tag_robots,
        mounts=_by_tag(content, "mounts", POSE_FORM, _pose),
        objects=_by_tag(content, "objects", "a name", _name),
        references=_by_tag(content, "references", POSE_FORM, _pose),
        size_m=_number(content, "tag_size_m", DEFAULT_SIZE_M, 0.005, 1.0),
        height_m=_number(content, "tag_height_m", DEFAULT_HEIGHT_M, 0.0, 1.0),
        reference_size_m=_number(content, "reference_size_m", REFERENCE_SIZE_M, 0.005, 1.0),
    )
    _check_meanings(layout)
    lens = _build_lens(content["lens"]) if "lens" in content else None
    return Settings(
        _choice(content, "detector", DEFAULT_BACKEND, BACKENDS),
        _choice(content, "family", "36h11", FAMILIES),
        _number(content, "decimate", 2.0, 1.0, 8.0),
        layout,
        lens,
        _build_camera(content["camera"], lens) if "camera" in content else None,
        _number(content, "delay_s", 0.0, -1.0, 5.0),
        _by_tag(content, "seen_references", POSE_FORM, _pose),
        _build_controls(content),
    )


def _check_meanings(layout: TagLayout) -> None:
    """Check that no tag has two meanings. Raises: ValueError."""
    meanings = {"references": layout.references, "objects": layout.objects, "tag_robots": layout.tag_robots}
    for (one, tags), (other, others) in itertools.combinations(meanings.items(), 2):
        for tag_id in sorted(tags.keys() & others.keys()):
            text = "tag %d is named in %s and in %s, but has one meaning: remove it from one of them"
            raise ValueError(text % (tag_id, one, other))


def _build_controls(content: Mapping[str, Any]) -> DeviceControls:
    exposure_s = _number(content, "exposure_s", 0.0, 0.0001, 1.0) if "exposure_s" in content else None
    for key in ("gain", "focus"):
        if not is_whole_number(content.get(key, 0), low=0):
            raise ValueError(f"{key} is {shorten(content[key])}, but must be a whole number from 0 on")
    power_line_hz = content.get("power_line_hz", 0)
    if power_line_hz not in POWER_LINES_HZ:
        raise ValueError(f"power_line_hz is {shorten(power_line_hz)}, but must be 0, 50 or 60")
    return DeviceControls(exposure_s, content.get("gain"), content.get("focus"), content.get("power_line_hz"))


def _number(content: Mapping[str, Any], key: str, default: float, low: float, high: float) -> float:
    value = content.get(key, default)
    if not is_number(value, low, high):
        raise ValueError(f"{key} is {shorten(value)}, but must be a number from {low:g} to {high:g}")
    return float(value)


def _choice(content: Mapping[str, Any], key: str, default: str, known: Iterable[str]) -> str:
    value = content.get(key, default)
    if value not in list(known):
        raise ValueError(f"{key} is {shorten(value)}, but must be one of: {', '.join(sorted(known))}")
    return str(value)


def _by_tag(content: Mapping[str, Any], key: str, form: str, read: Callable[[Any], Any]) -> Dict[int, Any]:
    """Return a mapping from ids of tags to what read makes of the values."""
    given = content.get(key)
    if given is None:
        return {}
    try:
        return {_whole_number(tag_id): read(value) for tag_id, value in given.items()}
    except (AttributeError, OverflowError, TypeError, ValueError):
        raise ValueError(f"{key} must hold ID: {form} for each tag, not {shorten(given)}") from None


def _whole_number(value: Any) -> int:
    if not is_whole_number(value, low=0):
        raise ValueError
    return int(value)


def _name(value: Any) -> str:
    if not isinstance(value, (str, int)) or value == "":
        raise ValueError
    return str(value)


def _pose(values: Any) -> Pose:
    if not isinstance(values, list):
        raise ValueError
    x_m, y_m, yaw_deg = map(float, values)
    pose = Pose(x_m, y_m, math.radians(yaw_deg))
    if not is_plausible(pose):
        raise ValueError
    return pose


def _build_lens(part: Any) -> Intrinsics:
    try:
        return Intrinsics.from_camera_info(
            int(part["width_px"]), int(part["height_px"]), part["matrix"], "plumb_bob", part["distortion"]
        )
    except (KeyError, TypeError, OverflowError):
        keys = "width_px, height_px, matrix (nine numbers) and distortion"
        raise ValueError(f"lens is {shorten(part)}, but must hold {keys}: calibrate the lens") from None
    except ValueError as error:
        raise ValueError(f"lens: {error}: calibrate the lens") from None


def _build_camera(part: Any, lens: Optional[Intrinsics]) -> Camera:
    if lens is None:
        raise ValueError("camera needs lens: calibrate the lens, then the arena")
    try:
        rotation = np.asarray(part["rotation"], dtype=float).reshape(3, 3)
        position_m = np.asarray(part["position_m"], dtype=float).reshape(3)
        is_rotation = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3) and np.linalg.det(rotation) > 0.0
        if is_rotation and np.isfinite(position_m).all():
            return Camera(lens, rotation, position_m)
    except (KeyError, OverflowError, TypeError, ValueError):
        pass  # keys that are missing, other values than numbers, or too few of them
    keys = "rotation (nine numbers) and position_m (three)"
    raise ValueError(f"camera is {shorten(part)}, but must hold {keys}: calibrate the arena")
