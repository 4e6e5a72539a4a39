"""Where tags are searched, what is mapped, and what images and tags measure, in figures: see kept_results."""

import math

import numpy as np
import pytest

from hero_test.checks.kept_results import check_figures

pytest.importorskip("cv2")

from hero_localization.mapping.occupancy_grid import OccupancyGrid
from hero_localization.simulated_camera.view import CameraOptions
from hero_localization.tracking import tag_template
from hero_localization.tracking.tag_pose import TagCorners, find_smallest_side, fit_squares
from hero_localization.tracking.tag_search import TagSearch, _list_tiles
from hero_localization.tracking.tracker import ImageQuality
from hero_node import Pose

SQUARE = np.array(((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)))


class Seen:
    """A detector of tags from some size on that are in the window, which counts and adds up windows."""

    def __init__(self, least_px):
        self.least_px, self.tags, self.sums = least_px, [], np.zeros(5)

    def detect(self, gray, origin=(0, 0)):
        self.sums += (1, *origin, *gray.shape)
        low, high = np.array(origin) + 2.0, np.array(origin) + gray.shape[::-1] - 2.0
        return [
            tag
            for tag in self.tags
            if tag.side_px >= self.least_px and (tag.corners >= low).all() and (tag.corners <= high).all()
        ]


WINDOWS = """
14 10 2352 2996 568 568 5 1916 321 767 968 0 0 0 0 0
14 10 1840 3740 598 600 5 2395 414 207 210 0 0 0 0 0
14 10 1940 3870 598 600 5 2395 426 208 210 0 0 0 0 0
14 18 4524 7835 1119 1160 8 3016 1425 733 846 0 0 0 0 0
14 20 5214 8696 1296 1348 5 2388 443 223 224 0 0 0 0 0
14 20 5345 8519 1248 1300 6 2795 464 603 610 0 0 0 0 0
14 20 5445 8275 1250 1300 5 2395 476 208 210 2 621 970 130 140
14 20 5545 8038 1248 1300 5 2395 489 207 210 0 0 0 0 0
6 33 8973 13153 2393 2444 25 7318 8590 2062 2260 18 4688 7404 1424 1424
6 35 9315 13616 3109 3160 13 4377 3704 1043 1046 4 996 1600 408 408
6 35 9197 13425 3546 3596 11 3954 3019 862 874 4 954 1558 492 492
6 38 10711 13878 3722 3774 10 3733 2381 1031 1134 4 938 1542 524 524
6 35 9375 13712 3588 3640 5 2395 551 208 210 4 938 1542 524 524
6 35 9475 13908 3588 3640 9 3333 2106 731 734 0 0 0 0 0
14 23 6945 9217 1930 2080 5 2395 576 208 210 2 621 932 130 140
14 23 8081 8886 1383 1434 3 1436 366 133 134 5 2427 621 143 146
14 20 6745 8474 1249 1300 0 0 0 0 0 5 2435 641 128 130
14 21 7245 8324 1646 1700 2 621 913 130 140 5 2435 654 127 130
14 20 6914 8089 1298 1348 0 0 0 0 0 5 2431 660 138 138
14 20 7045 7853 1249 1300 0 0 0 0 0 5 2435 679 127 130
14 21 7145 7936 1549 1796 0 0 0 0 0 5 2435 691 128 130
26 22 7681 6890 1174 1224 7 3395 973 224 222 15 7538 3670 507 518
18 48 17508 13683 2874 2914 38 14676 10305 2427 2416 39 16178 11448 2200 2192
26 39 15063 9864 2584 2724 12 4658 2374 1334 1336 9 5082 2363 350 348
26 35 13930 8518 2030 2070 6 2286 1087 511 518 9 5068 2324 378 376
26 35 14030 8740 2030 2070 1 371 24 259 258 9 5068 2299 378 376
26 35 14130 8946 2030 2070 5 1898 514 614 712 9 5068 2274 378 376
26 32 12811 8707 1860 1902 1 479 134 48 48 5 3170 1735 160 160
26 20 7235 7230 1180 1230 0 0 0 0 0 6 3170 2242 228 238
26 20 7335 7161 1180 1230 1 400 0 396 400 5 3170 1685 160 160
"""


def test_tags_are_searched_in_the_same_windows():
    """A tag that drives, one that is small, one that is covered and moved by hand, and one only expected."""
    detectors, rows = [Seen(24.0), Seen(12.0), Seen(6.0)], []
    search = TagSearch(detectors[0], 800, 600, detectors[1:], 20.0)
    gray, stamp_s = np.broadcast_to(np.uint8(0), (600, 800)), 5.0
    for frame in range(150):
        stamp_s += 0.12 if frame in (20, 90) else 0.033
        places = {1: (100.0 + 4.0 * frame, 300.0 + 90.0 * math.sin(0.1 * frame), 30.0)}
        if frame < 108:
            places[2] = (500.0, 100.0 + 0.5 * frame, 18.0 if frame < 75 else 10.0)
        if not 40 <= frame < 70 and not 110 <= frame < 116:
            places[3] = (300.0 + 60.0 * (frame >= 70), 450.0, 26.0)
        if frame > 100:
            places[4] = (650.0, 500.0 - frame, 13.0)
        for detector in detectors:
            detector.tags = [TagCorners(key, side / 2.0 * SQUARE + (u, v)) for key, (u, v, side) in places.items()]
        expected = {4: (652.0, 501.0 - frame, 13.0), 3: (300.0, 452.0, 26.0), 7: (20.0, 590.0, 26.0)}
        expected[2] = (503.0, 158.0, 10.0)
        found = search.search(gray, stamp_s, expected if frame > 15 else None)
        if frame % 5 == 4:
            rows.append(
                (sum(2**tag.tag_id for tag in found), *np.concatenate([detector.sums for detector in detectors]))
            )
            for detector in detectors:
                detector.sums[:] = 0.0
    check_figures(rows, WINDOWS, 0)


LOG_ODDS = """
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 -0.70 -0.69 -0.43 0.63 0.13 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.02 0.31 0.07 0.00 0.00 -0.70 -0.69 -0.47 0.43 0.07 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.31 1.34 -0.63 0.00 0.00 -0.70 -0.70 -1.40 -0.70 -0.70 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.07 -0.63 -0.70 -0.70 0.00 0.00 -0.70 -0.70 -0.70 -0.64 0.39 0.06
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 -0.70 -0.70 -0.70 0.00 -0.70 0.00 -0.70 -0.38 1.36 0.11
0.00 0.00 0.00 0.01 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 -0.70 -0.70 0.00 -0.70 0.00 -0.70 -0.70 -0.69 -0.70
0.00 -0.68 0.18 0.26 0.05 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.06 0.00 0.00 0.00 -0.70 -0.70 -0.70 -0.70 0.00 -0.70 -2.10
-1.40 -0.63 0.34 0.22 0.02 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 1.79 -0.46 -0.70 -0.70 -0.70 -4.69 -0.30 -1.27 -0.70 -1.40 -1.40
-1.40 -0.69 -0.68 -0.69 -0.70 0.00 0.00 0.00 0.00 0.00 0.01 0.01 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.06 0.00 0.00 0.00 -0.69 -1.40 -1.35 -2.51 -5.36 0.00 -2.10
-1.62 -0.67 -0.70 -0.70 -0.70 -0.70 0.00 0.00 0.00 -0.70 0.06 0.19 0.02 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.28 0.24 -1.17 -0.60 -4.86 -6.03 -2.10 -0.70
-0.70 -0.70 0.43 -0.70 -0.70 -0.70 0.00 -0.70 -0.70 -0.70 0.09 0.48 0.07 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 -0.70 -1.40 -1.31 -1.18 -2.79 -2.66 -6.08
-1.40 -1.40 0.33 2.50 -0.70 -1.40 -0.70 -0.70 -0.70 -1.40 -0.68 0.21 0.05 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 -0.70 -2.10 -1.39 -0.69 -1.26 0.86 -1.35
-2.10 -5.40 -4.00 -1.39 -1.40 -1.40 -0.70 -0.70 -1.40 -1.40 -1.40 0.02 0.40 0.05 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 -0.70 -2.07 -2.07 -1.40 -0.70 -2.08 -1.35 -1.40
-1.40 -5.40 -5.40 -1.40 0.00 -0.70 -0.70 -0.70 -0.70 -0.70 -1.40 -0.69 1.24 0.49 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 -0.70 -0.70 -1.10 -0.93 -1.39 -2.10 -2.10 -0.70 -0.70
-0.70 -0.70 -1.40 0.01 -3.89 0.00 -0.70 0.00 0.00 -0.70 -0.70 -0.70 0.05 0.07 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.01 0.04 -0.68 -0.70 -1.16 0.01 -2.07 -2.10 -1.38 -0.58 -1.37
-1.06 -0.70 -1.40 0.00 0.27 -0.69 -4.70 -4.70 -1.40 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.01 0.28 0.37 -0.66 -0.38 1.20 -0.26 -1.39 -0.60 1.83 -1.16
-0.21 0.01 -0.70 2.06 0.00 -1.40 -4.00 -4.70 -1.40 -1.40 -0.70 -0.70 -0.70 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.07 0.30 0.07 0.04 0.50 1.42 0.11 0.01 0.99 1.21
-1.39 -0.70 -1.40 -1.40 -0.70 -0.70 -0.70 -0.70 -0.70 -1.40 -1.40 -1.40 -1.40 -0.70 -0.70 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.01 0.01 0.00 0.01 0.11 0.03 0.00 0.10 0.77
-0.66 -0.70 -1.38 -0.34 0.13 -0.45 -0.02 0.00 -0.70 0.00 -0.70 -1.40 -1.40 -0.70 -0.70 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.05 0.93
0.20 -0.70 0.15 1.40 0.25 -0.45 0.23 0.00 -0.70 -0.70 0.00 -0.70 -0.70 -0.70 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.13
0.08 0.00 0.00 0.01 0.22 -0.55 0.00 0.00 -0.70 -0.70 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.61 1.11 0.01 0.00 -0.70 -0.70 -0.70 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00 0.00
"""
FOUND = """
18 211 103 286.2 6316 -0.100 -0.050 0.200 0.130 0.120 -0.030
"""


def test_a_map_of_some_scans_is_as_it_was():
    grid = OccupancyGrid((-0.31, -0.2, 0.33, 0.3), 0.02)
    for index in range(6):
        pose = Pose(-0.1 + 0.05 * index, 0.03 * index - 0.05, 0.7 * index)
        ranges_m = [0.06 + 0.017 * ((index + 3 * beam) % 10) for beam in range(8)]
        ranges_m[index], ranges_m[7 - index], ranges_m[(index + 3) % 8] = math.inf, math.nan, 0.0
        others_m = np.array(((pose.x_m + 0.13, pose.y_m + 0.04), (0.3, -0.1)))[: index % 3]
        for _ in range(2):
            grid.add_scan(pose, ranges_m, others_m)
    assert grid.log_odds.shape == (25, 32)
    check_figures(grid.log_odds.reshape(50, 16), LOG_ODDS, 2)
    counts = grid.occupied.sum(), grid.free.sum(), grid.frontiers.sum(), 1e3 * grid.known_share
    percent = grid.to_percent().astype(float)
    check_figures([(*counts, percent.sum(), *grid.find_frontiers()[:3].ravel())], FOUND, (0, 0, 0, 1, 0, *[3] * 6))


QUALITIES = """
123.58 6.29 8.01
123.58 6.29 6.93
123.58 6.29 nan
"""


def test_shade_noise_and_blur_of_an_image_are_as_they_were():
    v, u = np.mgrid[:220, :300].astype(float)
    image = (
        110.0 + 40.0 * np.sin(0.031 * u + 0.017 * v) + 7.0 * np.sin(12.7 * u * v) + 25.0 * (u % 16 < 1) * (v % 16 < 1)
    )
    tags = []
    for index in range(9):
        place, width_px = np.array((40.0 + 30.0 * index, 60.0 + 14.0 * index)), 0.6 + 0.15 * index
        steep = np.tanh((12.0 - np.abs(u - place[0])) / width_px) + np.tanh((12.0 - np.abs(v - place[1])) / width_px)
        image -= 25.0 * (steep + 2.0) * (np.hypot(u - place[0], v - place[1]) < 20.0)
        tags.append(TagCorners(index, (11.0 + 0.4 * index) * SQUARE + place))
    rows, gray = [], np.clip(image, 0, 255).astype(np.uint8)
    for count in (9, 3, 2):
        quality = ImageQuality()
        quality.measure(gray, tags[9 - count :])
        quality.measure(gray[:100], [])
        rows.append((quality._shade, quality._noise, 10.0 * quality._blur_px))
    check_figures(rows, QUALITIES, 2)


SIDES = """
-1.11054 -0.09436 1.59108 0.027515 7.0398 48.7478 150.0826 -0.0476 18.3597 13.6107
-0.58163 -0.19808 1.61905 0.033881 7.3190 43.4736 449.9458 199.8700 22.4168 18.5697
-0.04726 -0.30237 1.64397 0.040694 8.0993 40.2912 750.3271 399.8116 26.2496 23.7648
0.51084 -0.41087 1.65362 0.048965 9.2555 38.1298 1050.0032 600.0076 29.9792 29.2135
1.11744 -0.52849 1.66331 0.060736 10.6667 36.3542 1350.5698 799.6718 34.3297 34.9345
"""


def test_poses_and_sizes_of_tags_seen_aslant_are_as_they_were():
    camera, rows = CameraOptions(tilt_rad=(0.2, -0.1, 0.4)).geometry, []
    for index in range(5):
        place = np.array((300.0 * index + 150.0, 200.0 * index))
        corners = (9.0 + 2.0 * index) * SQUARE @ np.array(((0.9, 0.3), (-0.35, 1.02))) + place
        corners[index % 4] += (0.3 * index, -0.5)
        tag = TagCorners(index, corners)
        (fit,) = fit_squares(camera, [tag], 0.02 * index, 0.0002 * index)
        sds = 1e4 * fit.position_sd_m, 1e4 * fit.yaw_sd_rad
        smallest_px = find_smallest_side(camera, 0.03 + 0.01 * index, 0.05 * index)
        rows.append((*fit.pose, fit.size_m, *sds, *tag.center, tag.side_px, smallest_px))
    check_figures(rows, SIDES, (5, 5, 5, 6, 4, 4, 4, 4, 4, 4))


def test_samples_of_a_print_lie_in_its_cells_row_by_row():
    for samples in (1, 2):
        places = tag_template._list_places(samples).reshape(10 * samples, 10 * samples, 2)
        axis = (np.arange(10 * samples) + 0.5) / samples - 5.0
        np.testing.assert_array_equal(places[0, :, 0], axis)
        np.testing.assert_array_equal(places[:, 3, 1], axis)
        assert (places[4] == places[4, :1] * (0, 1) + places[0] * (1, 0)).all()


def test_tiles_of_a_large_image_are_whole_pixels_and_overlap_more():
    tiles = _list_tiles(3840, 2160)
    assert len(tiles) == 48 and tiles[0] == (0, 0, 710, 590) and tiles[-1] == (3360, 1800, 3840, 2160)
    assert all(type(edge) is int for tile in tiles for edge in tile)
    assert _list_tiles(1920, 1080)[0] == (0, 0, 576, 456)
