"""The occupancy grid on `/map`, of map_arena or map_server, as the page draws it. Pure.

Most neighboring cells are alike: a grid of 220 x 220 cells is sent as some hundred runs.
"""

import array
import re
from typing import Any, Dict, Optional

from hero_client.values import read_pose

from .page_state import encode_pose

MAX_CELLS, MAX_CELL_M = 1000000, 10.0
UNKNOWN, FREE, OCCUPIED = range(3)
OCCUPIED_PERCENT = 65
"""As in map_server."""

_STATES = bytes(FREE if cell < OCCUPIED_PERCENT else OCCUPIED for cell in range(128)) + bytes(128)
_RUN = re.compile(rb"(.)\1*", re.DOTALL)


def encode_grid(message: Any, map_frame: str) -> Optional[Dict[str, Any]]:
    """Return a nav_msgs/OccupancyGrid for the page; None if it has no place on a map in this frame.

    pose: of its lower left corner, mm and mrad; cell: side of one, mm; runs: state and number of cells, in turn,
    by rows from there.
    """
    info = message.info
    count = info.width * info.height
    pose = encode_pose(read_pose(info.origin))
    is_placed = message.header.frame_id.lstrip("/") == map_frame and pose is not None
    is_placed &= 0.0 < info.resolution < MAX_CELL_M
    if not is_placed or not 0 < count <= MAX_CELLS or len(message.data) != count:
        return None
    states = array.array("b", message.data).tobytes().translate(_STATES)
    runs = [number for run in _RUN.finditer(states) for number in (run.group()[0], len(run.group()))]
    cell_mm = round(1e3 * info.resolution, 3)
    return {"pose": pose, "cell": cell_mm, "columns": info.width, "rows": info.height, "runs": runs}
