"""Topics that fleet.yaml declares are recorded, and exported with a column that has their unit."""

from types import SimpleNamespace

import pytest

from hero_node.files import ExtraTopic
from hero_recording.bags import tables, topics
from hero_recording.bags.tables import declare_tables, is_exported, read_rows
from hero_recording.bags.topics import make_patterns

BATTERY = ExtraTopic("battery", "power/battery", "std_msgs/Float32", "data", "V")
MOOD = ExtraTopic("mood", "mood", "std_msgs/String", "data")


@pytest.fixture(autouse=True)
def forget(monkeypatch):
    for module, name in ((topics, "ROBOT_TOPICS"), (tables, "TABLES")):
        monkeypatch.setattr(module, name, dict(getattr(module, name)))


def test_a_declared_topic_is_recorded_and_has_a_table():
    assert not is_exported("/hero_3/power/battery", "std_msgs/Float32")
    declare_tables([BATTERY, MOOD])
    assert is_exported("/hero_3/power/battery", "std_msgs/Float32")
    assert not is_exported("/hero_3/power/battery", "std_msgs/Int32"), "of another program"
    assert "|power/battery|mood)" in make_patterns(None, ())[0]
    assert list(tables.TABLES["battery"]) == ["battery_V"] and list(tables.TABLES["mood"]) == ["mood"]
    rows = read_rows("/hero_3/power/battery", "std_msgs/Float32", SimpleNamespace(data=3.7), 12.0)
    assert rows == [(3, "battery", (12.0, 3.7))]
