"""Program print_tags: makes a PDF of tags in true size, to print at 100 % and cut out."""

import argparse
import math
from typing import Any, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from hero_node import import_optional
from hero_node.files import replace_file
from hero_node.parameters import explicit_ids_option

from ..errors import LocalizationError
from .tag_images import DEFAULT_SIZE_M, FAMILIES, REFERENCE_SIZE_M, draw_tag

PAPERS_MM = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}
EDGE_MM = 12.0
"""Unprintable margin."""
FOOTER_MM = 16.0
GAP_MM = 4.0
ROBOT_DIAMETER_MM = 73.0
"""A disc that lies on the robot's top."""
RULER_MM = 100.0
MM_PER_INCH = 25.4
SQUARE_PX = 300
"""Side of a square of the board; the cells of its markers are whole pixels, too."""

LINE = 0.4
"""Points."""


class Sheet(NamedTuple):
    """One piece of paper to be cut out: a disc with a robot's number and front, or a square with marks at its middle.

    size_mm: side of the black square; outer_mm: diameter or side of what is cut.
    """

    tag_id: int
    size_mm: float
    outer_mm: float
    is_robot: bool


def parse_options(arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(prog="print_tags", description="Make a PDF with tags of true size.")
    text = "discs for robots, e.g. '0 1 2' or 0-9"
    parser.add_argument("--robots", type=explicit_ids_option, default=(), metavar="IDS", help=text)
    text = "squares for the floor, e.g. 100-103"
    parser.add_argument("--references", type=explicit_ids_option, default=(), metavar="IDS", help=text)
    text = "family of the tags: 36h11 (default), or 16h5 as in the stock suite"
    parser.add_argument("--family", choices=sorted(FAMILIES), default="36h11", help=text)
    text = "side of the black square on robots, mm (%(default)g)"
    parser.add_argument("--size", type=float, default=1e3 * DEFAULT_SIZE_M, metavar="MM", help=text)
    text = "the same of reference tags, mm (%(default)g)"
    parser.add_argument("--reference-size", type=float, default=1e3 * REFERENCE_SIZE_M, metavar="MM", help=text)
    parser.add_argument("--board", action="store_true", help="the chessboard for calibrating the intrinsics")
    parser.add_argument("--paper", choices=sorted(PAPERS_MM), default="a4", help="(%(default)s)")
    parser.add_argument("--out", default="tags.pdf", metavar="FILE.pdf", help="(%(default)s)")
    return parser.parse_args(arguments)


def list_sheets(options: argparse.Namespace, cells: int) -> List[Sheet]:
    """Return what is to be cut out. Raises: LocalizationError for sizes that do not fit, or an id that is there twice.

    cells: of a tag of the family along each side; one more on each side stays white.
    """
    sheets: List[Sheet] = []
    paper_mm = min(PAPERS_MM[options.paper]) - 2.0 * EDGE_MM
    for ids, size_mm, is_robot in (
        (options.robots, options.size, True),
        (options.references, options.reference_size, False),
    ):
        # A tag needs a white margin of a cell; at its corners half of one does. A reference tag has two, for the marks.
        if is_robot:
            outer_mm, most_mm = ROBOT_DIAMETER_MM, ROBOT_DIAMETER_MM / math.sqrt(2.0) / (1.0 + 1.0 / cells)
        else:
            outer_mm, most_mm = size_mm * (1.0 + 4.0 / cells), paper_mm / (1.0 + 4.0 / cells)
        if not 5.0 <= size_mm <= most_mm:
            name = "--size" if is_robot else "--reference-size"
            raise LocalizationError(f"{name} {size_mm:g}: it must be from 5 to {most_mm:.1f} mm")
        sheets.extend(Sheet(tag_id, size_mm, outer_mm, is_robot) for tag_id in ids)
    both = sorted(set(options.robots) & set(options.references))
    if both:
        raise LocalizationError("--references %d: that is a robot's tag; take an id that no robot has" % both[0])
    return sheets


def split_pages(sheets: Sequence[Sheet], paper_mm: Tuple[float, float]) -> Iterator[List[Tuple[Sheet, float, float]]]:
    """Yield for each page its sheets with their centers x, y (mm from the lower left)."""
    width_mm, height_mm = paper_mm
    page: List[Tuple[Sheet, float, float]] = []
    x_mm, top_mm, row_mm = EDGE_MM, height_mm - EDGE_MM, 0.0
    for sheet in sheets:
        if x_mm + sheet.outer_mm > width_mm - EDGE_MM:
            x_mm, top_mm, row_mm = EDGE_MM, top_mm - row_mm - GAP_MM, 0.0
        if top_mm - sheet.outer_mm < EDGE_MM + FOOTER_MM and page:
            yield page
            page, x_mm, top_mm, row_mm = [], EDGE_MM, height_mm - EDGE_MM, 0.0
        page.append((sheet, x_mm + sheet.outer_mm / 2.0, top_mm - sheet.outer_mm / 2.0))
        x_mm += sheet.outer_mm + GAP_MM
        row_mm = max(row_mm, sheet.outer_mm)
    if page:
        yield page


def draw_page(page: Sequence[Tuple[Sheet, float, float]], family: str, paper_mm: Tuple[float, float]) -> Any:
    """Return a matplotlib figure of one page, in its true size."""
    figure, axes = _open_page(paper_mm)
    for sheet, x_mm, y_mm in page:
        left_mm, low_mm = x_mm - sheet.size_mm / 2.0, y_mm - sheet.size_mm / 2.0
        _draw_print(axes, draw_tag(family, sheet.tag_id), left_mm, low_mm, sheet.size_mm, sheet.size_mm)
        (_draw_disc if sheet.is_robot else _draw_square)(axes, sheet, family, x_mm, y_mm)
    return figure


def draw_board_page(paper_mm: Tuple[float, float]) -> Any:
    """Return a matplotlib figure with the board that calibrates lenses, in its true size, lengthwise."""
    from .boards import COLUMNS, ROWS, SQUARE_M, draw_board

    height_mm, width_mm = 1e3 * SQUARE_M * COLUMNS, 1e3 * SQUARE_M * ROWS
    figure, axes = _open_page(paper_mm)
    left_mm = (paper_mm[0] - width_mm) / 2.0
    _draw_print(axes, np.rot90(draw_board(SQUARE_PX)), left_mm, EDGE_MM + FOOTER_MM, width_mm, height_mm)
    return figure


def _open_page(paper_mm: Tuple[float, float]) -> Tuple[Any, Any]:
    from matplotlib.figure import Figure

    width_mm, height_mm = paper_mm
    figure = Figure(figsize=(width_mm / MM_PER_INCH, height_mm / MM_PER_INCH))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(0.0, width_mm)
    axes.set_ylim(0.0, height_mm)
    axes.set_autoscale_on(False)
    left_mm = (width_mm - RULER_MM) / 2.0
    axes.plot((left_mm, left_mm + RULER_MM), (EDGE_MM, EDGE_MM), color="black", linewidth=LINE)
    for index in range(11):
        tick_mm = left_mm + index * RULER_MM / 10.0
        axes.plot(
            (tick_mm, tick_mm), (EDGE_MM, EDGE_MM + (4.0 if index % 5 == 0 else 2.0)), color="black", linewidth=LINE
        )
    text = f"Print at 100 % (no scaling): this line must measure {RULER_MM:g} mm"
    axes.text(width_mm / 2.0, EDGE_MM + 6.0, text, ha="center", va="bottom", fontsize=8)
    return figure, axes


def _draw_print(axes: Any, image: np.ndarray, left_mm: float, low_mm: float, width_mm: float, height_mm: float) -> None:
    """Draw an image (H, W) of black and white as rectangles: a PDF rounds the size of an image to points."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle

    rows, columns = image.shape
    black = Rectangle((left_mm, low_mm), width_mm, height_mm)
    axes.add_collection(PatchCollection([black], facecolor="black", edgecolor="none"))
    # White runs over black: between black neighbors no viewer draws a line.
    white = []
    tops = [0, *(np.flatnonzero((image[1:] != image[:-1]).any(axis=1)) + 1).tolist(), rows]
    for top, bottom in zip(tops, tops[1:]):
        edges = np.flatnonzero(np.diff(np.pad(image[top] > 0, 1, mode="constant").astype(int)))
        for start, end in edges.reshape(-1, 2).tolist():
            corner = (left_mm + start * width_mm / columns, low_mm + (rows - bottom) * height_mm / rows)
            white.append(Rectangle(corner, (end - start) * width_mm / columns, (bottom - top) * height_mm / rows))
    axes.add_collection(PatchCollection(white, facecolor="white", edgecolor="none", zorder=2))


def _draw_disc(axes: Any, sheet: Sheet, family: str, x_mm: float, y_mm: float) -> None:
    from matplotlib.patches import Circle, Polygon

    radius_mm = sheet.outer_mm / 2.0
    axes.add_patch(Circle((x_mm, y_mm), radius_mm, fill=False, linewidth=LINE, linestyle=(0, (4, 4))))
    # Front and number stay clear of the white margin, in which detectors look for the tag's edge.
    white_mm = sheet.size_mm / 2.0 + 1.2 * sheet.size_mm / FAMILIES[family].cells
    middle_mm = (white_mm + radius_mm) / 2.0
    size_mm = max(0.6 * (radius_mm - white_mm), 1.0)
    tip = ((x_mm, y_mm + middle_mm + size_mm / 2.0), (x_mm - size_mm, y_mm + middle_mm - size_mm / 2.0))
    axes.add_patch(Polygon((*tip, (x_mm + size_mm, tip[1][1])), closed=True, color="black", linewidth=0.0))
    points = size_mm / MM_PER_INCH * 72.0
    axes.text(x_mm, y_mm - middle_mm, str(sheet.tag_id), ha="center", va="center", fontsize=points, fontweight="bold")


def _draw_square(axes: Any, sheet: Sheet, family: str, x_mm: float, y_mm: float) -> None:
    from matplotlib.patches import Rectangle

    half_mm, mark_mm = sheet.outer_mm / 2.0, sheet.outer_mm * 0.04
    frame = Rectangle((x_mm - half_mm, y_mm - half_mm), sheet.outer_mm, sheet.outer_mm)
    frame.set(fill=False, linewidth=LINE, linestyle=(0, (4, 4)))
    axes.add_patch(frame)
    # Marks at the middle of each side: what is measured is the tag's center.
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        ends = [(x_mm + dx * (half_mm - part), y_mm + dy * (half_mm - part)) for part in (0.0, mark_mm)]
        axes.plot(*zip(*ends), color="black", linewidth=2.0 * LINE)
    text = "%d (%s, %g mm)" % (sheet.tag_id, family, sheet.size_mm)
    axes.text(x_mm - half_mm + 2.0, y_mm - half_mm + 1.0, text, ha="left", va="bottom", fontsize=6)


def main(arguments: Optional[Sequence[str]] = None) -> None:
    """Write the PDF and say what is in it. Raises: LocalizationError. OSError. ProgramError if a library is missing."""
    options = parse_options(arguments)
    import_optional("matplotlib", "python3-matplotlib")
    import_optional("cv2", "python3-opencv")
    from matplotlib.backends.backend_pdf import PdfPages

    sheets = list_sheets(options, FAMILIES[options.family].cells)
    if not sheets and not options.board:
        raise LocalizationError("nothing to print: name --robots 0-9, --references 100-103, or --board")
    paper_mm = PAPERS_MM[options.paper]
    pages = list(split_pages(sheets, paper_mm))
    with replace_file(options.out) as file, PdfPages(file) as pdf:
        for page in pages:
            pdf.savefig(draw_page(page, options.family, paper_mm))
        if options.board:
            pdf.savefig(draw_board_page(paper_mm))
    made = ([_count(len(sheets), "tag")] if sheets else []) + (["the board"] if options.board else [])
    on_pages = f"{' and '.join(made)} on {_count(len(pages) + bool(options.board), 'page')}"
    print(f"{options.out}: {on_pages}; print at 100 %, and check the ruler")


def _count(count: int, thing: str) -> str:
    return "%d %s%s" % (count, thing, "" if count == 1 else "s")
