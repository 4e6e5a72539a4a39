"""Maps as files that map_server and the simulator read: NAME.yaml and NAME.png. Source: wiki.ros.org/map_server."""

import os

import numpy as np
import yaml
from PIL import Image

from hero_node.files import replace_file, write_file

from .occupancy_grid import OccupancyGrid

OCCUPIED, UNKNOWN, FREE = 0, 205, 254
"""Gray of a pixel, as map_saver writes it."""

OCCUPIED_SHARE, FREE_SHARE = 0.65, 0.196
"""Thresholds between them, as map_saver writes them."""


def save_map(path: str, grid: OccupancyGrid) -> str:
    """Write the map to path, which ends in .yaml, and beside it the image; return the image's path.

    Raises: OSError.
    """
    pixels = np.full(grid.log_odds.shape, UNKNOWN, dtype=np.uint8)
    pixels[grid.free] = FREE
    pixels[grid.occupied] = OCCUPIED
    image = os.path.splitext(path)[0] + ".png"
    with replace_file(image) as file:
        Image.fromarray(pixels[::-1]).save(file, "PNG")  # the first row of an image is its upper one
    content = {
        "image": os.path.basename(image),
        "resolution": grid.cell_m,
        "origin": [*grid.origin_m, 0.0],
        "negate": 0,
        "occupied_thresh": OCCUPIED_SHARE,
        "free_thresh": FREE_SHARE,
    }
    write_file(path, yaml.safe_dump(content, sort_keys=False).encode())
    return image
