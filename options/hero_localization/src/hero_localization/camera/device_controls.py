"""Controls of a USB camera that must not change by themselves: exposure, gain, focus.

A lens is calibrated for one focus; a long exposure blurs moving tags. OpenCV does not tell what a camera made of a
value: they are written and read back through the kernel. Source: linux/videodev2.h, v4l2-controls.h.
"""

import fcntl
import os
import struct
from typing import Dict, List, NamedTuple, Optional

GET_CONTROL, SET_CONTROL = 0xC008561B, 0xC008561C
"""VIDIOC_G_CTRL, VIDIOC_S_CTRL: of a struct v4l2_control, id and value."""
_CONTROL = struct.Struct("=Ii")

AUTO_GAIN, GAIN = 0x00980912, 0x00980913
AUTO_EXPOSURE, EXPOSURE, AUTO_EXPOSURE_RATE = 0x009A0901, 0x009A0902, 0x009A0903
FOCUS, AUTO_FOCUS = 0x009A090A, 0x009A090C

AUTO_EXPOSURE_ON = (0, 3)
MANUAL_EXPOSURE = 1
"""Values of AUTO_EXPOSURE; both that are on leave the time to the camera."""

EXPOSURE_STEP_S = 1e-4


class DeviceControls(NamedTuple):
    """Settings of a camera file; None: stays as it is. gain and focus are in the camera's own units."""

    exposure_s: Optional[float] = None
    gain: Optional[int] = None
    focus: Optional[int] = None


def call_control(path: str, request: int, control: int, value: int = 0) -> Optional[int]:
    """Set or get a control of a V4L2 device, which another program may be reading images from; return its value.

    None if the camera has no such control, or takes no such value.
    """
    data = bytearray(_CONTROL.pack(control, value))
    try:
        device = os.open(path, os.O_RDWR | os.O_NONBLOCK)
        try:
            fcntl.ioctl(device, request, data)
        finally:
            os.close(device)
    except OSError:
        return None
    return int(_CONTROL.unpack(data)[1])


def apply_controls(controls: DeviceControls, path: str) -> List[str]:
    """Set what the camera file sets. Return what the camera did not take, and what it still changes by itself."""
    problems = []
    wanted: Dict[str, Dict[int, int]] = {}
    if controls.exposure_s is not None:
        ticks = round(controls.exposure_s / EXPOSURE_STEP_S)
        wanted["exposure_s"] = {AUTO_EXPOSURE: MANUAL_EXPOSURE, AUTO_EXPOSURE_RATE: 0, EXPOSURE: ticks}
    if controls.gain is not None:
        wanted["gain"] = {AUTO_GAIN: 0, GAIN: controls.gain}
    if controls.focus is not None:
        wanted["focus"] = {AUTO_FOCUS: 0, FOCUS: controls.focus}
    for key, values in wanted.items():
        for control, value in values.items():
            call_control(path, SET_CONTROL, control, value)
        control, value = list(values.items())[-1]
        found = call_control(path, GET_CONTROL, control)
        if found is None:
            problems.append(f"the camera has no {key} to set: take it out of the camera file")
        elif found != value:
            problems.append(f"{key}: the camera has {_scale(key, found)}, not {_scale(key, value)}")
    if call_control(path, GET_CONTROL, AUTO_EXPOSURE) in AUTO_EXPOSURE_ON:
        problems.append("the camera changes its exposure by itself: set exposure_s, such as 0.008, in the camera file")
    if call_control(path, GET_CONTROL, AUTO_FOCUS):
        problems.append("the camera changes its focus by itself: set focus in the camera file, then calibrate the lens")
    return problems


def _scale(key: str, value: int) -> str:
    """Return a value of the device in units of the camera file."""
    return f"{value * EXPOSURE_STEP_S:g}" if key == "exposure_s" else str(value)
