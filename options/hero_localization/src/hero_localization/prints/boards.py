"""The ChArUco board to calibrate lenses with. Pure but for OpenCV.

A chessboard with markers in its white squares, which fits A4 and letter paper. The rows are odd: boards with even rows
differ between versions of OpenCV.
"""

from typing import Any

import cv2
import numpy as np

COLUMNS, ROWS = 9, 7
SQUARE_M, MARKER_M = 0.025, 0.0185
DICTIONARY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)


def create_board() -> Any:
    """Return OpenCV's board."""
    if hasattr(cv2.aruco, "CharucoBoard_create"):  # until OpenCV 4.6
        return cv2.aruco.CharucoBoard_create(COLUMNS, ROWS, SQUARE_M, MARKER_M, DICTIONARY)
    return cv2.aruco.CharucoBoard((COLUMNS, ROWS), SQUARE_M, MARKER_M, DICTIONARY)


def draw_board(square_px: int) -> np.ndarray:
    """Return the board's image without a margin, gray, 8 bit."""
    made = create_board()
    draw = getattr(made, "generateImage", None) or made.draw
    return draw((COLUMNS * square_px, ROWS * square_px))


def list_board_corners() -> np.ndarray:
    """Return the inner corners (K, 3) on the board, m, x to the right and y down, in the order of their ids."""
    made = create_board()
    if hasattr(made, "getChessboardCorners"):
        corners, markers = made.getChessboardCorners(), made.getObjPoints()
    else:
        corners, markers = made.chessboardCorners, made.objPoints
    corners_m, height_m = np.array(corners, dtype=float), ROWS * SQUARE_M
    if markers[0][0][1] > height_m / 2.0:  # before OpenCV 4.6, y is up: the first marker is in the upper row
        corners_m[:, 1] = height_m - corners_m[:, 1]
    return corners_m
