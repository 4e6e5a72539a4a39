"""Bags on disk: whole, split, cut off, damaged, of somebody else; and what a recording keeps of a disk."""

import os

import pytest
import rosbag
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from made_up_bag import START_S, write_bag
from std_msgs.msg import String

from hero_recording import plot
from hero_recording.bags import BagSet
from hero_recording.disk_guard import DiskGuard
from hero_recording.errors import RecordingError
from hero_recording.mending import CHUNK_MARK, mend_bag
from hero_recording.progress import Progress


class Terminal:
    """A stream that says it is a terminal."""

    def __init__(self):
        self.text = ""

    def isatty(self):
        return True

    def write(self, text):
        self.text += text

    def flush(self):
        return


def cut_off(path, share):
    """Leave of a bag what a power cut does: a part, and no index."""
    with rosbag.Bag(str(path), "a") as bag:
        bag._file.seek(bag._file_header_pos)
        bag._write_file_header_record(0, 0, 0)
        bag._file.flush()
        size = os.path.getsize(str(path))
        os.truncate(str(path), int(size * share))
        bag._mode = "r"  # close() would write the index again
    return path


def open_set(*paths):
    return BagSet([str(path) for path in paths], Progress())


def read_all(bags, choose=lambda topic, kind: True):
    messages = []
    bags.read(choose, messages.append)
    return messages


def test_files_of_a_split_are_read_in_the_order_of_time(tmp_path):
    write_bag(tmp_path / "a.bag", start_s=START_S + 100.0, seconds=1.0)
    write_bag(tmp_path / "b.bag", seconds=1.0)
    bags = open_set(tmp_path / "a.bag", tmp_path / "b.bag", tmp_path / "a.bag")
    assert bags.paths == [str(tmp_path / "b.bag"), str(tmp_path / "a.bag")]
    assert bags.start_s == START_S
    assert bags.end_s == pytest.approx(START_S + 101.0, abs=0.1)
    times = [message.time_s for message in read_all(bags, lambda topic, kind: topic == "/hero_0/odom")]
    assert len(times) == 58
    assert times == sorted(times)


def test_an_empty_file_of_a_split_is_passed_over_and_nothing_but_empty_ones_is_an_error(tmp_path):
    write_bag(tmp_path / "a.bag", seconds=1.0)
    rosbag.Bag(str(tmp_path / "empty.bag"), "w").close()
    assert open_set(tmp_path / "a.bag", tmp_path / "empty.bag").paths == [str(tmp_path / "a.bag")]
    with pytest.raises(RecordingError, match="no messages"):
        open_set(tmp_path / "empty.bag")


def test_what_is_no_bag_is_named_with_the_reason(tmp_path):
    (tmp_path / "text.bag").write_text("not a bag\n")
    (tmp_path / "nothing.bag").write_text("")
    (tmp_path / "half.bag.active").write_text("")
    for path, words in (
        (tmp_path / "text.bag", "no bag"),
        (tmp_path / "nothing.bag", "no bag"),
        (tmp_path / "missing.bag", "No such file"),
        (tmp_path, "is a folder; name the bags in it"),
        (tmp_path / "half.bag.active", "--mend"),
    ):
        with pytest.raises(RecordingError, match=words) as caught:
            open_set(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_a_bag_that_was_cut_off_is_refused_with_the_remedy_and_can_be_mended(tmp_path):
    path = tmp_path / "cut.bag"
    write_bag(path, seconds=20.0)
    whole = open_set(path)
    count = len(read_all(whole))
    cut_off(path, 0.6)
    with pytest.raises(RecordingError, match="has no index.*record --mend"):
        open_set(path)
    path.rename(str(path) + ".active")
    assert mend_bag(str(path) + ".active", Progress()) == (str(path), None)
    left = len(read_all(open_set(path)))
    assert 0.3 * count < left < count


def test_a_bag_with_damage_in_the_middle_is_named_and_not_a_stack_trace(tmp_path):
    path = tmp_path / "damaged.bag"
    write_bag(path, seconds=20.0)
    data = bytearray(path.read_bytes())
    data[len(data) // 3 : len(data) // 3 + 5000] = b"\xff" * 5000
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=r"damaged\.bag"):
        read_all(open_set(path))


def test_what_cannot_be_mended_stays_as_it_is(tmp_path):
    (tmp_path / "text.bag.active").write_text("not a bag\n")
    write_bag(tmp_path / "twice.bag", seconds=1.0)
    (tmp_path / "twice.bag.active").write_bytes((tmp_path / "twice.bag").read_bytes())
    with pytest.raises(RecordingError, match="cannot be mended"):
        mend_bag(str(tmp_path / "text.bag.active"), Progress())
    with pytest.raises(RecordingError, match="exists already"):
        mend_bag(str(tmp_path / "twice.bag.active"), Progress())
    with pytest.raises(RecordingError, match="No such file"):
        mend_bag(str(tmp_path / "missing.bag"), Progress())
    assert (tmp_path / "text.bag.active").read_text() == "not a bag\n"


def damage(path, share):
    """Change bytes of a bag in a chunk, as a bad disk does."""
    data = bytearray(path.read_bytes())
    start = data.index(CHUNK_MARK, int(len(data) * share))
    data[start : start + 40] = b"\xff" * 40
    path.write_bytes(data)
    return bytes(data)


def test_what_follows_damage_in_the_middle_is_kept_beside_the_mended_bag(tmp_path):
    path = tmp_path / "damaged.bag"
    write_bag(path, seconds=20.0)
    content = damage(path, 0.5)
    assert mend_bag(str(path), Progress()) == (str(path), str(path) + ".damaged")
    assert (tmp_path / "damaged.bag.damaged").read_bytes() == content
    assert len(read_all(open_set(path))) > 0


def test_a_bag_of_which_nothing_can_be_read_is_left_as_it_is(tmp_path):
    path = tmp_path / "damaged.bag.active"
    write_bag(path, seconds=20.0)
    content = damage(path, 0.0)
    with pytest.raises(RecordingError, match="is left as it is"):
        mend_bag(str(path), Progress())
    assert path.read_bytes() == content


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    places=st.lists(st.floats(0.0, 1.0, exclude_max=True), min_size=1, max_size=20),
    bit=st.integers(0, 7),
    length=st.one_of(st.just(1.0), st.floats(0.0, 1.0)),
)
def test_any_bag_is_read_and_mended_or_refused_in_one_line(tmp_path, places, bit, length):
    good = tmp_path / "good.bag"
    if not good.exists():
        write_bag(good, seconds=1.0)
    content = bytearray(good.read_bytes())
    # Most of the structure lies at both ends.
    for place in places:
        content[int((len(content) - 1) * (3.0 * place**2 - 2.0 * place**3))] ^= 1 << bit
    path = tmp_path / "flipped.bag"
    path.write_bytes(content[: int(len(content) * length)])
    for use in (
        lambda: plot.observe(plot.parse_options([str(path)]), open_set(path)),
        lambda: read_all(open_set(path)),
        lambda: mend_bag(str(path), Progress()),
    ):
        try:
            use()
        except RecordingError as error:
            assert str(path) in str(error) and str(error).isprintable()


def test_a_terminal_gets_a_bar_and_a_log_nothing_for_short_work(tmp_path, capsys):
    path = tmp_path / "a.bag"
    write_bag(path, seconds=30.0)
    terminal = Terminal()
    read_all(BagSet([str(path)], Progress(terminal)))
    assert "a.bag" in terminal.text
    assert "%" in terminal.text
    read_all(open_set(path))
    assert capsys.readouterr().err == ""


def test_bags_with_types_that_are_not_installed_are_read_all_the_same(tmp_path):
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
    def test_a_recording_does_not_begin_on_a_disk_that_is_nearly_full(self, tmp_path):
        guard = DiskGuard(str(tmp_path), 500.0, lambda folder: 499.0)
        with pytest.raises(
            RecordingError, match=r"only 499 MB are free in .* the limit is 500 MB.*min_free_mb"
        ):
            guard.prepare()

    def test_a_folder_is_made(self, tmp_path):
        guard = DiskGuard(str(tmp_path / "new" / "folder"), 0.0)
        assert guard.prepare() > 0.0
        assert (tmp_path / "new" / "folder").is_dir()

    def test_a_folder_that_cannot_be_made_is_named(self, tmp_path):
        (tmp_path / "file").write_text("")
        with pytest.raises(RecordingError, match="file/folder cannot be made"):
            DiskGuard(str(tmp_path / "file" / "folder"), 0.0).prepare()

    def test_a_recording_ends_when_the_limit_is_reached_and_not_before(self, tmp_path):
        free_mb = 1000.0
        guard = DiskGuard(str(tmp_path), 500.0, lambda folder: free_mb)
        guard.prepare()
        assert guard.find_reason_to_end() is None
        assert guard.read_free_above_limit_mb() == 500.0
        free_mb = 499.9
        assert "less than the limit of 500 MB" in guard.find_reason_to_end()

    def test_a_recording_ends_when_its_disk_is_pulled_out(self, tmp_path):
        def read_free(folder):
            raise FileNotFoundError(2, "No such file or directory")

        guard = DiskGuard(str(tmp_path), 1.0, read_free)
        assert "is gone" in guard.find_reason_to_end()
        assert guard.read_free_above_limit_mb() is None
