"""Bags on disk: whole, split, cut off, damaged, foreign; and free space while recording."""

import os
from importlib.util import find_spec

import pytest
import rosbag
from hypothesis import given, settings
from hypothesis import strategies as st
from std_msgs.msg import String
from synthetic_bag import START_S, write_bag

from hero_recording import disk_guard, plot
from hero_recording.bags import repair
from hero_recording.bags.bag_set import BagSet
from hero_recording.bags.repair import repair_bag
from hero_recording.errors import RecordingError


def cut_off(path, share):
    """Leave what a power cut leaves: a share of the bag, and no index."""
    with rosbag.Bag(str(path), "a") as bag:
        bag._file.seek(bag._file_header_pos)
        bag._write_file_header_record(0, 0, 0)
        bag._file.flush()
        size = os.path.getsize(str(path))
        os.truncate(str(path), int(size * share))
        bag._mode = "r"  # close() would write the index again
    return path


def open_set(*paths):
    return BagSet([str(path) for path in paths])


def read_all(bags, choose=lambda topic, kind: True):
    messages = []
    bags.read(choose, messages.append)
    return messages


def test_files_of_a_split_are_read_in_order_of_time(tmp_path):
    write_bag(tmp_path / "a.bag", start_s=START_S + 100.0, seconds=1.0)
    write_bag(tmp_path / "b.bag", seconds=1.0)
    bags = open_set(tmp_path / "a.bag", tmp_path / "b.bag", tmp_path / "a.bag")
    assert bags.paths == [str(tmp_path / "b.bag"), str(tmp_path / "a.bag")]
    assert bags.start_s == START_S
    assert bags.end_s == pytest.approx(START_S + 101.0, abs=0.1)
    times = [message.time_s for message in read_all(bags, lambda topic, kind: topic == "/hero_0/odom")]
    assert len(times) == 58
    assert times == sorted(times)


def test_an_empty_file_of_a_split_is_skipped_and_only_empty_ones_refused(tmp_path):
    write_bag(tmp_path / "a.bag", seconds=1.0)
    rosbag.Bag(str(tmp_path / "empty.bag"), "w").close()
    assert open_set(tmp_path / "empty.bag", tmp_path / "a.bag").paths == [str(tmp_path / "a.bag")]
    with pytest.raises(RecordingError, match="no messages"):
        open_set(tmp_path / "empty.bag")


def test_a_file_that_is_no_bag_is_refused_with_the_reason(tmp_path):
    (tmp_path / "text.bag").write_text("not a bag\n")
    (tmp_path / "nothing.bag").write_text("")
    (tmp_path / "half.bag.active").write_text("")
    os.mkfifo(str(tmp_path / "pipe.bag"))
    for path, words in (
        (tmp_path / "pipe.bag", "is a pipe, device or socket; name a bag"),
        (tmp_path / "text.bag", "no bag"),
        (tmp_path / "nothing.bag", "no bag"),
        (tmp_path / "missing.bag", "No such file"),
        (tmp_path, "is a folder; name the bags in it"),
        (tmp_path / "half.bag.active", "--repair"),
    ):
        with pytest.raises(RecordingError, match=words) as caught:
            open_set(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_a_bag_that_was_cut_off_is_refused_and_can_be_repaired(tmp_path):
    path = tmp_path / "cut.bag"
    write_bag(path, seconds=20.0)
    whole = open_set(path)
    count = len(read_all(whole))
    cut_off(path, 0.6)
    with pytest.raises(RecordingError, match="has no index.*record --repair"):
        open_set(path)
    path.rename(str(path) + ".active")
    assert repair_bag(str(path) + ".active").startswith("repaired %s; " % path)
    left = len(read_all(open_set(path)))
    assert 0.3 * count < left < count


needs_lz4 = pytest.mark.skipif(find_spec("roslz4") is None, reason="roslz4 is not installed")


@pytest.mark.slow
@pytest.mark.parametrize("compression", ["none", pytest.param("lz4", marks=needs_lz4)])
def test_every_whole_chunk_of_a_bag_that_was_cut_off_is_read_again(tmp_path, compression):
    path = tmp_path / "cut.bag"
    write_bag(path, seconds=20.0, compression=compression)
    with rosbag.Bag(str(path)) as bag:
        chunks = sorted(bag._chunks, key=lambda chunk: chunk.pos)
    readable = sum(sum(chunk.connection_counts.values()) for chunk in chunks[:5])
    content = cut_off(path, 1.0).read_bytes()
    for position in (chunks[5].pos, (chunks[5].pos + chunks[6].pos) // 2):
        path.write_bytes(content[:position])
        repair_bag(str(path))
        path.with_name("cut.bag.orig").unlink()
        with rosbag.Bag(str(path)) as bag:
            assert bag.get_message_count() == readable


@pytest.mark.slow
def test_a_bag_with_damage_in_its_middle_is_refused_by_name(tmp_path):
    path = tmp_path / "damaged.bag"
    write_bag(path, seconds=20.0)
    data = bytearray(path.read_bytes())
    data[len(data) // 3 : len(data) // 3 + 5000] = b"\xff" * 5000
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=r"damaged\.bag"):
        read_all(open_set(path))


def test_a_file_that_cannot_be_repaired_is_left_as_it_is(tmp_path):
    (tmp_path / "text.bag.active").write_text("not a bag\n")
    write_bag(tmp_path / "twice.bag", seconds=1.0)
    (tmp_path / "twice.bag.active").write_bytes((tmp_path / "twice.bag").read_bytes())
    with pytest.raises(RecordingError, match="cannot be repaired"):
        repair_bag(str(tmp_path / "text.bag.active"))
    with pytest.raises(RecordingError, match="exists already"):
        repair_bag(str(tmp_path / "twice.bag.active"))
    with pytest.raises(RecordingError, match="No such file"):
        repair_bag(str(tmp_path / "missing.bag"))
    assert (tmp_path / "text.bag.active").read_text() == "not a bag\n"


def test_a_repair_that_is_broken_off_leaves_the_file_as_it_is(tmp_path, monkeypatch):
    path = tmp_path / "half.bag"
    write_bag(path, seconds=1.0)
    content = path.read_bytes()

    def show(chunks, *_, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(repair, "tqdm", show)
    with pytest.raises(KeyboardInterrupt):
        repair_bag(str(path))
    assert path.read_bytes() == content and [found.name for found in tmp_path.iterdir()] == [path.name]


def test_a_repair_takes_the_place_of_no_other_file(tmp_path):
    for there in ("half.bag", "half.bag.orig"):
        (tmp_path / "half.bag.active").write_text("cut off")
        (tmp_path / there).write_text("another recording")
        with pytest.raises(RecordingError, match=there + " exists already"):
            repair_bag(str(tmp_path / "half.bag.active"))
        assert (tmp_path / "half.bag.active").read_text() == "cut off"
        assert (tmp_path / there).read_text() == "another recording"
        (tmp_path / there).unlink()


CHUNK_MARK = b"\4\0\0\0op=\5"
"""In the header of each chunk (wiki.ros.org/Bags/Format/2.0)."""


def damage(path, share):
    """Change bytes of a bag in a chunk, as a bad disk does."""
    data = bytearray(path.read_bytes())
    start = data.index(CHUNK_MARK, int(len(data) * share))
    data[start : start + 40] = b"\xff" * 40
    path.write_bytes(data)
    return bytes(data)


@pytest.mark.slow
def test_the_file_as_it_was_is_kept_and_never_overwritten(tmp_path):
    path = tmp_path / "damaged.bag"
    write_bag(path, seconds=20.0)
    content = damage(path, 0.5)
    assert repair_bag(str(path)).endswith("; %s.orig is the file as it was" % path)
    assert (tmp_path / "damaged.bag.orig").read_bytes() == content
    assert len(read_all(open_set(path))) > 0
    with pytest.raises(RecordingError, match=r"damaged\.bag\.orig exists already"):
        repair_bag(str(path))


@pytest.mark.slow
def test_a_bag_without_a_readable_message_is_left_as_it_is(tmp_path):
    path = tmp_path / "damaged.bag.active"
    write_bag(path, seconds=20.0)
    content = damage(path, 0.0)
    with pytest.raises(RecordingError, match="is left as it is"):
        repair_bag(str(path))
    assert path.read_bytes() == content
    assert [found.name for found in tmp_path.iterdir()] == [path.name]


@pytest.fixture(scope="module")
def good_bag(tmp_path_factory):
    path = tmp_path_factory.mktemp("any_bag") / "good.bag"
    write_bag(path, seconds=1.0)
    return path


@settings(max_examples=60)
@given(
    places=st.lists(st.floats(0.0, 1.0, exclude_max=True), min_size=1, max_size=20),
    bit=st.integers(0, 7),
    length=st.one_of(st.just(1.0), st.floats(0.0, 1.0)),
)
def test_any_bag_is_read_and_repaired_or_refused_in_one_line(good_bag, places, bit, length):
    content = bytearray(good_bag.read_bytes())
    # Most of the structure lies at both ends.
    for place in places:
        content[int((len(content) - 1) * (3.0 * place**2 - 2.0 * place**3))] ^= 1 << bit
    path = good_bag.with_name("flipped.bag")
    path.write_bytes(content[: int(len(content) * length)])
    for use in (
        lambda: plot.observe(plot.parse_options([str(path)]), open_set(path)),
        lambda: read_all(open_set(path)),
        lambda: repair_bag(str(path)),
    ):
        try:
            use()
        except RecordingError as error:
            assert str(path) in str(error) and str(error).isprintable()


def test_bags_with_types_that_are_not_installed_are_read(tmp_path):
    path = tmp_path / "foreign.bag"
    with rosbag.Bag(str(path), "w") as bag:
        message = String("hello")
        header = {
            "topic": "/words",
            "type": "not_here/Words",
            "md5sum": String._md5sum,
            "message_definition": String._full_text,
        }
        bag.write(
            "/words",
            ("not_here/Words", b"\2\0\0\0hi", String._md5sum, 0, String),
            raw=True,
            connection_header=header,
        )
        bag.write("/more", message)
    words = [message.content.data for message in read_all(open_set(path), lambda topic, kind: topic == "/words")]
    assert words == ["hi"]


class TestDiskGuard:
    def test_a_recording_does_not_start_on_a_nearly_full_disk(self, tmp_path, monkeypatch):
        monkeypatch.setattr(disk_guard, "read_free_mb", lambda folder: 499.0)
        with pytest.raises(RecordingError, match=r"only 499 MB are free in .* the limit is 500 MB.*min_free_mb"):
            disk_guard.prepare_folder(str(tmp_path), 500.0)

    def test_a_missing_folder_is_created(self, tmp_path):
        assert disk_guard.prepare_folder(str(tmp_path / "new" / "folder"), 0.0) > 0.0
        assert (tmp_path / "new" / "folder").is_dir()

    def test_a_folder_that_cannot_be_created_is_refused_by_name(self, tmp_path):
        (tmp_path / "file").write_text("")
        with pytest.raises(NotADirectoryError, match="file/folder"):
            disk_guard.prepare_folder(str(tmp_path / "file" / "folder"), 0.0)

    def test_a_recording_stops_below_the_limit(self, monkeypatch):
        monkeypatch.setattr(disk_guard, "read_free_mb", lambda folder: 500.0)
        assert disk_guard.find_reason_to_stop("/folder", 500.0) is None
        assert "less than the limit of 501 MB" in disk_guard.find_reason_to_stop("/folder", 501.0)

    def test_a_recording_stops_when_its_disk_is_pulled_out(self, tmp_path):
        assert "no longer exists" in disk_guard.find_reason_to_stop(str(tmp_path / "gone"), 1.0)
