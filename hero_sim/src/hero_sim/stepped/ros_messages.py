"""ROS 1 messages as bytes, and their definitions, for viewers and bags of robots that are stepped without ROS.

Pure. Definitions are those of ROS Noetic without comments, of which the md5 sums are made.
"""

import math
import struct
from typing import Dict, Iterable, List, NamedTuple, Sequence, Tuple

from hero_node import LENGTH, TWIST_FORM, Pose, encode_header, encode_pose, encode_text

from ..scene import Shape


class MessageType(NamedTuple):
    """Name, md5 sum and full definition of a type of message."""

    name: str
    md5: str
    definition: str


_PARTS: Dict[str, str] = {
    "std_msgs/Header": "uint32 seq\ntime stamp\nstring frame_id",
    "std_msgs/ColorRGBA": "float32 r\nfloat32 g\nfloat32 b\nfloat32 a",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Pose": "Point position\nQuaternion orientation",
    "geometry_msgs/PoseWithCovariance": "Pose pose\nfloat64[36] covariance",
    "geometry_msgs/Twist": "Vector3 linear\nVector3 angular",
    "geometry_msgs/TwistWithCovariance": "Twist twist\nfloat64[36] covariance",
    "geometry_msgs/Transform": "Vector3 translation\nQuaternion rotation",
    "geometry_msgs/TransformStamped": "Header header\nstring child_frame_id\nTransform transform",
    "visualization_msgs/Marker": (
        "uint8 ARROW=0\nuint8 CUBE=1\nuint8 SPHERE=2\nuint8 CYLINDER=3\nuint8 LINE_STRIP=4\nuint8 LINE_LIST=5\n"
        "uint8 CUBE_LIST=6\nuint8 SPHERE_LIST=7\nuint8 POINTS=8\nuint8 TEXT_VIEW_FACING=9\nuint8 MESH_RESOURCE=10\n"
        "uint8 TRIANGLE_LIST=11\nuint8 ADD=0\nuint8 MODIFY=0\nuint8 DELETE=2\nuint8 DELETEALL=3\n"
        "Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n"
        "geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nduration lifetime\nbool frame_locked\n"
        "geometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\nstring text\nstring mesh_resource\n"
        "bool mesh_use_embedded_materials"
    ),
}


def _define(name: str, md5: str, fields: str, *parts: str) -> MessageType:
    separator = f"\n{'=' * 80}\n"
    return MessageType(name, md5, separator.join([fields, *(f"MSG: {part}\n{_PARTS[part]}" for part in parts)]))


_POSE_PARTS = ("geometry_msgs/Point", "geometry_msgs/Quaternion")
ODOMETRY = _define(
    "nav_msgs/Odometry",
    "cd5e73d190d741a2f92e81eda573aca7",
    "Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
    "geometry_msgs/TwistWithCovariance twist",
    *("std_msgs/Header", "geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose", *_POSE_PARTS),
    *("geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist", "geometry_msgs/Vector3"),
)
LASER_SCAN = _define(
    "sensor_msgs/LaserScan",
    "90c7ef2dc6895d81024acba2ac42f369",
    "Header header\nfloat32 angle_min\nfloat32 angle_max\nfloat32 angle_increment\nfloat32 time_increment\n"
    "float32 scan_time\nfloat32 range_min\nfloat32 range_max\nfloat32[] ranges\nfloat32[] intensities",
    "std_msgs/Header",
)
FLOAT = _define("std_msgs/Float32", "73fcbf46b49191e672908e50842a83d4", "float32 data")
TWIST = _define(
    "geometry_msgs/Twist",
    "9f195f881246fdfa2798d1d3eebca84a",
    _PARTS["geometry_msgs/Twist"],
    "geometry_msgs/Vector3",
)
TF_MESSAGE = _define(
    "tf2_msgs/TFMessage",
    "94810edda583a504dfda3829e70d7eec",
    "geometry_msgs/TransformStamped[] transforms",
    *("geometry_msgs/TransformStamped", "std_msgs/Header", "geometry_msgs/Transform", "geometry_msgs/Vector3"),
    "geometry_msgs/Quaternion",
)
MARKER_ARRAY = _define(
    "visualization_msgs/MarkerArray",
    "d155b9ce5188fbaf89745847fd5882d7",
    "Marker[] markers",
    *("visualization_msgs/Marker", "std_msgs/Header", "geometry_msgs/Pose", *_POSE_PARTS),
    *("geometry_msgs/Vector3", "std_msgs/ColorRGBA"),
)

_MARKER_KIND, _MARKER_SIZE = struct.Struct("<3i"), struct.Struct("<3d4f2i?2I")  # before its pose, and behind
_NO_COVARIANCE = bytes(36 * 8)


def _header(time_ns: int, frame: str) -> bytes:
    return encode_header(0, frame, divmod(time_ns, 10**9))


def encode_twist(linear_m_s: float, angular_rad_s: float) -> bytes:
    """Return a TWIST in the plane."""
    return TWIST_FORM.pack(linear_m_s, 0.0, 0.0, 0.0, 0.0, angular_rad_s)


def encode_odometry(
    time_ns: int, frames: Tuple[str, str], pose: Pose, linear_m_s: float, angular_rad_s: float
) -> bytes:
    """Return an ODOMETRY; frames: of the pose, and of the robot."""
    content = _header(time_ns, frames[0]) + encode_text(frames[1]) + encode_pose(*pose) + _NO_COVARIANCE
    return content + encode_twist(linear_m_s, angular_rad_s) + _NO_COVARIANCE


def encode_scan(time_ns: int, frame: str, ranges_m: Sequence[float], limits_m: Tuple[float, float], s: float) -> bytes:
    """Return a LASER_SCAN of a whole turn, rear first and counter-clockwise, taken every s seconds."""
    count = len(ranges_m)
    step_rad = 2.0 * math.pi / count
    angles = struct.pack("<7f", -math.pi, math.pi - step_rad, step_rad, 0.0, s, *limits_m)
    return _header(time_ns, frame) + angles + struct.pack("<I%dfI" % count, count, *ranges_m, 0)


def encode_transforms(time_ns: int, transforms: Iterable[Tuple[str, str, Pose]]) -> bytes:
    """Return a TF_MESSAGE; each transform: parent, child, pose of the child in the parent."""
    encoded = [_header(time_ns, parent) + encode_text(child) + encode_pose(*pose) for parent, child, pose in transforms]
    return LENGTH.pack(len(encoded)) + b"".join(encoded)


def encode_markers(time_ns: int, frame: str, shapes: Iterable[Shape]) -> bytes:
    """Return a MARKER_ARRAY that adds or moves shapes."""
    encoded: List[bytes] = []
    for shape in shapes:
        body = _MARKER_KIND.pack(shape.number, shape.kind, 0) + encode_pose(*shape.pose, shape.z_m)
        body += _MARKER_SIZE.pack(*shape.size_m, *shape.color, 0, 0, False, 0, 0)
        head = _header(time_ns, frame) + encode_text(shape.namespace)
        encoded.append(head + body + encode_text(shape.text) + encode_text("") + b"\0")
    return LENGTH.pack(len(encoded)) + b"".join(encoded)
