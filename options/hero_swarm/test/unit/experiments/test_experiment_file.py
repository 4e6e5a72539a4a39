"""The file of an experiment: cells, seeds and metrics, and errors that name the line."""

import pytest

from hero_node.files.yaml_text import MAX_CHARACTERS
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.experiments.experiment_file import Bound, Start, parse_experiment, read_experiment

FILE = """\
behavior: aggregation
vary: {robots: [10, 25], errors: [perfect, default]}
start: {kind: uniform, cover: 0.02, gap_m: 0.0}
time_s: 300
seeds: {from: 1, count: 30}
metrics: [cluster_fraction, {time_until: {dispersion: 1.15}}]
record: {hz: 1}
compare: {metric: cluster_fraction, between: errors, test: wilcoxon}
"""


def parse(text):
    return parse_experiment(text, "e.yaml")


def test_every_combination_of_what_varies_is_a_cell():
    experiment = parse(FILE)
    assert [tuple(cell.varied.values()) for cell in experiment.cells] == [
        (10, "perfect"), (10, "default"), (25, "perfect"), (25, "default")
    ]  # fmt: skip
    assert experiment.cells[1].settings == {"robots": 10, "errors": "default"}


def test_all_parts_of_the_file_are_read():
    experiment = parse(FILE)
    assert experiment.cells[0].start == Start("uniform", 0.02, 0.0, None)
    assert list(experiment.seeds) == list(range(1, 31))
    assert experiment.time_s == 300.0 and experiment.record_hz == 1.0
    assert [metric.name for metric in experiment.metrics] == [
        "cluster_fraction",
        "time_until_dispersion_1.15_s",
    ]
    assert experiment.metrics[1].bound == Bound("dispersion", 1.15, True)
    assert tuple(experiment.compare) == ("cluster_fraction", "errors", "wilcoxon")


def test_parameters_of_the_behavior_can_vary():
    experiment = parse(FILE.replace("errors: [perfect, default]", "v0_m_s: [-0.1, -0.05]").replace("errors", "v0_m_s"))
    assert [cell.parameters for cell in experiment.cells] == [{"v0_m_s": -0.1}, {"v0_m_s": -0.05}] * 2


def test_many_mappings_beside_each_other_are_not_deep():
    means = ", ".join("{mean_of_last_s: {dispersion: %d}}" % last_s for last_s in range(1, 16))
    text = FILE.replace("[cluster_fraction, {time_until: {dispersion: 1.15}}]", "[cluster_fraction, %s]" % means)
    assert len(parse(text).metrics) == 16


def test_without_anything_that_varies_there_is_one_cell():
    experiment = parse("behavior: a.B\nrobots: 5\ntime_s: 1\nseeds: {count: 2}\nmetrics: [dispersion]\n")
    assert len(experiment.cells) == 1 and experiment.cells[0].label == "all"


def test_a_cell_is_described_by_everything_that_its_runs_depend_on():
    texts = [
        FILE,
        FILE.replace("10, 25", "11, 25"),
        FILE.replace("time_s: 300", "time_s: 301"),
        FILE.replace("cover: 0.02", "cover: 0.03"),
        FILE.replace("1.15", "1.2"),
        FILE.replace("time_s: 300", "time_s: 300\nuntil: {dispersion: 2}"),
        FILE.replace("behavior: aggregation", "behavior: milling"),
        FILE.replace("hz: 1", "hz: 2"),
    ]
    described = {parse(text).describe_cell(parse(text).cells[0]) for text in texts}
    assert len(described) == len(texts)
    # More seeds do not make earlier runs worthless.
    more = parse(FILE.replace("count: 30", "count: 60"))
    assert more.describe_cell(more.cells[0]) in described


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("time_s: 300", "time: 300", 4, "unknown 'time'; allowed are: behavior"),
        ("time_s: 300", "tme_s: 300", 4, "compare; did you mean time_s?; numbers of the behavior or its sensors"),
        ("time_s: 300", "near.range_m: 1", 4, "such as near.range_m, stand below parameters, or as lists below vary"),
        ("errors: [perfect, default]", "error: [perfect]", 2, "1e+06 as of a parameter; did you mean errors?"),
        ("kind: uniform", "kind: unifrom", 3, "file, arena; did you mean uniform?"),
        ("time_s: 300", "time_s: 300 s", 4, "time_s is '300 s', but must be a number from 0.1"),
        ("time_s: 300", "time_s: true", 4, "time_s is True"),
        ("time_s: 300", "time_s: .inf", 4, "time_s is inf"),
        ("time_s: 300\n", "", 1, "time_s is missing"),
        ("behavior: aggregation\n", "", 1, "behavior is missing: give behavior: milling, or vary it"),
        ("perfect, default", "perfect, 11", 2, "vary.errors is 11, but must be a number from 0 to 10 times"),
        (
            "errors: [perfect, default]",
            "errors.lag_s: [0.1, 9]",
            2,
            "errors.lag_s is 9, but must be a number",
        ),
        ("errors: [perfect, default]", "wifi: [ideal, slow]", 2, "slow"),
        ("errors: [perfect, default]", "behavior: [a]", 2, "behavior is given twice"),
        ("errors: [perfect, default]", "start: [{kind: grid}]", 2, "start is given twice"),
        ("10, 25", "10, 2.5", 2, "vary.robots is 2.5, but must be a whole number"),
        ("10, 25", "10, 10", 2, "holds 10 more than once"),
        ("[10, 25]", "10", 2, "vary.robots is 10, but must be a list"),
        ("cover: 0.02", "cover: 2 %", 3, "start.cover is '2 %'"),
        ("kind: uniform", "kind: heap", 3, "must be one of: uniform"),
        ("cover: 0.02, ", "", 3, "cover is missing in start"),
        ("kind: uniform", "kind: grid", 3, "start.cover does not go with kind: grid"),
        ("count: 30", "count: 0", 5, "seeds.count is 0"),
        ("count: 30", "count: 999999", 5, "at most 1000000 runs"),
        ("from: 1", "first: 1", 5, "unknown 'first' in seeds; allowed are: from, count"),
        ("[cluster_fraction", "[cluster", 6, "must be one of: algebraic_connectivity, cluster_fraction"),
        ("{dispersion: 1.15}", "{dispersion: near}", 6, "dispersion is 'near', but must be a number"),
        ("time_until:", "time_after:", 6, "unknown 'time_after'"),
        ("[cluster_fraction,", "[dispersion, dispersion,", 6, "more than once"),
        ("hz: 1", "hz: 100", 7, "record.hz is 100"),
        ("metric: cluster_fraction", "metric: dispersion", 8, "compare.metric is 'dispersion'"),
        ("between: errors", "between: wifi", 8, "must be one of: robots, errors"),
        ("vary: {robots: [10, 25], errors: [perfect, default]}", "robots: 5", 8, "needs something that varies"),
        ("time_s: 300", "time_s: 300\nrobots: 5", 2, "robots is given twice"),
        ("time_s: 300", "time_s: 300\ntime_s: 3", 5, "'time_s' appears twice"),
        ("time_s: 300", "time_s: [", 6, "not YAML"),
        ("time_s: 300", "time_s: &a 300", 4, "anchors cannot be used"),
        ("time_s: 300", "time_s: " + "[" * 30 + "]" * 30, 4, "more than 20 levels"),
    ],
)
def test_what_is_wrong_is_refused_with_its_line(old, new, line, words):
    assert old in FILE
    with pytest.raises(ExperimentError) as caught:
        parse(FILE.replace(old, new, 1))
    assert str(caught.value).startswith("e.yaml, line %d: " % line)
    assert words in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "3", "[1, 2]", "x" * (MAX_CHARACTERS + 1), "\0", "[" * 100_000])
def test_what_is_no_experiment_at_all_is_refused(text):
    with pytest.raises(ExperimentError, match=r"^e\.yaml") as caught:
        parse(text)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize(
    ("text", "bound"),
    [
        ("-2", Bound("dispersion", -2.0, True)),
        ('">= 1.5"', Bound("dispersion", 1.5, False)),
        ('"<= 1.5"', Bound("dispersion", 1.5, True)),
    ],
)
def test_a_bound_says_from_which_side_it_is_reached(text, bound):
    (metric,) = parse(FILE.replace("1.15", text)).metrics[1:]
    assert metric.bound == bound
    assert bound.holds(bound.value) and bound.holds(bound.value - 1.0) is bound.falls


@pytest.mark.parametrize("text", ['"< 1"', '"= 1"', '">= x"', '">= .inf"', '">= inf"', '"<= nan"', '">=1"'])
def test_a_bound_that_is_none_is_refused(text):
    with pytest.raises(ExperimentError, match='line 6: .* must be a number, or a text such as "<= 1.15"'):
        parse(FILE.replace("1.15", text))


@pytest.mark.parametrize(
    ("pattern", "low", "below", "high", "above"),
    [
        ("robots: 5", 1, 0, 1000, 1001),
        ("delay_s: 5", 0, -0.1, 10, 10.1),
        ("time_s: 5", 0.1, 0.09, 86400, 86401),
        ("parameters: {a: 5}", -1e6, -1000001, 1e6, 1000001),
        ("start: {kind: uniform, cover: 5}", 1e-4, 9e-5, 0.5, 0.51),
        ("start: {kind: grid, gap_m: 5}", 0, -0.1, 10, 10.1),
        ("seeds: {count: 5}", 1, 0, 1000000, 1000001),
        ("seeds: {count: 2, from: 5}", 0, -1, 2**31 - 1, 2**31),
        ("metrics: [{mean_of_last_s: {dispersion: 5}}]", 1, 0.9, 86400, 86401),
        ("record: {hz: 5}", 0.01, 0.009, 20, 21),
    ],
)
def test_numbers_are_taken_up_to_their_limits(pattern, low, below, high, above):
    rest = {
        "behavior": "behavior: a.B",
        "robots": "robots: 5",
        "time_s": "time_s: 9",
        "seeds": "seeds: {count: 1}",
        "metrics": "metrics: [dispersion]",
    }
    head, number, tail = pattern.rpartition("5")

    def parse_number(value):
        written = "%.8f" % value if isinstance(value, float) else str(value)
        lines = {**rest, pattern.partition(":")[0]: head + written + tail}
        return parse("\n".join(lines.values()) + "\n")

    assert parse_number(low) and parse_number(high)
    for wrong in (below, above):
        with pytest.raises(ExperimentError, match="must be a (whole )?number from"):
            parse_number(wrong)


def test_without_a_start_robots_begin_as_in_the_arena_and_seeds_at_1():
    experiment = parse("behavior: a.B\nrobots: 5\ntime_s: 1\nseeds: {count: 2}\nmetrics: [dispersion]\n")
    assert experiment.cells[0].start == Start("arena", 0.0, 0.0, None) and list(experiment.seeds) == [1, 2]
    assert (experiment.record_hz, experiment.until, experiment.compare) == (0.0, None, None)
    whole = parse("behavior: a.B\nrobots: 5\ntime_s: 1\nseeds: {count: 1000000}\nmetrics: [dispersion]\n")
    assert len(whole.seeds) == 1_000_000


def test_metrics_that_rise_are_reached_from_below():
    (metric,) = parse(FILE.replace("{dispersion: 1.15}", "{cluster_fraction: 0.9}")).metrics[1:]
    assert not metric.bound.falls


def test_a_mean_of_the_last_seconds_is_a_column():
    (metric,) = parse(FILE.replace("{time_until: {dispersion: 1.15}}", "{mean_of_last_s: {dispersion: 60}}")).metrics[
        1:
    ]
    assert (metric.name, metric.source, metric.last_s) == ("dispersion_mean_of_last_60_s", "dispersion", 60.0)


def test_too_many_cells_are_refused_before_any_is_made(monkeypatch):
    monkeypatch.setattr("hero_swarm.experiments.experiment_file.Cell", None)
    values = ", ".join(map(str, range(100)))
    vary = ", ".join("p%d: [%s]" % (number, values) for number in range(8))
    with pytest.raises(ExperimentError, match="at most 1000000 runs, not 300000000000000000"):
        parse(FILE.replace("robots: [10, 25], errors: [perfect, default]", "robots: [10], " + vary))


def test_an_experiment_that_cannot_be_read_is_one_line(tmp_path):
    (tmp_path / "e.yaml").mkdir()
    for name, words in (("e.yaml", "Is a directory"), ("none.yaml", "No such file or directory")):
        with pytest.raises(ExperimentError, match=f"{name} cannot be read: {words}$"):
            read_experiment(str(tmp_path / name))


VARYING = """\
vary:
  behavior: [milling, {gather.py: {gain: 2}}, {gather.py: {gain: 3}}]
  near.range_m: [0.5, 1]
  errors.slip: [0, 0.02]
  start: [{kind: grid}, {kind: uniform, cover: 0.02}]
  wifi: [ideal, bad]
  errors: [perfect, 0.5]
robots: 4
errors.lag_s: 0.1
parameters: {gain: 1}
time_s: 3
seeds: {count: 2}
metrics: [dispersion]
compare: {metric: dispersion, between: behavior}
"""


def test_behaviors_sensors_errors_starts_and_wifi_vary():
    experiment = parse(VARYING)
    assert len(experiment.cells) == 3 * 2**5
    first, last = experiment.cells[0], experiment.cells[-1]
    assert first.label == "behavior milling, near.range_m 0.5, errors.slip 0.0, start grid, wifi ideal, errors perfect"
    assert (first.behavior, first.parameters, first.own) == ("milling", {"gain": 1.0, "near.range_m": 0.5}, ())
    assert last.varied["behavior"] == "gather.py gain 3.0" and last.varied["start"] == "uniform cover 0.02"
    assert (last.behavior, last.parameters, last.own) == ("gather.py", {"gain": 3.0, "near.range_m": 1.0}, ("gain",))
    assert last.start == Start("uniform", 0.02, 0.0, None)
    assert last.settings == {"robots": 4, "errors.lag_s": 0.1, "errors.slip": 0.02, "wifi": "bad", "errors": 0.5}
    assert len({experiment.describe_cell(cell) for cell in experiment.cells}) == len(experiment.cells)
    assert experiment.behavior == "milling, gather.py"
    assert experiment.places["gain"] == "e.yaml, line 10" and experiment.places["near.range_m"] == "e.yaml, line 3"
