"""Printed tags: their true size on the page, cut out without overlap, numbers, wrong options."""

import io

import numpy as np
import pytest

pytest.importorskip("matplotlib")
cv2 = pytest.importorskip("cv2")

from hero_localization.calibration.lens_calibration import find_board  # noqa: E402
from hero_localization.errors import LocalizationError  # noqa: E402
from hero_localization.prints import print_tags  # noqa: E402 - there is nothing to print without these
from hero_localization.prints.boards import Board  # noqa: E402
from hero_localization.tracking.detectors import create_detector  # noqa: E402

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
    return list(
        print_tags.split_pages(print_tags.list_sheets(options, cells), print_tags.PAPERS_MM[options.paper])
    )


@pytest.mark.parametrize(("family", "cells"), [("36h11", 8), ("16h5", 6)])
def test_tags_on_paper_have_their_true_size_and_place(family, cells):
    (page,) = list_pages("--robots", "0 7", "--references", "20", "--reference-size", "90", cells=cells)
    image = scan(print_tags.draw_page(page, family, A4_MM))
    assert image.shape == pytest.approx((297 * DOTS_PER_MM, 210 * DOTS_PER_MM), abs=2)
    found = {tag.tag_id: tag for tag in create_detector("aruco", family).detect(image)}
    assert sorted(found) == [0, 7, 20]
    for sheet, x_mm, y_mm in page:
        tag = found[sheet.tag_id]
        assert tag.side_px / DOTS_PER_MM == pytest.approx(sheet.size_mm, abs=0.3)
        assert tag.center / DOTS_PER_MM == pytest.approx((x_mm, 297.0 - y_mm), abs=0.3)
        assert tag.corners[0, 1] < tag.corners[3, 1] - 100.0, "upright, as the triangle shows"


def test_pieces_lie_on_the_page_and_apart():
    for paper in ("a4", "letter"):
        width_mm, height_mm = print_tags.PAPERS_MM[paper]
        pages = list_pages("--robots", "0-19", "--references", "100-105", "--paper", paper)
        assert sorted(sheet.tag_id for page in pages for sheet, _, _ in page) == [
            *range(20),
            *range(100, 106),
        ]
        for page in pages:
            for index, (sheet, x_mm, y_mm) in enumerate(page):
                half_mm = sheet.outer_mm / 2.0
                assert x_mm - half_mm >= 12.0 - 1e-6 and x_mm + half_mm <= width_mm - 12.0 + 1e-6
                assert y_mm - half_mm >= 28.0 - 1e-6 and y_mm + half_mm <= height_mm - 12.0 + 1e-6
                for other, other_x_mm, other_y_mm in page[:index]:
                    apart_mm = max(abs(x_mm - other_x_mm), abs(y_mm - other_y_mm))
                    assert apart_mm >= half_mm + other.outer_mm / 2.0 + 3.9


def test_ruler_is_100_mm_long():
    (page,) = list_pages("--robots", "1")
    image = scan(print_tags.draw_page(page, "36h11", A4_MM))
    row = image[-round((12.0 + 0.02) * DOTS_PER_MM) - 1]
    dark = np.nonzero(row < 200)[0]
    assert (dark[-1] - dark[0]) / DOTS_PER_MM == pytest.approx(100.0, abs=0.5)


def test_board_on_paper_is_that_of_the_lens_calibration():
    board = Board()
    for paper_mm in print_tags.PAPERS_MM.values():
        view = find_board(scan(print_tags.draw_board_page(paper_mm)), board)
        assert len(view.ids) == (board.columns - 1) * (board.rows - 1)
        places = view.pixels[np.argsort(view.ids)].reshape(board.rows - 1, board.columns - 1, 2)
        along_mm = np.linalg.norm(places[:, -1] - places[:, 0], axis=1) / DOTS_PER_MM
        assert along_mm == pytest.approx(1e3 * board.square_m * (board.columns - 2), abs=0.2)


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
    print_tags.run(print_tags.parse_options([*arguments, "--out", str(path)]))
    content = path.read_bytes()
    assert content.startswith(b"%PDF") and content.count(b"/Type /Page ") == pages
    assert b"595.27559" in content and b"841.88976" in content, "A4 in points"
    assert capsys.readouterr().out == "%s: %s; print at 100 %%, and check the ruler\n" % (path, told)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "nothing to print"),
        (["--robots", "3", "--family", "25h9"], "--family 25h9: known are"),
        (["--robots", "30", "--family", "16h5"], "tag 30: family 16h5 has 0 to 29"),
        (["--robots", "3", "--size", "48"], "--size 48: it must be from 5 to 45.9 mm"),
        (["--robots", "3", "--size", "nan"], "--size nan"),
        (["--robots", "0-9", "--references", "4-12"], "--references 4: that is a robot's tag"),
        (
            ["--references", "100", "--reference-size", "200"],
            "--reference-size 200: it must be from 5 to 124.0 mm",
        ),
        (
            ["--robots", "3", "--out", "/nowhere/tags.pdf"],
            "/nowhere/tags.pdf cannot be written: No such file",
        ),
    ],
)
def test_wrong_options_are_named(arguments, words):
    with pytest.raises(LocalizationError, match=words):
        print_tags.run(print_tags.parse_options(arguments))


def test_ids_must_be_named(capsys):
    with pytest.raises(SystemExit):
        print_tags.parse_options(["--robots", "all"])
    assert "name the ids" in capsys.readouterr().err
