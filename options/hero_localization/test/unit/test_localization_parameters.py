"""The README's lists of parameters are generated from the programs' declarations."""

from pathlib import Path

import pytest

from hero_localization.nodes import localize, map_arena, track
from hero_test.parameter_list import make_list

README = (Path(__file__).resolve().parents[2] / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("program", (localize, track, map_arena), ids=lambda program: program.__name__)
def test_the_readme_has_the_list_of_a_program(program):
    items = "\n".join(make_list(program.PARAMETERS))
    assert items in README, "put this into README.md:\n" + items
