"""The README's lists of parameters and its limits are those of the programs."""

from pathlib import Path

import pytest

from hero_localization.filter import pose_filter, pose_sources, source_clocks, swarm_localizer
from hero_localization.nodes import localize, map_arena, track
from hero_localization.prints.print_tags import ROBOT_DIAMETER_MM
from hero_test.checks.parameter_list import make_list

README = (Path(__file__).resolve().parents[2] / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("program", (localize, track, map_arena), ids=lambda program: program.__name__)
def test_the_readme_has_the_list_of_a_program(program):
    items = "\n".join(make_list(program.PARAMETERS))
    assert items in README, "put this into README.md:\n" + items


@pytest.mark.parametrize(
    "limit",
    [
        "four that agree with each other, over %g s or more, reset the pose" % pose_filter.MOVED_S,
        "While poses of one source disagree for %g s" % pose_sources.DISAGREEING_S,
        "Poses stamped %g s ahead of the clock are not used" % swarm_localizer.AHEAD_S,
        "%g ms or more are corrected, and named after %g s" % (1e3 * source_clocks.NAMED_S, source_clocks.CONFIRMED_S),
        "with the tags found, at most %g Hz" % (1.0 / track.PICTURE_PERIOD_S),
        "Discs of %g mm" % ROBOT_DIAMETER_MM,
    ],
)
def test_limits_are_those_of_the_readme(limit):
    assert limit in " ".join(README.split())
    assert pose_filter.MOVED_POSES == 4
