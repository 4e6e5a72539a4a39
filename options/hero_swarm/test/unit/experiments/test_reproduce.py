"""Published experiments: what is read, run, judged and shown, and what happens when a file is changed or damaged."""

import math
from pathlib import Path

import numpy as np
import pytest

from hero_node.files import EntryError
from hero_swarm.experiments import reproduce, runner
from hero_swarm.experiments.computing.batch import load_checked
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.experiments.experiment_file import read_experiment
from hero_swarm.experiments.reporting.statistics import Interval
from hero_swarm.experiments.reproduce import NO_FIGURE, OPEN, OUTSIDE, WITHIN, Figure, Verdict, list_changes
from hero_swarm.experiments.results import load
from hero_test.nonempty import nonempty

FILE = """\
behavior: ahead.py
vary: {robots: [2, 3]}
start: {kind: circle, gap_m: 0.2}
errors: perfect
time_s: 2
seeds: {from: 7, count: 3}
metrics: [dispersion, cluster_fraction]
record: {hz: 1}
"""
FIGURES = """\
ahead:
  sentence: Robots drive ahead
  source: none
  differs: they have wheels
  minutes: 0.1
  figures:
    - {name: before, metric: dispersion, at_s: 0, cells: {robots: 2}, published: 0.274}
    - {name: after, metric: dispersion, cells: {robots: 2}, published: [5, 6]}
    - {name: cluster, metric: cluster_fraction, published: null}
    - {name: none, metric: cluster_fraction, cells: {robots: 3}, published: [0, 1]}
"""


@pytest.fixture(name="shipped")
def ship(tmp_path, monkeypatch, ahead):
    """Give the folder of published experiments, with one; the user's folder is the working one."""
    folder = tmp_path / "published"
    folder.mkdir()
    for name, text in (("ahead.py", ahead), ("ahead.yaml", FILE), ("published.yaml", FIGURES)):
        (folder / name).write_text(text)
    monkeypatch.setattr(reproduce, "SHIPPED", folder)
    monkeypatch.chdir(str(tmp_path))
    return folder


def run(capsys, *options):
    """Run the program, and return what it prints, and says of progress."""
    reproduce.main(["ahead", "--jobs", "1", *options])
    return capsys.readouterr()


@pytest.mark.parametrize(
    ("interval", "published", "word"),
    [
        (Interval(3.0, 1.0, 9.0), (3.0, 4.0), WITHIN),
        (Interval(2.0, 1.0, 3.0), (3.0, 4.0), OPEN),
        (Interval(2.0, 1.0, 2.9), (3.0, 4.0), OUTSIDE),
        (Interval(5.0, 4.1, math.inf), (3.0, 4.0), OUTSIDE),
        (Interval(math.inf, 4.0, math.inf), (3.0, 4.0), OPEN),
        (Interval(2.0, 1.0, 3.0), None, NO_FIGURE),
    ],
)
def test_a_median_is_within_or_its_interval_leaves_it_open_or_not(interval, published, word):
    figure = Figure("cluster", "cluster_fraction", None, {}, "", published)
    assert Verdict(figure, "all", 9, interval).word == word


def read_rows(text):
    """Return the cells of the rows of a table in Markdown, without its head."""
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]
    return rows[2:]


def test_each_figure_is_shown_with_ours_its_runs_and_the_verdict(shipped, capsys):
    text = run(capsys, "--quick").out
    rows = read_rows(text)
    assert rows[0] == ["before", "robots 2", "0.274", "0.2737 (0.2737 to 0.2737)", "2", WITHIN]
    assert rows[1][:3] == ["after", "robots 2", "[5, 6]"] and rows[1][-1] == OUTSIDE
    assert [row[1:3] + row[-1:] for row in rows[2:4]] == [[f"robots {n}", "none", NO_FIGURE] for n in (2, 3)]
    assert rows[4][:3] == ["none", "robots 3", "[0, 1]"] and len(rows) == 5
    assert text.startswith("Robots drive ahead. Published: none.")
    assert text.endswith("May differ: they have wheels.\n"), "nothing was changed"


@pytest.mark.slow
def test_an_interrupted_run_goes_on_with_the_seeds_of_its_file(shipped, capsys):
    assert "2 runs in" in run(capsys, "--seeds", "1").err
    assert "4 runs in" in run(capsys).err
    again = run(capsys)
    assert "runs in" not in again.err and {row[-2] for row in read_rows(again.out)} == {"3"}
    assert load("reproduction/ahead").seeds.tolist() == [7, 8, 9]


@pytest.mark.slow
def test_what_was_changed_by_hand_is_shown_beside_the_verdict(shipped, capsys, ahead):
    run(capsys, "--quick")
    own = Path("reproduction")
    (own / "ahead.yaml").write_text(FILE.replace("time_s: 2", "time_s: 1") + "errors.friction: 0.1\n")
    (own / "ahead.py").write_text(ahead.replace("0.1, 0.0", "0.2, 0.0"))
    assert list_changes("elsewhere/ahead.yaml") == [], "without files there is nothing to compare"
    with pytest.raises(ExperimentError, match="--fresh"):
        run(capsys, "--quick")
    lines = run(capsys, "--quick", "--fresh").out.splitlines()
    assert [line for line in lines if line.startswith("Changed")] == [
        "Changed: `ahead.py: -         return 0.1, 0.0, memory`",
        "Changed: `ahead.py: +         return 0.2, 0.0, memory`",
        "Changed: `ahead.yaml: - time_s: 2`",
        "Changed: `ahead.yaml: + time_s: 1`",
        "Changed: `ahead.yaml: + errors.friction: 0.1`",
    ]
    assert (shipped / "ahead.yaml").read_text() == FILE


@pytest.mark.slow
def test_a_file_that_is_deleted_is_the_published_one_again(shipped, capsys, ahead):
    run(capsys, "--quick")
    (shipped / "ahead.py").write_text(ahead.replace("0.1, 0.0", "0.2, 0.0"))  # a newer version of the suite
    assert run(capsys, "--quick").out.count("Changed: `ahead.py: ") == 2
    Path("reproduction/ahead.py").unlink()
    assert "Changed" not in run(capsys, "--quick", "--fresh").out


def test_a_name_or_a_file_that_is_wrong_is_told_with_a_remedy(shipped, capsys):
    with pytest.raises(ExperimentError, match="'gauci' is no published experiment; there are ahead"):
        reproduce.main(["gauci"])
    Path("reproduction").mkdir()
    Path("reproduction/ahead.yaml").write_text("behavior: [")
    with pytest.raises(ExperimentError, match=r"ahead.yaml, line 1.*; delete reproduction/ahead.yaml to have"):
        run(capsys)
    Path("reproduction/ahead.yaml").unlink()
    (shipped / "published.yaml").write_text(FIGURES.replace("[5, 6]", "[5]"))
    with pytest.raises(EntryError, match=r"published.yaml, line 8: .*published is a list, but must be a number, \[low"):
        run(capsys)


@pytest.mark.slow
def test_the_page_has_the_table_and_a_picture_of_each_experiment(shipped, capsys, tmp_path):
    for name in ("early", "other"):
        (shipped / f"{name}.yaml").write_text(FILE)
        (shipped / "published.yaml").open("a").write(FIGURES.replace("ahead:", f"{name}:"))
    table = read_rows(run(capsys, "--quick").out)
    with runner.open_folder(runner.parse_options(["reproduction/early.yaml"])):
        pass  # ended before its first run
    (tmp_path / "docs").mkdir()
    reproduce.main(["--page", "docs/reproduction.md"])
    page = (tmp_path / "docs" / "reproduction.md").read_text()
    assert read_rows(page) == table and page.count("## ") == 1 and "## Ahead\n" in page
    assert "![Every run of each cell](pictures/reproduction_ahead.png)" in page
    assert (tmp_path / "docs" / "pictures" / "reproduction_ahead.png").read_bytes()[:4] == b"\x89PNG"


def test_without_a_name_the_experiments_are_listed_and_nothing_is_run(shipped, capsys):
    reproduce.main([])
    assert capsys.readouterr().out.split() == "ahead Robots drive ahead (0.1 min of CPU)".split()
    assert not Path("reproduction").exists()


@pytest.mark.slow
def test_run_computes_the_first_seeds_only(shipped, capsys):
    reproduce.copy_files(".")
    runner.run_experiment(runner.parse_options(["ahead.yaml", "--seeds", "2", "--jobs", "1"]))
    assert np.isfinite(load("ahead").metrics["dispersion"]).tolist() == [[True, True, False]] * 2


@pytest.mark.parametrize("name", list(reproduce.read_publications()))
def test_every_figure_that_ships_finds_its_cells_and_its_metric(name):
    publication = reproduce.read_publications()[name]
    _, experiment = read_experiment(str(reproduce.SHIPPED / f"{name}.yaml"))
    columns, sampled = ({metric.name for metric in experiment.metrics}, {m.source for m in experiment.metrics})
    sampled = {source.rpartition(":")[2] for source in sampled}
    assert len(experiment.seeds) >= 30 and experiment.record_hz
    for figure in nonempty(publication.figures):
        assert figure.metric in (columns if figure.at_s is None else sampled), figure
        assert any(figure.cells.items() <= cell.varied.items() for cell in experiment.cells), figure
    load_checked(experiment._replace(cells=experiment.cells[:1]))
