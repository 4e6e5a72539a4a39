"""The file of one camera: intrinsics, extrinsics, tags. Calibrations write their parts of it, the tracker reads it all.

Pure but for the file. Lengths in m, angles in degrees, pixels as in camera_model.
"""

import itertools
import math
import os
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional

import numpy as np

from hero_client.values import is_plausible
from hero_node import Pose, one_line, shorten
from hero_node.files import (
    Entry,
    EntryError,
    YamlError,
    load_entries,
    lock_file,
    parse_yaml,
    read_text,
    replace_values,
    write_file,
)
from hero_node.parameters import MAX_COORDINATE_M

from ..camera.camera_model import MODELS, PLUMB_BOB, Camera, Intrinsics
from ..camera.device_controls import DeviceControls
from ..errors import SettingsError
from ..prints.tag_images import DEFAULT_SIZE_M, FAMILIES, REFERENCE_SIZE_M
from .detectors import BACKENDS, DEFAULT_BACKEND
from .tag_pose import DEFAULT_HEIGHT_M, TagLayout

DEFAULT_PATH = "~/hero_localization/camera.yaml"
POSE_FORM = "[x_m, y_m, yaw_deg]"
MAX_ID = 2**31 - 1
MAX_ID_DIGITS = 9


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
    arena_sd_m: float = 0.0
    """Standard deviation of places by that of the reference tags' places."""


def load(path: str) -> Settings:
    """Return the settings of a file; of one that does not exist, those of an uncalibrated camera.

    Raises: SettingsError with the file, the line, the key and what it must be.
    """
    path = os.path.expanduser(path)
    if not os.path.lexists(path):
        return Settings()
    try:
        return _build(load_entries(path, "family: 36h11", may_be_empty=True))
    except EntryError as error:
        raise SettingsError(str(error)) from None


def find_change_s(path: str) -> float:
    """Return when a file was changed last, by the clock of its disk; 0 if it does not exist."""
    try:
        return os.stat(os.path.expanduser(path)).st_mtime
    except OSError:
        return 0.0


def update(path: str, parts: Mapping[str, Any]) -> None:
    """Write these parts into a file, or begin it; entries that stay keep their comments. Raises: SettingsError."""
    path = os.path.expanduser(path)
    try:
        os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
        with lock_file(path):
            text = read_text(path) if os.path.lexists(path) else ""
            content = parse_yaml(text) or {}
            if not isinstance(content, dict):
                raise SettingsError(f"{path}: must hold names and values, such as family: 36h11")
            write_file(path, replace_values(text, {**content, **parts}).encode())
    except YamlError as error:
        raise SettingsError(f"{path}: not YAML: {error}") from None
    except OSError as error:
        raise SettingsError(f"{path} cannot be read or written: {error.strerror}") from None


def describe_lens(lens: Intrinsics) -> Dict[str, Any]:
    """Return the part of the file that holds the intrinsics."""
    return {
        "lens": {
            "width_px": lens.width_px,
            "height_px": lens.height_px,
            "matrix": np.asarray(lens.matrix).ravel().tolist(),
            "distortion": np.asarray(lens.distortion).tolist(),
            "model": lens.model,
        }
    }


def describe_camera(camera: Camera, seen: Mapping[int, Pose], arena_sd_m: float = 0.0) -> Dict[str, Any]:
    """Return the parts of the file that hold a camera's intrinsics, its pose, and the reference tags that it saw.

    arena_sd_m: standard deviation of that pose's places.
    """
    return {
        **describe_lens(camera.lens),
        "camera": {"rotation": camera.rotation.ravel().tolist(), "position_m": camera.position_m.tolist()},
        "seen_references": {tag_id: describe_pose(pose) for tag_id, pose in sorted(seen.items())},
        "arena_sd_m": round(arena_sd_m, 5),
    }


def describe_pose(pose: Pose) -> List[float]:
    """Return x, y (m) and yaw (degrees) as the file holds them."""
    return [round(float(pose.x_m), 5), round(float(pose.y_m), 5), round(math.degrees(pose.yaw_rad), 3)]


_NUMBERS = {
    "tag_size_m": (DEFAULT_SIZE_M, 0.005, 1.0),
    "tag_height_m": (DEFAULT_HEIGHT_M, 0.0, 1.0),
    "reference_size_m": (REFERENCE_SIZE_M, 0.005, 1.0),
    "decimate": (2.0, 1.0, 8.0),
    "delay_s": (0.0, -1.0, 5.0),
    "arena_sd_m": (0.0, 0.0, 1.0),
    "exposure_s": (None, 0.0001, 1.0),
}
"""Default and limits."""

_OTHERS = "detector family lens camera references seen_references objects tag_robots mounts gain focus".split()


def _build(root: Entry) -> Settings:
    content = root.mapping((*_OTHERS, *_NUMBERS))
    numbers: Dict[str, Any] = {
        key: content[key].number(low, high, "") if key in content else default
        for key, (default, low, high) in _NUMBERS.items()
    }
    tag_robots = _by_tag(content, "tag_robots", lambda entry: entry.whole(0, MAX_ID))
    for robot in tag_robots.values():
        if list(tag_robots.values()).count(robot) > 1:
            text = "%s: tag_robots names robot %d more than once, but a robot wears one tag"
            raise EntryError(text % (content["tag_robots"].place, robot))
    layout = TagLayout(
        tag_robots=tag_robots,
        mounts=_by_tag(content, "mounts", _read_pose),
        objects=_by_tag(content, "objects", _read_name),
        references=_by_tag(content, "references", _read_pose),
        size_m=numbers["tag_size_m"],
        height_m=numbers["tag_height_m"],
        reference_size_m=numbers["reference_size_m"],
    )
    _check_meanings(layout, content)
    lens = _build_lens(content["lens"]) if "lens" in content else None
    gain, focus = (content[key].whole(0, MAX_ID) if key in content else None for key in ("gain", "focus"))
    return Settings(
        content["detector"].choice(sorted(BACKENDS)) if "detector" in content else DEFAULT_BACKEND,
        content["family"].choice(sorted(FAMILIES)) if "family" in content else "36h11",
        numbers["decimate"],
        layout,
        lens,
        _build_camera(content["camera"], lens) if "camera" in content else None,
        numbers["delay_s"],
        _by_tag(content, "seen_references", _read_pose),
        DeviceControls(numbers["exposure_s"], gain, focus),
        numbers["arena_sd_m"],
    )


def _check_meanings(layout: TagLayout, content: Mapping[str, Entry]) -> None:
    """Check that no tag has two meanings. Raises: EntryError."""
    meanings = {"references": layout.references, "objects": layout.objects, "tag_robots": layout.tag_robots}
    for (one, tags), (other, others) in itertools.combinations(meanings.items(), 2):
        for tag_id in sorted(tags.keys() & others.keys()):
            text = "%s: tag %d is named in %s and in %s, but has one meaning: remove it from one of them"
            raise EntryError(text % (content[other].place, tag_id, one, other))


def _by_tag(content: Mapping[str, Entry], key: str, read: Callable[[Entry], Any]) -> Dict[int, Any]:
    """Return a mapping from ids of tags to what read makes of the values."""
    if key not in content or content[key].value is None:
        return {}
    entries = content[key].mapping()
    for name in entries:
        if not name.isdecimal() or len(name) > MAX_ID_DIGITS:
            raise EntryError(f"{entries[name].place}: {key} has {shorten(name)} for a tag, but must have its number")
    return {int(name): read(entry) for name, entry in entries.items()}


def _read_name(entry: Entry) -> str:
    return entry.text() if isinstance(entry.value, str) else str(entry.whole(0, MAX_ID))


def _read_pose(entry: Entry) -> Pose:
    x_m, y_m, yaw_deg = entry.numbers(3, -MAX_COORDINATE_M, MAX_COORDINATE_M, POSE_FORM)
    pose = Pose(x_m, y_m, math.radians(yaw_deg))
    return pose if is_plausible(pose) else entry.refuse(POSE_FORM)


def _build_lens(entry: Entry) -> Intrinsics:
    keys = ("width_px", "height_px", "matrix", "distortion")
    part = entry.mapping((*keys, "model"), keys)
    width_px, height_px = (part[key].whole(-MAX_ID, MAX_ID) for key in keys[:2])
    matrix, distortion = (part[key].plain() for key in keys[2:])
    model = part["model"].choice(list(MODELS)) if "model" in part else PLUMB_BOB
    try:
        return Intrinsics.from_camera_info(width_px, height_px, matrix, model, distortion)
    except (TypeError, OverflowError, ValueError) as error:
        raise EntryError(f"{entry.place}: lens: {one_line(error)}: calibrate the lens") from None


def _build_camera(entry: Entry, lens: Optional[Intrinsics]) -> Camera:
    if lens is None:
        raise EntryError(f"{entry.place}: camera needs lens: calibrate the lens, then the arena")
    keys = "rotation (nine numbers) and position_m (three): calibrate the arena"
    part = entry.mapping(("rotation", "position_m"), ("rotation", "position_m"))
    rotation = np.reshape(part["rotation"].numbers(9, -1.1, 1.1, keys), (3, 3))
    position_m = np.array(part["position_m"].numbers(3, -MAX_COORDINATE_M, MAX_COORDINATE_M, keys))
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3) or np.linalg.det(rotation) <= 0.0:
        part["rotation"].refuse("a turn, without mirroring or scaling: calibrate the arena")
    return Camera(lens, rotation, position_m)
