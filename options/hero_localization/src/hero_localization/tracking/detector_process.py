"""The search for tags in its own process: detectors hold the GIL for many milliseconds, and one takes SIGINT over.

Images go over in shared memory, all else over a pipe. The process does not use ROS, and ends with its parent.
"""

import math
import mmap
import os
import subprocess
import sys
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any, List, Mapping, Optional, Tuple

import numpy as np

from ..errors import DetectorError
from .detectors import create_detector, create_fine_detectors
from .tag_pose import TagCorners
from .tag_search import TagSearch

ANSWER_S = 60.0
"""Long enough for a search of the whole image on a machine that is busy with much else."""
END_S = 5.0
COARSE = ((48.0, 2.0), (36.0, 1.5))
"""Sides in pixels from which on tags are found as well, with corners as accurate, when decimated more, by that."""


class DetectorProcess:
    """A TagSearch that runs in another process."""

    def __init__(
        self, backend: str, family: str, decimate: float, width_px: int, height_px: int, smallest_px: float = math.inf
    ) -> None:
        """Start the process; smallest_px: side of the smallest tag to be expected.

        Raises: DetectorError for a detector that cannot be made, or does not start.
        """
        self._shape = (height_px, width_px)
        memory = os.memfd_create("hero_frame")
        os.ftruncate(memory, width_px * height_px)
        self._frame = np.frombuffer(mmap.mmap(memory, width_px * height_px), np.uint8).reshape(self._shape)
        near, far = Pipe()
        command = [sys.executable, "-m", __name__, str(far.fileno()), str(memory)]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        environment["OPENBLAS_NUM_THREADS"] = "1"  # others would spin beside it, and cost more than the search
        self._connection: Optional[Connection] = near
        with far:
            self._process = subprocess.Popen(
                command,
                env=environment,
                pass_fds=(far.fileno(), memory),
                # Ctrl-C goes to a terminal's whole group; apriltag lets it end its process, whatever was set before.
                start_new_session=True,
            )
        os.close(memory)
        problem = self._ask((backend, family, decimate, width_px, height_px, smallest_px))
        if problem is not None:
            self.close()
            raise DetectorError(problem)

    def search(
        self, gray: np.ndarray, stamp_s: float, expected: Mapping[int, Tuple[float, float, float]]
    ) -> List[TagCorners]:
        """Return the tags found in the next frame, as TagSearch.search() does.

        Raises: DetectorError if the process ended or does not answer; ValueError for a frame of another size.
        """
        if gray.shape != self._shape:
            raise ValueError(f"a frame of {gray.shape} pixels, but frames have {self._shape}")
        self._frame[:] = gray
        return list(map(TagCorners, *self._ask((stamp_s, dict(expected)))))

    def _ask(self, question: Any) -> Any:
        if self._connection is None:
            raise DetectorError("the detector's process has ended")
        try:
            self._connection.send(question)
            if self._connection.poll(ANSWER_S):
                return self._connection.recv()
        except (EOFError, OSError):
            self.close()
            text = f"the detector's process ended with status {self._process.returncode}: start again"
            raise DetectorError(text) from None
        self.close()
        raise DetectorError(f"the detector's process did not answer for {ANSWER_S:.0f} s: start again")

    def close(self) -> None:
        """End the process; may be called twice."""
        if self._connection is None:
            return
        self._connection.close()
        self._connection = None
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def serve(connection: Connection, memory: int) -> None:
    """Answer requests until the parent has ended."""
    backend, family, decimate, width_px, height_px, smallest_px = connection.recv()
    frame = np.frombuffer(mmap.mmap(memory, width_px * height_px), np.uint8).reshape(height_px, width_px)
    decimate *= next((factor for side_px, factor in COARSE if side_px <= smallest_px < math.inf), 1.0)
    try:
        fine = create_fine_detectors(family) if backend == "apriltag" else []
        search = TagSearch(create_detector(backend, family, decimate), width_px, height_px, fine, smallest_px)
    except DetectorError as error:
        connection.send(str(error))
        return
    connection.send(None)
    while True:
        stamp_s, expected = connection.recv()
        tags = search.search(frame, stamp_s, expected)
        # One array instead of many: pickle takes longer for each than for all its numbers.
        connection.send(([tag.tag_id for tag in tags], np.array([tag.corners for tag in tags])))


def main() -> None:
    """Run the child process, until its parent closes the connection or ends."""
    connection, memory = Connection(int(sys.argv[1])), int(sys.argv[2])
    with suppress(EOFError, OSError):
        serve(connection, memory)


if __name__ == "__main__":
    main()
