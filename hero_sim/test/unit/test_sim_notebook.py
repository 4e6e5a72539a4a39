"""The notebook of docs/notebooks: its cells run from first to last, in process."""

import json
from pathlib import Path

import pytest

from hero_test.nonempty import nonempty

pytest.importorskip("matplotlib", reason="the last cell draws").use("Agg")

NOTEBOOK = Path(__file__).resolve().parents[3] / "docs" / "notebooks" / "swarm.ipynb"


def test_the_cells_of_the_notebook_run_from_first_to_last(capsys):
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    names = {}
    for cell in nonempty(cells):
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []  # the repository holds no results
            exec("".join(cell["source"]), names)
    shown = capsys.readouterr().out
    assert "hero_0 did not drive 3 m: an obstacle is in the way" in shown
    assert names["moved_m"].min() > 0.09 and names["drift_rad"].max() < 0.3
