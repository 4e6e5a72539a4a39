"""Images of a camera for all parts of calibrate_camera, the tags in them, and the end with a verdict."""

import argparse
from typing import Any, Dict, List, Optional, Sequence

from hero_client import Program, ProgramError
from hero_node import say

from ..camera.frame_source import Frame, open_source
from ..errors import CalibrationError, DetectorError
from ..tracking import settings as camera_file
from ..tracking.detector_process import DetectorProcess
from ..tracking.settings import Settings
from ..tracking.tag_pose import TagCorners

FRAME_S = 10.0
WAIT_S = 0.1


class Images:
    """The newest image of the camera, for a program that works on one after another."""

    def __init__(self, options: argparse.Namespace, program: Program, settings: Settings) -> None:
        """Open the camera. Raises: FrameSourceError."""
        self._finder: Optional[DetectorProcess] = None
        self._program = program
        self.settings = settings
        self.source = open_source(options.image, options.device, options.size, options.rate, settings.controls)
        self._name = options.device or options.image

    def poll(self) -> Optional[Frame]:
        """Return the next image; None if none comes in a moment. Raises: ProgramError if the program is to end."""
        self._check_running()
        return self.source.poll(WAIT_S)

    def _check_running(self) -> None:
        if not self._program.running:
            raise ProgramError("ended before the calibration was complete: the file is as it was")

    def take(self) -> Frame:
        """Wait for the next image. Raises: CalibrationError if none comes; as poll()."""
        for _ in range(round(FRAME_S / WAIT_S)):
            frame = self.poll()
            if self.source.warning:
                say("  " + self.source.warning)
                self.source.warning = ""
            if frame is not None:
                return frame
        reason = self.source.problem or "is the camera's driver running?"
        raise CalibrationError(f"no image from {self._name} for {FRAME_S:g} s: {reason}")

    def find_tags(self, frame: Frame) -> List[TagCorners]:
        """Return the tags in an image, which is searched at its full size.

        Raises: CalibrationError for another size than the lens has, DetectorError; ProgramError as poll().
        """
        settings, (height_px, width_px) = self.settings, frame.gray.shape
        if settings.lens is not None:
            settings.lens.check_size(height_px, width_px)
        if self._finder is None:
            # Not in this process: Ctrl-C during a detection would end it, and leave a robot driving.
            self._finder = DetectorProcess(settings.detector, settings.family, 1.0, width_px, height_px)
        try:
            return self._finder.search(frame.gray, frame.stamp_s, {})
        except DetectorError:
            self._check_running()  # what ends this program may end the detector first
            raise

    def close(self) -> None:
        """Leave the camera, and end the search."""
        self.source.close()
        if self._finder is not None:
            self._finder.close()


def finish(path: str, parts: Dict[str, Any], problems: Sequence[str]) -> int:
    """Write parts of the camera file, and print the verdict. Return the exit code."""
    camera_file.update(path, parts)
    for problem in problems:
        say("  " + problem)
    say(f"{'USE WITH CARE' if problems else 'good'}; written to {path}")
    return 1 if problems else 0
