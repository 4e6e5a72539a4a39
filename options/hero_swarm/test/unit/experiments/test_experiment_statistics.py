"""Intervals and comparisons: their coverage, ties, infinities, and values that can be computed by hand."""

import math

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex

from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.experiments.experiment_file import NO_START, Cell
from hero_swarm.experiments.reporting import statistics
from hero_swarm.experiments.reporting.figures import _spans_a_map, draw_map, draw_over_time, draw_runs
from hero_swarm.experiments.reporting.statistics import Interval
from hero_swarm.experiments.reporting.summary import Summary
from hero_test.nonempty import nonempty


def test_equal_values_give_equal_bounds():
    assert statistics.bootstrap_median([0.3] * 30) == (0.3, 0.3, 0.3)


def test_values_that_are_nearly_all_equal_have_finite_bounds():
    interval = statistics.bootstrap_median([1.0] * 28 + [0.9, 0.2])
    assert interval == (1.0, 1.0, 1.0)


def test_runs_that_never_reached_a_bound_count_as_infinite():
    interval = statistics.bootstrap_median([10.0, 12.0, 14.0, math.inf, math.inf])
    assert interval.median == 14.0 and interval.low == 10.0 and interval.high == math.inf


def test_the_median_of_an_even_number_lies_between_the_middle_two():
    assert statistics.bootstrap_median([4.0, 1.0, 3.0, 2.0]).median == 2.5


@pytest.mark.parametrize("values", [[], [1.0, math.nan]])
def test_no_value_and_nan_are_refused(values):
    with pytest.raises(ExperimentError, match="no median"):
        statistics.bootstrap_median(values)


@pytest.mark.slow
@pytest.mark.parametrize(("draw", "median"), [("standard_normal", 0.0), ("standard_exponential", math.log(2.0))])
def test_intervals_cover_the_true_median_as_often_as_they_claim(draw, median):
    rng = np.random.RandomState(5)
    covered = 0
    for _ in range(100):
        interval = statistics.bootstrap_median(getattr(rng, draw)(30))
        covered += interval.low <= median <= interval.high
    # Of 100 intervals with a coverage of 0.95, 87 to 99 cover in all but one of 100 samples.
    assert 87 <= covered <= 99


def test_the_report_of_the_same_runs_is_the_same():
    values = np.random.RandomState(1).standard_normal(40)
    assert statistics.bootstrap_median(values) == statistics.bootstrap_median(values[::-1])


@pytest.mark.parametrize(
    ("first", "second", "delta"),
    [([1, 2, 3], [4, 5, 6], 1.0), ([4, 5], [1, 2], -1.0), ([1, 2], [1, 2], 0.0), ([1, 1], [1, 2], 0.5)],
)
def test_cliffs_delta_counts_larger_minus_smaller(first, second, delta):
    assert statistics.cliffs_delta(first, second) == delta


def test_pairs_without_a_difference_have_p_one():
    comparison = statistics.compare_pairs([1.0, 2.0], [1.0, 2.0])
    assert comparison.p_value == 1.0 and comparison.difference == (0.0, 0.0, 0.0)


def test_the_signed_rank_test_agrees_with_its_exact_distribution():
    # All of six differences positive: 2 of the 2**6 signs are as extreme.
    second = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    comparison = statistics.compare_pairs([0.0] * 6, second)
    # scipy before 1.5 approximates it by a normal distribution.
    assert comparison.p_value == pytest.approx(2.0 / 64.0, rel=0.12)
    assert comparison.difference.median == 3.5 and comparison.delta == 1.0


def test_the_sign_of_a_difference_is_second_minus_first():
    assert statistics.compare_pairs([3.0, 4.0], [1.0, 2.0]).difference.median == -2.0


def test_samples_with_an_infinite_value_are_not_compared():
    with pytest.raises(ExperimentError, match="not finite"):
        statistics.compare_pairs([1.0, math.inf], [1.0, 2.0])


def test_holm_corrects_each_p_by_its_rank_and_never_below_a_smaller_one():
    assert statistics.correct_by_holm([0.04, 0.01, 0.03]) == pytest.approx((0.06, 0.03, 0.06))
    assert statistics.correct_by_holm([0.9, 0.8]) == (1.0, 1.0)


def test_runs_are_drawn_beside_their_interval_or_counted_as_not_reached():
    values = [(1.0, 3.0, 2.0), (2.0, math.inf, 4.0), (math.inf, math.inf)]
    intervals = [Interval(2.0, 1.0, 3.0), Interval(4.0, 2.0, math.inf), Interval(math.inf, math.inf, math.inf)]
    (axes,) = draw_runs("s", ["a", "b", "c"], values, intervals).axes
    lines = {".": [], "|": [], "o": []}
    for line in axes.lines:
        lines[line.get_marker()].append(line.get_xydata().tolist())
    assert lines["."] == [
        [pytest.approx(point) for point in points]
        for points in ([(1.0, 0.12), (3.0, 0.18), (2.0, 0.24)], [(2.0, 1.12), (4.0, 1.24)], [])
    ]
    assert lines["|"] == [[[1.0, 0.0], [3.0, 0.0]], [[2.0, 1.0], [4.0, 1.0]], [[0.0, 2.0], [0.0, 2.0]]]
    assert lines["o"] == [[[2.0, 0.0]], [[4.0, 1.0]]], "an infinite median is not drawn"
    assert [(text.get_text(), text.xy) for text in axes.texts] == [
        ("not reached in 1 of 3", (1.0, 0.75)),
        ("not reached in 2 of 2", (1.0, 1.75)),
    ]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["a", "b", "c"]
    assert axes.get_ylim() == (2.6, -0.6) and axes.get_yticks().tolist() == [0, 1, 2] and axes.get_xlabel() == "s"
    of_rows = [{to_hex(line.get_color()) for line in axes.lines if row in line.get_ydata() // 1} for row in (0, 1)]
    assert len(of_rows[0]) == len(of_rows[1]) == 1 and of_rows[0] != of_rows[1]


def test_medians_over_time_lie_in_the_middle_half_up_to_the_last_run():
    times_s, ended = np.arange(4.0), math.nan
    first = np.array([(1.0, 2.0, 3.0, 4.0, 5.0), (2.0, 4.0, 6.0, 8.0, 10.0), (1.0, 1.0, 1.0, 3.0, ended), (ended,) * 5])
    (axes,) = draw_over_time("order (m)", ["a", "b"], times_s, [first, np.full((4, 2), 0.5)]).axes
    assert [line.get_xydata().tolist() for line in axes.lines] == [
        [[0.0, 3.0], [1.0, 6.0], [2.0, 1.0]],
        [[0.0, 0.5], [1.0, 0.5], [2.0, 0.5], [3.0, 0.5]],
    ]
    middle_half = {tuple(point) for point in axes.collections[0].get_paths()[0].vertices.tolist()}
    assert {(0.0, 2.0), (0.0, 4.0), (1.0, 4.0), (1.0, 8.0), (2.0, 1.0), (2.0, 1.5)} == middle_half
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_ylim()[0]) == ("time (s)", "order (m)", 0.0)
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["a", "b"]
    (below,) = draw_over_time("order", ["a"], times_s, [first - 5.0]).axes
    assert below.get_ylabel() == "order" and below.get_ylim()[0] < -4.0


def summarize(medians):
    """Return summaries of cells by the numbers that vary: {(robots, gain): median}."""
    return [
        Summary(Cell({"robots": robots, "gain": gain}, {}, {}, "a", NO_START), (), Interval(median, 0.0, 9.0))
        for (robots, gain), median in medians.items()
    ]


def test_medians_of_two_numbers_are_a_map_that_can_be_read():
    medians = {(20, 1.5): 4.0, (5, 0.25): 1.0, (5, 1.5): 2.0, (20, 0.25): math.inf, (5, 1.0): 2.5, (20, 1.0): 2.4375}
    axes, bar = draw_map("time (s)", summarize(medians)).axes
    assert _spans_a_map(summarize(medians))
    (image,) = axes.images
    shown = np.ma.filled(image.get_array(), math.inf).tolist()
    assert shown == [[1.0, 2.5, 2.0], [math.inf, 2.4375, 4.0]], "rows upwards, what was not reached is bare"
    assert image.origin == "lower" and image.cmap.name == "cividis"
    texts = {(text.get_text(), text.get_position(), text.get_color()) for text in axes.texts}
    assert texts == {
        ("1", (0, 0), "white"), ("2.5", (1, 0), "black"), ("2", (2, 0), "white"),
        ("inf", (0, 1), "black"), ("2.44", (1, 1), "white"), ("4", (2, 1), "black"),
    }, "light on dark"  # fmt: skip
    ticks = [[label.get_text() for label in axis.get_ticklabels()] for axis in (axes.xaxis, axes.yaxis)]
    assert ticks == [["0.25", "1", "1.5"], ["5", "20"]]
    assert (axes.get_xlabel(), axes.get_ylabel(), bar.get_ylabel()) == ("gain", "robots", "median time (s)")
    never = draw_map("s", summarize({(5, 1): math.inf, (5, 2): math.inf, (9, 1): math.inf, (9, 2): math.inf}))
    assert {text.get_color() for text in never.axes[0].texts} == {"black"}


def test_a_map_needs_two_numbers_and_runs_of_all_their_combinations():
    whole = {(robots, gain): 1.0 for robots in (5, 20) for gain in (1.0, 2.0)}
    assert _spans_a_map(summarize(whole)) and not _spans_a_map(summarize(whole)[1:])
    assert not _spans_a_map(summarize({(5, 1.0): 1.0, (5, 2.0): 1.0}))
    assert not _spans_a_map(summarize({(5, "a"): 1.0, (9, "a"): 1.0, (5, "b"): 1.0, (9, "b"): 1.0}))
    one = [summary._replace(cell=summary.cell._replace(varied={"gain": 1.0})) for summary in summarize(whole)]
    assert not _spans_a_map(one)


def test_no_label_of_a_figure_is_cut_off():
    labels = ["speed_m_s 0.02, robots 100, behavior my_own_aggregation"] * 2
    figure = draw_runs("dispersion_ratio", labels, [(1.0, 2.0)] * 2, [Interval(1.5, 1.0, 2.0)] * 2)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    (axes,) = figure.axes
    for label in (*nonempty(axes.get_yticklabels()), axes.xaxis.label):
        box = label.get_window_extent(canvas.get_renderer())
        assert box.x0 >= 0.0 and box.y0 >= 0.0, label
