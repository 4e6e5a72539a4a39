"""The lens files of camera_calibration. Pure but for files."""

from hero_node.texts import one_line
from hero_node.yaml_text import YamlError, parse_yaml, read_text

from ..errors import CalibrationError
from .camera_model import Intrinsics


def load_lens(path: str) -> Intrinsics:
    """Return the intrinsics in a file of camera_calibration. Raises: CalibrationError."""
    try:
        content = parse_yaml(read_text(path))
        return Intrinsics.from_camera_info(
            int(content["image_width"]),
            int(content["image_height"]),
            content["camera_matrix"]["data"],
            str(content.get("distortion_model", "plumb_bob")),
            content["distortion_coefficients"]["data"],
        )
    except OSError as error:
        raise CalibrationError("%s cannot be read: %s" % (path, error.strerror)) from None
    except YamlError as error:
        raise CalibrationError("%s is no YAML file: %s" % (path, error)) from None
    except KeyError as error:
        raise CalibrationError(
            "%s: %s is missing; is it a file of camera_calibration?" % (path, error)
        ) from None
    except (AttributeError, OverflowError, TypeError, ValueError) as error:
        raise CalibrationError("%s is no file of camera_calibration: %s" % (path, one_line(error))) from None
