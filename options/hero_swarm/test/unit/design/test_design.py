"""Program design: from a mission to controllers, with what is computed kept, and wrong input named."""

import os
import pickle
import shutil
import signal
import zlib
from concurrent.futures import BrokenExecutor, Executor, Future
from pathlib import Path

import numpy as np
import pytest
import yaml

from hero_node import HeroError
from hero_swarm.behaviors import find_behavior
from hero_swarm.design import evaluation, program
from hero_swarm.design.kinds import Machines, Networks, Numbers
from hero_swarm.design.mission import read_mission
from hero_swarm.experiments import runner
from hero_swarm.experiments.computing.batch import load_checked
from hero_swarm.experiments.computing.cell_setup import set_up
from hero_swarm.experiments.computing.engines import Engine
from hero_swarm.experiments.errors import ExperimentError
from hero_test.nonempty import nonempty

MISSIONS = Path(__file__).resolve().parents[3] / "examples" / "missions"
MISSION = """\
robots: 2
arena: arena.yaml
time_s: 1
score: {mean_of_last_s: {score.py:right: 1}}
baseline: dispersion
"""
NAN_ALONE = "algebraic_connectivity"
SCORE = "def right(state):\n    return state.poses[..., 0].mean(axis=1)\n"
ARENA = "bounds_m: [-1, -1, 1, 1]\nlamps_m: [[0.9, 0]]\nareas:\n  - {name: spot, circle_m: [0, 0, 0.3], color: 0}\n"


@pytest.fixture(name="path")
def write_mission(tmp_path, monkeypatch):
    for name, text in (("m.yaml", MISSION), ("score.py", SCORE), ("arena.yaml", ARENA)):
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(str(tmp_path))
    monkeypatch.setattr(runner, "choose_engine", lambda options: Engine(InProcess, 2))
    return tmp_path / "m.yaml"


class InProcess(Executor):
    """Computes at once; ends as a killed program does after so many tasks."""

    left = 10**6

    @staticmethod
    def end():
        raise KeyboardInterrupt

    def submit(self, function, *arguments):
        future = Future()
        if InProcess.left == 0:
            InProcess.end()
        InProcess.left -= 1
        future.set_result(function(*pickle.loads(pickle.dumps(arguments))))
        return future


@pytest.fixture(name="light")
def score_without_simulation(monkeypatch):
    """Scores are a function of the first number and the seed; comparisons are not run."""

    def score(experiment, suite, kind, genomes, seeds):
        return [float(genome[0]) + (zlib.crc32(b"%d" % seed) % 100) / 50.0 for genome, seed in zip(genomes, seeds)]

    monkeypatch.setattr(evaluation, "score_runs", score)
    monkeypatch.setattr(program, "compare", lambda options, mission, folder, finalists: "\n".join(finalists))
    InProcess.left = 10**6


def read_all(folder):
    return {path.name: path.read_bytes() for path in sorted(Path(folder).iterdir()) if path.is_file()}


@pytest.mark.parametrize("name", ["black_spot", "foraging", "grid_exploration", "aggregation", "coverage", "sorting"])
def test_missions_that_come_with_it_are_scored_with_their_baseline(name):
    mission = read_mission(str(MISSIONS / (name + ".yaml")))
    load_checked(mission.experiment)
    Numbers(mission) if name in ("coverage", "sorting") else Machines(mission)
    assert mission.sign == 1.0 and "baseline" in mission.content
    assert find_behavior(mission.experiment.locate(mission.content["baseline"])) is not None


def measure(mission, poses, **changes):
    """Return the score of a mission with all robots resting at poses; changes: of its arena."""
    experiment = read_mission(str(MISSIONS / (mission + ".yaml"))).experiment
    trial = set_up(experiment, experiment.cells[0]).build_trial([1])
    function = evaluation.run_trial.__globals__["measure"]
    for place in poses:
        state = trial.state._replace(poses=np.full((1, 20, 3), place))
        state = state._replace(arena=state.arena._replace(**changes))
        values = function(experiment, state)[0]
    return values[0, 0]


@pytest.mark.slow
def test_scores_count_what_they_say():
    assert measure("black_spot", [(0.0, 0.6, 0.0)]) == 20.0 and measure("black_spot", [(0.0, 0.0, 0.0)]) == 0.0
    source, between, nest = (0.75, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, -0.9, 0.0)
    assert measure("foraging", [source, between, nest, between, nest, source]) == 20.0, "an item each, once"
    assert measure("foraging", [nest, source]) == 0.0
    assert measure("black_spot", [source], areas=()) == 0.0, "no area counts"
    assert measure("grid_exploration", [(0.0, 0.0, 0.0)]) == 0.0, "no cell is old at the start"
    assert measure("sorting", [(0.0, 0.0, 0.0)]) == 0.45, "all are near robot 0, which is near robot 1"
    apart = np.where(np.arange(20)[:, None] % 2, (0.5, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert measure("sorting", [apart]) == 1.0, "even and odd numbers are groups"


@pytest.mark.slow
def test_a_mission_becomes_controllers_that_are_compared(path, capsys, monkeypatch):
    chosen = []
    monkeypatch.setattr(program, "write_report", print)
    monkeypatch.setattr(runner, "choose_engine", lambda own: chosen.append(own) or Engine(InProcess, 2))
    options = ["m.yaml", "--budget", "200", "--tests", "2", "--jobs", "3", "--executor", "dask:tcp://127.0.0.1:1"]
    program.main(options)
    output = capsys.readouterr().out
    lines = output[output.index("right_mean_of_last_1_s    ") :].splitlines()
    assert lines[0].split()[1:] == ["simulated", "pseudo-reality", "loss", "%"]
    finalists = [f"m_chocolate/design_1_{n}.controller" for n in (1, 2)]
    assert {line.split()[0] for line in lines[1:4]} == {"dispersion", *finalists}
    assert len({Path(name).read_text() for name in finalists}) == 2, "equal ones count once"
    best = lines[4].split()[3].rstrip(";")
    assert find_behavior(best).arena == "m_chocolate/../arena.yaml" and os.path.isfile(best + ".dot")
    assert output.splitlines()[:2] == ["m_chocolate_simulated", "m_chocolate_pseudo_reality"], "reports are written"
    assert [(own.jobs, own.executor) for own in chosen] == [(3, "tcp://127.0.0.1:1")] * 3
    program.main(options)  # nothing is computed again
    assert "runs in" not in capsys.readouterr().err
    Path(best).write_text("states: [{name: rest, do: stop}]\n")
    Path("own.controller").write_text("states: [{name: rest, do: stop}]\n")
    content = {**read_mission("m.yaml").content, "baseline": "own.controller"}
    mission = read_mission("m.yaml")._replace(content=content)
    for text in ("states: [{name: rest, do: stop}]\n", "states: [{name: rest, do: phototaxis}]\n"):
        Path("own.controller").write_text(text)  # a baseline that was edited is run again, by itself
        program.compare(program.parse_options(options), mission, "m_chocolate", [best])
        assert "own.controller" in Path("m_chocolate_simulated/runs.csv").read_text()
    Path("robots.errors").write_text("friction=0\n")
    program.compare(program.parse_options([*options, "--errors", "robots.errors"]), mission, "m_chocolate", [best])
    text = Path("m_chocolate_pseudo_reality.yaml").read_text()
    assert "errors: robots.errors" in text and "wifi: router" in text and "world" not in text


@pytest.mark.slow
def test_a_killed_design_goes_on_to_the_same_bytes(path, light, capsys):
    options = ["m.yaml", "--budget", "500", "--designs", "2"]
    program.main(options)
    whole = read_all("m_chocolate")
    program.main([*options, "--fresh"])
    assert read_all("m_chocolate") == whole
    for tasks in (1, 3, 4):
        for name in whole:
            os.remove(os.path.join("m_chocolate", name))
        InProcess.left = tasks
        with pytest.raises(KeyboardInterrupt):
            program.main(options)
        history = Path("m_chocolate/design_1.csv")
        begun = history.read_bytes()
        assert begun == whole["design_1.csv"][: len(begun)]
        history.write_bytes(begun + b"0815,1")  # a line that was not written to its end
        InProcess.left = 10**6
        program.main(options)
        assert read_all("m_chocolate") == whole
    capsys.readouterr()


@pytest.mark.slow
def test_a_design_that_was_killed_by_sigkill_ends_with_the_same_bytes(path, light, monkeypatch):
    options, history = ["m.yaml", "--budget", "500"], Path("m_chocolate/design_1.csv")
    program.main(options)
    whole = read_all("m_chocolate")
    shutil.rmtree("m_chocolate")
    child = os.fork()
    if child == 0:
        InProcess.left = 3
        monkeypatch.setattr(InProcess, "end", lambda: os.kill(os.getpid(), signal.SIGKILL))
        program.main(options)
        os._exit(0)
    assert os.waitpid(child, 0)[1] == signal.SIGKILL
    assert 20 < history.read_text().count("\n") < whole["design_1.csv"].count(b"\n")
    program.main(options)
    assert read_all("m_chocolate") == whole


@pytest.mark.slow
def test_a_controller_that_was_edited_stays_until_fresh(path, light):
    options, file = ["m.yaml", "--budget", "200"], Path("m_chocolate/design_1_1.controller")
    program.main(options)
    designed = file.read_text()
    file.write_text("states: [{name: rest, do: stop}]\n")
    program.main(options)
    assert file.read_text() == "states: [{name: rest, do: stop}]\n"
    program.main([*options, "--fresh"])
    assert file.read_text() == designed


@pytest.mark.option("cmaes")
def test_a_behavior_of_a_file_is_found_from_the_folder_of_designs(path, light):
    own = "class Own(Dispersion):\n    pass\n"
    Path("own.py").write_text("from hero_swarm.behaviors.spacing import Dispersion\n\n\n" + own)
    path.write_text(MISSION.replace("arena: arena.yaml\n", "") + "behavior: own.py:Own\n")
    program.main(["m.yaml", "--method", "cma", "--budget", "250"])
    behavior = find_behavior("m_cma/design_1_1.controller")
    assert behavior.__name__ == "Own" and behavior.arena == "empty" and behavior.spacing_m != 0.5


@pytest.mark.slow
def test_parts_share_out_the_designs(path, light, capsys):
    options = ["m.yaml", "--budget", "200", "--designs", "3", "--part"]
    program.main([*options, "2/2"])
    assert "designs of other parts are still to be made" in capsys.readouterr().out
    assert "design_2.csv" in os.listdir("m_chocolate") and "design_1.csv" not in os.listdir("m_chocolate")
    program.main([*options, "1/2"])
    assert len(capsys.readouterr().out.splitlines()) == 9


@pytest.mark.slow
def test_a_damaged_history_is_named_and_what_is_above_is_kept(path, light):
    options = ["m.yaml", "--budget", "200"]
    program.main(options)
    history = Path("m_chocolate/design_1.csv")
    whole = history.read_text()
    lines = whole.splitlines(keepends=True)
    for damaged in (lines[:9] + ["1" + lines[9]] + lines[10:], lines[:9] + lines[10:]):
        history.write_text("".join(damaged))
        with pytest.raises(ExperimentError, match="design_1.csv, line 10: is damaged; delete it and all below"):
            program.main(options)
    history.write_text("".join(lines[:9]))
    InProcess.left = 100
    program.main(options)
    assert history.read_text() == whole and InProcess.left < 100


@pytest.mark.slow
def test_other_options_and_missions_are_not_mixed(path, light):
    program.main(["m.yaml", "--budget", "200"])
    with pytest.raises(ExperimentError, match="is of another mission, code or options .*: use --fresh"):
        program.main(["m.yaml", "--budget", "300"])
    path.write_text(MISSION.replace("robots: 2", "robots: 3"))
    with pytest.raises(ExperimentError, match="is of another mission"):
        program.main(["m.yaml", "--budget", "200"])
    program.main(["m.yaml", "--budget", "200", "--fresh"])


@pytest.mark.slow
def test_candidates_of_a_batch_score_as_they_do_alone(path):
    mission = read_mission("m.yaml")
    for plan in (Machines, Networks):
        kind = plan(mission)
        genes, common = kind.genes, (mission.experiment, evaluation.hash_suite(), kind)
        genomes = genes.place(np.random.RandomState(1).random_sample((3, len(genes.low))))
        together = evaluation.score_runs(*common, genomes, [7, 7, 8])
        alone = [evaluation.score_runs(*common, genomes[k : k + 1], [seed])[0] for k, seed in enumerate((7, 7, 8))]
        assert together == alone and len(set(together)) > 1


@pytest.mark.slow
def test_no_state_of_a_machine_leads_to_itself(path):
    kind = Machines(read_mission("m.yaml"))
    shares, seen = np.random.RandomState(2).random_sample((50, len(kind.genes.low))), 0
    for genome in nonempty(kind.genes.place(shares)):
        states = yaml.safe_load(kind.dump(genome, "arena.yaml", ""))["states"]
        names = [state["name"] for state in states]
        for state in nonempty(states):
            others = {condition["to"] for condition in state.get("next", [])}
            assert others <= set(names) - {state["name"]}
            seen += len(others)
    assert seen > 100


@pytest.mark.slow
def test_files_do_what_candidates_did(path):
    mission = read_mission("m.yaml")
    path.write_text(MISSION + "behavior: dispersion\n")
    own = read_mission("m.yaml")
    for one, plan in (
        (mission, Machines),
        (mission, lambda m: Machines(m, True)),
        (mission, Networks),
        (own, Numbers),
    ):
        kind = plan(one)
        is_network = kind.ending == ".npz"
        assert not is_network or {*kind.genes.low, *-kind.genes.high} == {-5.0}, "weights as those of EvoStick"
        (genome,) = kind.genes.place(np.random.RandomState(3).random_sample((1, len(kind.genes.low))))
        file = "one" + kind.ending
        Path(file).write_bytes(kind.dump(genome, "arena.yaml", "# mine\n"))
        setup, ends = set_up(one.experiment, one.experiment.cells[0]), []
        for behavior in (kind.make(genome[None], setup.behavior), find_behavior(file)()):
            trial = setup._replace(behavior=behavior).build_trial([5])
            for _ in range(10):
                trial.step()
            ends.append(trial.poses)
        np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)


@pytest.mark.option("cmaes")
def test_cma_designs_the_numbers_of_a_behavior(path, light, monkeypatch):
    path.write_text(
        MISSION.replace("score: {mean_of_last_s: {score.py:right: 1}}", "score: dispersion")
        + "behavior: dispersion\nranges: {spacing_m: [0.1, 1], near.range_m: [0.2, 2]}\n"
    )
    program.main(["m.yaml", "--method", "cma", "--budget", "400"])
    behavior = find_behavior("m_cma/design_1_1.controller")()
    assert behavior.arena == "m_cma/../arena.yaml"
    assert behavior.spacing_m < 0.2 and behavior.near.range_m != 1.0, "a falling metric is made small"


@pytest.mark.slow
@pytest.mark.parametrize(
    "old, new, words",
    [
        (
            MISSION[MISSION.index("score") : MISSION.index("base")],
            "",
            "m.yaml: score is missing: give what shall be best",
        ),
        ("score.py:right", "score.py:left", "the file has no function left"),
        ("score.py:right", "unknown", "line 4: .* is 'unknown'|unknown"),
        ("baseline: dispersion", "baseline: none.py", "line 5: baseline: behavior .*none.py: no such file"),
        ("baseline: dispersion", "baseline: dispersal_", "line 5: baseline: behavior 'dispersal_'"),
        ("arena.yaml", "none.yaml", "line 2: arena none.yaml cannot be read|line 2: arena .*none.yaml cannot be read"),
        ("baseline: dispersion", "seeds: {count: 3}", "line 5: unknown 'seeds'"),
        (
            "baseline: dispersion",
            "ranges: {gain: [2, 1]}",
            "line 5: ranges.gain is a list, but must be the lower limit",
        ),
    ],
)
def test_a_wrong_mission_is_named_with_its_line(path, old, new, words):
    path.write_text(MISSION.replace(old, new))
    with pytest.raises(ExperimentError, match=words):
        program.main(["m.yaml", "--budget", "200"])


@pytest.mark.slow
def test_a_score_that_is_nan_or_tells_nothing_is_refused(path):
    (path.parent / "score.py").write_text(
        SCORE.replace("mean(axis=1)", "mean(axis=1) * (1.0 if state.time_s < 0.5 else float('nan'))")
    )
    with pytest.raises(ExperimentError, match="the mission with seed 1000000: ValueError: metric .* gives nan at 1 s"):
        program.main(["m.yaml", "--budget", "200"])
    (path.parent / "score.py").write_text(SCORE.replace("mean(axis=1)", "mean(axis=1) * 0.0"))
    path.write_text(
        MISSION.replace("robots: 2", "robots: 1").replace("{mean_of_last_s: {score.py:right: 1}}", NAN_ALONE)
    )
    with pytest.raises(
        ExperimentError, match=f"line 4: score {NAN_ALONE} is nan with seed 1000000, but must be a number"
    ):
        program.main(["m.yaml", "--budget", "200", "--fresh"])
    path.write_text(MISSION)
    with pytest.raises(
        ExperimentError, match="m.yaml, line 4: score is 0 in all 150 runs of 30 controllers: change score or mission"
    ):
        program.main(["m.yaml", "--budget", "200", "--fresh"])
    assert len(Path("m_chocolate/design_1.csv").read_text().splitlines()) == 152, "what was computed is kept"


@pytest.mark.parametrize("method, least", [("chocolate", 200), ("maple", 200), ("evostick", 100), ("cma", 250)])
def test_a_budget_below_the_least_is_refused(path, method, least):
    with pytest.raises(ExperimentError, match=f"--budget {least - 1}: {method} needs {least} runs or more"):
        program.main(["m.yaml", "--method", method, "--budget", str(least - 1)])


def test_missing_errors_of_robots_are_named_before_a_design_begins(path):
    with pytest.raises(HeroError, match="errors none.errors cannot be read"):
        program.main(["m.yaml", "--budget", "200", "--errors", "none.errors"])
    assert not Path("m_chocolate").exists()


def test_cma_needs_numbers_that_the_behavior_has(path):
    for text, words in (
        ("", "^m.yaml: cma needs the behavior whose numbers it designs, such as behavior: dispersion$"),
        ("behavior: aggregation", "cma needs ranges of two or more numbers of aggregation, such as ranges"),
        ("behavior: aggregation\nranges: {speed: [0, 1], a: [0, 1]}", "of aggregation.*, not speed"),
    ):
        path.write_text(MISSION + text + "\n")
        with pytest.raises(ExperimentError, match=words):
            program.main(["m.yaml", "--method", "cma", "--budget", "250"])


def test_a_worker_that_dies_keeps_what_is_computed(path, light, monkeypatch):
    def die(*_):
        raise BrokenExecutor("killed")

    monkeypatch.setattr(Future, "result", die)
    with pytest.raises(ExperimentError, match="worker processes died 4 times .*what is done is kept"):
        program.main(["m.yaml", "--budget", "200"])


@pytest.mark.parametrize(
    "text, words",
    [
        ("states: [{name: rest, do: rest}]", "line 1: states.do is 'rest'"),
        ("arena: none.yaml\nstates: [{name: rest, do: stop}]", "own.controller: arena none.yaml: cannot be read"),
        ("# \udcff", "own.controller: not YAML: .* invalid start byte"),
        ("behavior: aggregation\nnumbers: {speed: 1}", "own.controller: .* has no parameter 'speed'"),
    ],
)
def test_a_wrong_controller_is_named(path, text, words):
    Path("own.controller").write_bytes((text + "\n").encode(errors="surrogateescape"))
    with pytest.raises(HeroError, match=words):
        program.main(["own.controller"])


def test_a_controller_is_checked_and_drawn(path, capsys):
    Path("own.controller").write_text("states: [{name: rest, do: stop}]\n")
    program.main(["own.controller"])
    assert capsys.readouterr().out == "own.controller; draw it: dot -Tsvg own.controller.dot\n"
    assert "digraph" in Path("own.controller.dot").read_text()
