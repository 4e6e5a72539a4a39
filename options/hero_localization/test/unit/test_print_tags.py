"""Printed tags: their true size on the page, cut out without overlap, numbers, wrong options."""

import io
import math
import sys

import numpy as np
import pytest

pytest.importorskip("matplotlib")
cv2 = pytest.importorskip("cv2")

from hero_localization.calibration.lens_calibration import find_board  # noqa: E402
from hero_localization.errors import LocalizationError  # noqa: E402
from hero_localization.prints import print_tags  # noqa: E402 - there is nothing to print without these
from hero_localization.prints.boards import COLUMNS, ROWS, SQUARE_M  # noqa: E402
from hero_localization.prints.tag_images import draw_tag  # noqa: E402
from hero_localization.tracking.detectors import create_detector  # noqa: E402
from hero_node import ProgramError  # noqa: E402
from hero_test.nonempty import maybe_empty, nonempty  # noqa: E402

DOTS_PER_MM = 8.0
A4_MM = print_tags.PAPERS_MM["a4"]


def scan(figure):
    """Return a page as a scanner would, 8 dots per mm."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure)
    png = io.BytesIO()
    figure.savefig(png, dpi=DOTS_PER_MM * 25.4, format="png")
    return cv2.imdecode(np.frombuffer(png.getvalue(), np.uint8), cv2.IMREAD_GRAYSCALE)


def list_pages(*arguments, cells=8):
    options = print_tags.parse_options(arguments)
    return list(print_tags.split_pages(print_tags.list_sheets(options, cells), print_tags.PAPERS_MM[options.paper]))


@pytest.mark.slow
@pytest.mark.parametrize(("family", "cells"), [("36h11", 8), ("16h5", 6)])
def test_tags_on_paper_have_their_true_size_and_place(family, cells):
    (page,) = list_pages("--robots", "0 7", "--references", "20", "--reference-size", "90", cells=cells)
    image = scan(print_tags.draw_page(page, family, A4_MM))
    assert image.shape == pytest.approx((297 * DOTS_PER_MM, 210 * DOTS_PER_MM), abs=2)
    found = {tag.tag_id: tag for tag in create_detector("aruco", family).detect(image)}
    assert sorted(found) == [0, 7, 20]
    for sheet, x_mm, y_mm in nonempty(page):
        tag = found[sheet.tag_id]
        assert tag.side_px / DOTS_PER_MM == pytest.approx(sheet.size_mm, abs=0.3)
        assert tag.center / DOTS_PER_MM == pytest.approx((x_mm, 297.0 - y_mm), abs=0.3)
        assert tag.corners[0, 1] < tag.corners[3, 1] - 100.0, "upright, as the triangle shows"
    ruler = np.nonzero(image[-round((12.0 + 0.02) * DOTS_PER_MM) - 1] < 200)[0]
    assert (ruler[-1] - ruler[0]) / DOTS_PER_MM == pytest.approx(100.0, abs=0.5)


def test_pieces_lie_on_the_page_and_apart():
    for paper in ("a4", "letter"):
        width_mm, height_mm = print_tags.PAPERS_MM[paper]
        pages = list_pages("--robots", "0-19", "--references", "100-105", "--paper", paper)
        assert sorted(sheet.tag_id for page in pages for sheet, _, _ in page) == [
            *range(20),
            *range(100, 106),
        ]
        for page in nonempty(pages):
            for index, (sheet, x_mm, y_mm) in nonempty(enumerate(page)):
                half_mm = sheet.outer_mm / 2.0
                assert x_mm - half_mm >= 12.0 - 1e-6 and x_mm + half_mm <= width_mm - 12.0 + 1e-6
                assert y_mm - half_mm >= 28.0 - 1e-6 and y_mm + half_mm <= height_mm - 12.0 + 1e-6
                for other, other_x_mm, other_y_mm in maybe_empty(page[:index]):
                    apart_mm = max(abs(x_mm - other_x_mm), abs(y_mm - other_y_mm))
                    assert apart_mm >= half_mm + other.outer_mm / 2.0 + 3.9


def test_papers_have_their_sizes():
    assert print_tags.PAPERS_MM["a4"] == (210.0, 297.0)
    assert [side_mm / 25.4 for side_mm in print_tags.PAPERS_MM["letter"]] == pytest.approx([8.5, 11.0])


@pytest.mark.slow
def test_board_on_paper_is_that_of_the_lens_calibration():
    view = find_board(scan(print_tags.draw_board_page(print_tags.PAPERS_MM["letter"])))
    assert len(view.ids) == (COLUMNS - 1) * (ROWS - 1)
    places = view.pixels[np.argsort(view.ids)].reshape(ROWS - 1, COLUMNS - 1, 2)
    along_mm = np.linalg.norm(places[:, -1] - places[:, 0], axis=1) / DOTS_PER_MM
    assert along_mm == pytest.approx(1e3 * SQUARE_M * (COLUMNS - 2), abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "pages", "told"),
    [
        (["--robots", "0-9", "--references", "100", "--board"], 4, "11 tags and the board on 4 pages"),
        (["--robots", "3"], 1, "1 tag on 1 page"),
        (["--board"], 1, "the board on 1 page"),
    ],
)
def test_file_is_written_with_all_pages_and_told(arguments, pages, told, tmp_path, capsys):
    path = tmp_path / "tags.pdf"
    print_tags.main([*arguments, "--out", str(path)])
    content = path.read_bytes()
    assert content.startswith(b"%PDF") and content.count(b"/Type /Page ") == pages
    assert b"595.27559" in content and b"841.88976" in content, "A4 in points"
    assert capsys.readouterr().out == "%s: %s; print at 100 %%, and check the ruler\n" % (path, told)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "nothing to print"),
        (["--robots", "30", "--family", "16h5"], "tag 30: family 16h5 has 0 to 29"),
        (["--robots", "3", "--size", "48"], "--size 48: it must be from 5 to 45.9 mm"),
        (["--robots", "3", "--size", "nan"], "--size nan"),
        (["--robots", "0-9", "--references", "4-12"], "--references 4: that is a robot's tag"),
        (
            ["--references", "100", "--reference-size", "200"],
            "--reference-size 200: it must be from 5 to 124.0 mm",
        ),
    ],
)
def test_wrong_options_are_named(arguments, words):
    with pytest.raises(LocalizationError, match=words):
        print_tags.main(arguments)


def test_a_page_that_cannot_be_drawn_leaves_the_file_as_it_was(tmp_path):
    path = tmp_path / "tags.pdf"
    path.write_bytes(b"an earlier one")
    with pytest.raises(LocalizationError, match="tag 600: family"):
        print_tags.main(["--robots", "1 600", "--out", str(path)])
    assert path.read_bytes() == b"an earlier one" and list(tmp_path.iterdir()) == [path]


def test_a_path_that_cannot_be_written_is_named():
    with pytest.raises(FileNotFoundError, match="'/nowhere/tags.pdf'$"):
        print_tags.main(["--robots", "3", "--out", "/nowhere/tags.pdf"])


@pytest.mark.parametrize(
    ("arguments", "words"), [(["--robots", "all"], "must be ids such as"), (["--family", "25h9"], "'16h5', '36h11'")]
)
def test_ids_and_a_known_family_must_be_named(arguments, words, capsys):
    with pytest.raises(SystemExit):
        print_tags.parse_options(arguments)
    assert words in capsys.readouterr().err


def draw(sheet, x_mm=100.0, y_mm=150.0, family="36h11"):
    """Return what is drawn of a sheet besides tag and ruler: patches, lines and texts."""
    _, empty = print_tags._open_page(A4_MM)
    (axes,) = print_tags.draw_page([(sheet, x_mm, y_mm)], family, A4_MM).axes
    return axes.patches, axes.lines[len(empty.lines) :], axes.texts[len(empty.texts) :]


def test_a_robots_disc_shows_front_and_number_outside_of_the_white_margin():
    for size_mm, family, cells in ((40.0, "36h11", 8), (30.0, "16h5", 6), (45.0, "36h11", 8)):
        (circle, front), lines, (number,) = draw(print_tags.Sheet(7, size_mm, 73.0, True), family=family)
        assert circle.center == (100.0, 150.0) and circle.radius == 36.5 and not lines
        white_mm = size_mm / 2.0 + 1.2 * size_mm / cells
        tip, left, right = front.get_xy()[:3].tolist()
        assert tip[0] == 100.0 and left[1] == right[1] < tip[1], "a triangle that points up, to the front"
        assert 100.0 - left[0] == right[0] - 100.0 == pytest.approx(tip[1] - left[1])
        band_mm = 36.5 - white_mm
        assert left[1] - 150.0 > white_mm - 0.5 and math.hypot(right[0] - 100.0, tip[1] - 150.0) < 36.5 + 0.5
        assert (tip[1] + left[1]) / 2.0 - 150.0 == pytest.approx((white_mm + 36.5) / 2.0)
        assert tip[1] - left[1] == pytest.approx(max(0.6 * band_mm, 1.0))
        assert number.get_text() == "7" and number.get_ha() == number.get_va() == "center"
        assert number.get_position() == pytest.approx((100.0, 150.0 - (white_mm + 36.5) / 2.0))
        assert number.get_fontsize() * 25.4 / 72.0 == pytest.approx(max(0.6 * band_mm, 1.0))


def test_a_reference_tag_has_marks_at_the_middle_of_its_sides():
    (frame,), lines, (label,) = draw(print_tags.Sheet(101, 100.0, 150.0, False))
    assert (frame.get_xy(), frame.get_width(), frame.get_height()) == ((25.0, 75.0), 150.0, 150.0)
    ends = sorted(tuple(map(tuple, np.column_stack(line.get_data()).tolist())) for line in lines)
    assert ends == sorted(
        [((175.0, 150.0), (169.0, 150.0)), ((25.0, 150.0), (31.0, 150.0)),
         ((100.0, 225.0), (100.0, 219.0)), ((100.0, 75.0), (100.0, 81.0))]
    )  # fmt: skip
    assert label.get_text() == "101 (36h11, 100 mm)" and label.get_position() == (27.0, 76.0)


def test_the_ruler_has_a_mark_for_each_centimeter_above_its_line():
    _, axes = print_tags._open_page(A4_MM)
    (xs, ys), *marks = (line.get_data() for line in axes.lines)
    assert tuple(xs) == (55.0, 155.0) and tuple(ys) == (12.0, 12.0)
    assert [mark[0][0] for mark in marks] == pytest.approx([55.0 + 10.0 * index for index in range(11)])
    assert [mark[1][1] - mark[1][0] for mark in marks] == [4.0 if index in (0, 5, 10) else 2.0 for index in range(11)]
    assert all(mark[0][0] == mark[0][1] and mark[1][0] == 12.0 for mark in marks)
    assert axes.texts[0].get_position() == (105.0, 18.0) and "must measure 100 mm" in axes.texts[0].get_text()
    assert axes.get_xlim() == (0.0, 210.0) and axes.get_ylim() == (0.0, 297.0)


@pytest.mark.slow
def test_the_board_lies_in_the_middle_above_the_ruler():
    for paper_mm in print_tags.PAPERS_MM.values():
        (axes,) = print_tags.draw_board_page(paper_mm).axes
        black, white = axes.collections
        (left_mm, low_mm), (right_mm, high_mm) = find_bounds(black)
        assert left_mm + right_mm == pytest.approx(paper_mm[0]) and low_mm == 28.0
        assert (right_mm - left_mm, high_mm - low_mm) == pytest.approx((175.0, 225.0)) and high_mm < paper_mm[1]
        np.testing.assert_allclose(find_bounds(white), find_bounds(black))
        assert not axes.images, "a PDF rounds their size to points"


def find_bounds(collection):
    """Return the lowest and highest x and y (2, 2) of rectangles."""
    corners = np.vstack([path.vertices[:4] for path in collection.get_paths()])
    return corners.min(axis=0), corners.max(axis=0)


def test_sheets_fill_rows_from_the_upper_left_and_pages_in_turn():
    small, large = print_tags.Sheet(1, 20.0, 40.0, True), print_tags.Sheet(2, 40.0, 80.0, True)
    first, second = print_tags.split_pages([large, *[small] * 4, large, large], (200.0, 200.0))
    assert [(sheet.tag_id, x_mm, y_mm) for sheet, x_mm, y_mm in first] == [
        (2, 52.0, 148.0), (1, 116.0, 168.0), (1, 160.0, 168.0), (1, 32.0, 84.0), (1, 76.0, 84.0),
    ]  # fmt: skip
    assert [(sheet.tag_id, x_mm, y_mm) for sheet, x_mm, y_mm in second] == [(2, 52.0, 148.0), (2, 136.0, 148.0)]
    (alone,) = print_tags.split_pages([print_tags.Sheet(3, 90.0, 190.0, False)], (200.0, 200.0))
    assert len(alone) == 1, "what is larger than a page has one of its own"
    assert list(print_tags.split_pages([], (200.0, 200.0))) == []


@pytest.mark.parametrize(
    ("arguments", "limits"),
    [(["--robots", "3", "--size"], (5.0, 45.88)), (["--references", "100", "--reference-size"], (5.0, 124.0))],
)
def test_sizes_may_be_as_small_and_as_large_as_named(arguments, limits):
    low_mm, high_mm = limits
    for size_mm in limits:
        assert list_pages(*arguments, str(size_mm))[0][0][0].size_mm == size_mm
    for size_mm in (low_mm - 0.01, high_mm + 0.01):
        with pytest.raises(LocalizationError, match="must be from 5 to"):
            list_pages(*arguments, str(size_mm))


@pytest.mark.parametrize(("family", "tag_id"), [("36h11", 9), ("16h5", 4)])
def test_white_cells_lie_on_one_black_square(family, tag_id):
    figure = print_tags.draw_page([(print_tags.Sheet(tag_id, 48.0, 73.0, True), 90.0, 150.0)], family, A4_MM)
    (axes,) = figure.axes
    black, white = axes.collections
    (corners,) = (path.vertices[:4] for path in black.get_paths())
    assert corners.min(axis=0).tolist() == [66.0, 126.0] and corners.max(axis=0).tolist() == [114.0, 174.0]
    assert black.get_facecolor()[0].tolist() == [0.0, 0.0, 0.0, 1.0] and white.get_facecolor()[0].tolist() == [1.0] * 4
    assert white.get_zorder() > black.get_zorder()
    cells = draw_tag(family, tag_id)
    cell_mm, found = 48.0 / len(cells), np.zeros(cells.shape, int)
    for path in nonempty(white.get_paths()):
        low, high = path.vertices[:4].min(axis=0), path.vertices[:4].max(axis=0)
        left, right = np.rint((np.array((low[0], high[0])) - 66.0) / cell_mm).astype(int)
        top, bottom = np.rint((174.0 - np.array((high[1], low[1]))) / cell_mm).astype(int)
        assert high - low == pytest.approx(((right - left) * cell_mm, (bottom - top) * cell_mm))
        found[top:bottom, left:right] += 1
    np.testing.assert_array_equal(found, cells > 0)


def test_what_is_not_named_has_its_default():
    options = vars(print_tags.parse_options([]))
    assert options == {
        "robots": (), "references": (), "family": "36h11", "size": 40.0, "reference_size": 100.0, "board": False,
        "paper": "a4", "out": "tags.pdf",
    }  # fmt: skip
    (page,) = list_pages("--robots", "3", "--references", "7")
    robot, reference = print_tags.Sheet(3, 40.0, 73.0, True), print_tags.Sheet(7, 100.0, 150.0, False)
    assert {sheet for sheet, _, _ in page} == {robot, reference}
    assert list_pages("--references", "7", cells=6)[0][0][0].outer_mm == pytest.approx(100.0 * 10.0 / 6.0)


@pytest.mark.parametrize(("module", "package"), [("matplotlib", "python3-matplotlib"), ("cv2", "python3-opencv")])
def test_a_missing_library_is_named_with_its_package(module, package, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ProgramError, match="%s is missing .*; install it: apt install %s" % (module, package)):
        print_tags.main(["--robots", "3"])


def test_the_program_writes_its_file(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["print_tags", "--robots", "1-3", "--out", str(tmp_path / "tags.pdf")])
    print_tags.main()
    assert (tmp_path / "tags.pdf").is_file() and "3 tags on 1 page;" in capsys.readouterr().out


def test_lines_and_texts_are_as_thin_and_small_as_scissors_and_eyes_need():
    for sheet in (print_tags.Sheet(101, 100.0, 150.0, False), print_tags.Sheet(7, 40.0, 73.0, True)):
        (rim, *_), marks, texts = draw(sheet)
        assert rim.get_linewidth() == 0.4 and not rim.get_fill() and rim.get_linestyle() == (0, (4, 4)), "dashed"
        assert all(mark.get_linewidth() == 0.8 and mark.get_color() == "black" for mark in maybe_empty(marks))
        assert texts[0].get_fontsize() == 6.0 or sheet.is_robot
    _, axes = print_tags._open_page(A4_MM)
    assert {line.get_linewidth() for line in axes.lines} == {0.4} and axes.texts[0].get_fontsize() == 8.0
    assert not axes.axison and axes.get_position().bounds == (0.0, 0.0, 1.0, 1.0)
    assert axes.figure.get_size_inches() * 25.4 == pytest.approx(A4_MM)
