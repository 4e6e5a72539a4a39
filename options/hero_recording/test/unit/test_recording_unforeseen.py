"""An error that was not foreseen is seen: what handles others lets it pass. Files of others stay."""

from types import SimpleNamespace

import pytest
from synthetic_bag import write_bag

from hero_recording import disk_guard, export, record, step_recorder
from hero_recording.bags import repair
from hero_recording.record import Recording
from hero_test.checks.unforeseen import UnforeseenError, fail


def watch_disk(monkeypatch, folder):
    monkeypatch.setattr(disk_guard, "read_free_mb", fail)
    disk_guard.find_reason_to_stop(str(folder), 1.0)


def list_files(monkeypatch, folder):
    (folder / "hero_0.bag").touch()
    monkeypatch.setattr(record, "os", SimpleNamespace(stat=fail))
    Recording._find_files(SimpleNamespace(_pattern=str(folder / "*.bag"), _old_files=set()))


def repair_all(monkeypatch, _folder):
    monkeypatch.setattr(record, "repair_bag", fail)
    record.repair_all(["hero_0.bag.active"])


def record_steps(monkeypatch, _folder):
    library = SimpleNamespace(Writer=fail, WriterError=KeyError, get_types_from_msg=lambda *_: {})
    library.Stores = SimpleNamespace(ROS1_NOETIC="")
    library.get_typestore = lambda _: SimpleNamespace(register=lambda _: None)
    monkeypatch.setattr(step_recorder, "import_optional", lambda *_: library)
    step_recorder.StepRecorder(None, [0], "run.bag")


@pytest.mark.parametrize("act", [watch_disk, list_files, repair_all, record_steps])
def test_an_error_that_was_not_foreseen_is_not_taken_for_another(act, monkeypatch, tmp_path):
    with pytest.raises(UnforeseenError):
        act(monkeypatch, tmp_path)


def test_a_repair_that_cannot_remove_its_copy_says_so(tmp_path, monkeypatch):
    (tmp_path / "half.bag").write_text("cut off")
    monkeypatch.setattr(repair.os, "remove", fail)
    with pytest.raises(repair.RecordingError, match="UnforeseenError"):
        repair.repair_bag(str(tmp_path / "half.bag"))
    assert (tmp_path / "half.bag.orig").read_text() == "cut off", "not over the copy that is left"


def test_an_export_keeps_what_another_one_has_not_finished(tmp_path):
    write_bag(tmp_path / "day.bag", robot_ids=(3,), seconds=0.5)
    other = tmp_path / "out.part" / "out" / "hero_3" / "odometry.csv"
    other.parent.mkdir(parents=True)
    other.write_text("time_s")
    with pytest.raises(FileExistsError, match=r"out\.part"):
        export.main([str(tmp_path / "day.bag"), "--out", str(tmp_path / "out")])
    assert other.read_text() == "time_s" and not (tmp_path / "out").exists()
