"""Options of the programs: their defaults, and their limits, both of which may be taken."""

from unittest.mock import patch

import pytest

from hero_swarm import show
from hero_swarm.design import program
from hero_swarm.experiments import phantoms, reproduce, runner


def parse_reproduce(arguments):
    """Return the options that reproduce passes on with its name."""
    with patch.object(reproduce, "reproduce", autospec=True) as called:
        reproduce.main(arguments)
    return called.call_args.args[1]


PARSERS = {
    "run": runner.parse_options,
    "phantoms": phantoms.parse_options,
    "design": program.parse_options,
    "show": show.parse_options,
    "reproduce": parse_reproduce,
}


@pytest.mark.parametrize(
    ("name", "option", "least", "most", "below", "above"),
    [
        ("run", "batch", 1, 1000, 0, 1001),
        ("run", "seeds", 1, 1_000_000, 0, 1_000_001),
        ("run", "jobs", 1, 1024, 0, 1025),
        ("phantoms", "seeds", 2, 10_000, 1, 10_001),
        ("phantoms", "robots", 1, 1000, 0, 1001),
        ("phantoms", "time", 1.0, 86_400.0, 0.9, 86_401),
        ("phantoms", "jobs", 1, 1024, 0, 1025),
        ("design", "budget", 1, 1_000_000, 0, 1_000_001),
        ("design", "designs", 1, 1000, 0, 1001),
        ("design", "seed", 0, 2**31 - 1, -1, 2**31),
        ("design", "tests", 2, 10_000, 1, 10_001),
        ("show", "speed", 0.01, 100.0, 0.009, 101),
        ("reproduce", "seeds", 1, 1_000_000, 0, 1_000_001),
        ("reproduce", "jobs", 1, 1024, 0, 1025),
    ],
)
def test_a_number_of_an_option_is_taken_up_to_its_limits(name, option, least, most, below, above, capsys):
    for value in (least, most):
        taken = getattr(PARSERS[name](["what", f"--{option}", str(value)]), option)
        assert taken == value and type(taken) is type(least)
    for value in (below, above, "1.5e", *(["1.5"] if isinstance(least, int) else [])):
        with pytest.raises(SystemExit):
            PARSERS[name](["what", f"--{option}={value}"])
        assert f"--{option}: {value} must be a" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("run", {"file": "what", "out": None, "batch": None, "seeds": None, "robots": None, "frame": "map",
                 "calibration": "~/hero_calibration", "fresh": False, "jobs": 3, "executor": None, "part": (1, 1)}),
        ("phantoms", {"what": "what", "seeds": 10, "robots": 20, "time": 120.0, "arena": None, "jobs": 3,
                      "fresh": False}),
        ("design", {"file": "what", "method": "chocolate", "budget": 2000, "designs": 1, "seed": 1, "tests": 10,
                    "errors": None, "fresh": False, "jobs": 3, "executor": None, "part": (1, 1)}),
        ("show", {"folder": "what", "seed": None, "cell": 1, "speed": 1.0, "video": None, "bag": None}),
        ("reproduce", {"names": ["what"], "folder": "reproduction", "seeds": None, "jobs": 3, "executor": None,
                       "part": (1, 1), "fresh": False, "page": None, "out": None, "batch": None, "robots": None}),
    ],
)  # fmt: skip
def test_options_that_are_not_given_are_as_the_readme_says(name, expected, monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 3)
    assert vars(PARSERS[name](["what"])) == expected
    monkeypatch.setattr("os.cpu_count", lambda: None)
    assert getattr(PARSERS[name](["what"]), "jobs", 1) == 1, "where cores cannot be counted"


def test_robots_parts_and_clusters_are_taken_apart(capsys):
    options = runner.parse_options(["e.yaml", "--robots", "0-2 5", "--part", "3/3", "--executor", "dask:tls://a:1"])
    assert (options.robots, options.part, options.executor) == ([0, 1, 2, 5], (3, 3), "tls://a:1")
    for wrong in ("--part=0/3", "--part=4/3", "--part=3", "--part=1/", "--executor=dask:", "--executor=tls://a:1"):
        with pytest.raises(SystemExit):
            runner.parse_options(["e.yaml", wrong])
        option, _, value = wrong.partition("=")
        assert f"argument {option}: {value!r} must be " in capsys.readouterr().err.replace(f"{option} K/N", option)
    assert PARSERS["reproduce"](["what", "--quick"]).seeds == 2
    with pytest.raises(SystemExit):
        show.parse_options(["folder", "--video", "a.gif", "--bag", "a.bag"])
