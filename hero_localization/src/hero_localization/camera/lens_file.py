"""The lens files of camera_calibration. Pure but for files."""

from pathlib import Path
from typing import Union

import yaml

from ..errors import CalibrationError
from .camera_model import Lens

__all__ = ["load_lens"]


def load_lens(path: Union[str, Path]) -> Lens:
    """Return the lens in a file of camera_calibration. Raises: CalibrationError."""
    try:
        content = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
        return Lens.from_camera_info(
            int(content["image_width"]),
            int(content["image_height"]),
            content["camera_matrix"]["data"],
            str(content.get("distortion_model", "plumb_bob")),
            content["distortion_coefficients"]["data"],
        )
    except OSError as error:
        raise CalibrationError("%s cannot be read: %s" % (path, error.strerror)) from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise CalibrationError("%s is no YAML file: %s" % (path, str(error).splitlines()[0])) from None
    except KeyError as error:
        raise CalibrationError(
            "%s: %s is missing; is it a file of camera_calibration?" % (path, error)
        ) from None
    except (AttributeError, TypeError, ValueError) as error:
        raise CalibrationError("%s is no file of camera_calibration: %s" % (path, error)) from None
