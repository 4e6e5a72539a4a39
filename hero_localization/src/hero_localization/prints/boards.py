"""ChArUco boards, to calibrate lenses with. Pure but for OpenCV."""

from typing import Any, NamedTuple

import cv2
import numpy as np


class Board(NamedTuple):
    """A chessboard with markers in its white squares; by default it fits A4 and letter paper.

    The rows are odd: boards with even rows differ between versions of OpenCV.
    """

    columns: int = 9
    rows: int = 7
    square_m: float = 0.025
    marker_m: float = 0.0185
    dictionary: str = "DICT_4X4_50"


def create_board(board: Board) -> Any:
    """Return OpenCV's board."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    if hasattr(cv2.aruco, "CharucoBoard_create"):  # until OpenCV 4.6
        return cv2.aruco.CharucoBoard_create(
            board.columns, board.rows, board.square_m, board.marker_m, dictionary
        )
    return cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_m, board.marker_m, dictionary)


def draw_board(board: Board, square_px: int) -> np.ndarray:
    """Return the board's image without a margin, gray, 8 bit."""
    made = create_board(board)
    draw = getattr(made, "generateImage", None) or made.draw
    return draw((board.columns * square_px, board.rows * square_px))


def list_board_corners(board: Board) -> np.ndarray:
    """Return the inner corners (K, 3) on the board, m, x to the right and y down, in the order of their ids."""
    made = create_board(board)
    if hasattr(made, "getChessboardCorners"):
        corners, markers = made.getChessboardCorners(), made.getObjPoints()
    else:
        corners, markers = made.chessboardCorners, made.objPoints
    corners_m, height_m = np.array(corners, dtype=float), board.rows * board.square_m
    if markers[0][0][1] > height_m / 2.0:  # before OpenCV 4.6, y is up: the first marker is in the upper row
        corners_m[:, 1] = height_m - corners_m[:, 1]
    return corners_m
