"""Keys and the time -> commands."""

from hero_client.apps.keyboard import split_keys
from hero_client.apps.keyboard_teleop import END_KEY, MOTIONS, STOP_KEYS, KeyDrive, read_stops
from hero_client.apps.teleop_output import PAUSE_S, PauseDetector
from hero_node import STOP


def test_a_single_press_drives_until_its_time_is_out():
    for key, (ahead, left) in MOTIONS.items():
        drive = KeyDrive(0.1, 1.0)
        drive.press(key, 10.0)
        assert drive.command(10.7) == (ahead * 0.1, left * 1.0)  # terminals repeat a key after up to 0.66 s
        assert drive.command(10.8) == STOP


def test_keys_drive_where_the_help_says():
    for keys, ahead, left in (
        (("w", "up", "W"), 1, 0),
        (("x", "down"), -1, 0),
        (("a", "left"), 0, 1),
        (("d", "right"), 0, -1),
        (("q",), 1, 1),
        (("e",), 1, -1),
        (("z",), -1, -1),
        (("c",), -1, 1),
    ):
        for key in keys:
            drive = KeyDrive(0.1, 1.5)
            drive.press(key, 0.0)
            assert drive.command(0.0) == (0.1 * ahead, 1.5 * left)


def test_a_held_key_drives_without_a_break_and_stops_soon_after():
    drive = KeyDrive(0.1, 1.0)
    presses_s = [0.0] + [0.66 + index * 0.04 for index in range(50)]  # the slowest usual keyboard
    for before_s, next_s in zip(presses_s, presses_s[1:]):
        drive.press("w", before_s)
        assert drive.command(next_s - 0.001).linear_m_s == 0.1
    drive.press("w", presses_s[-1])
    assert drive.command(presses_s[-1] + 0.31) == STOP


def test_a_key_is_held_and_drives_below_its_times():
    for again_s, ends_s in ((0.3, 0.3 + 0.75), (0.25, 0.25 + 0.3)):
        drive = KeyDrive(0.1, 1.0)
        drive.press("w", 0.0)
        drive.press("w", again_s)
        assert drive.command(ends_s - 0.001).linear_m_s == 0.1 and drive.command(ends_s) == STOP


def test_every_stop_key_stops_at_once():
    for key in STOP_KEYS:
        drive = KeyDrive(0.1, 1.0)
        drive.press("q", 0.0)
        drive.press(key, 0.1)
        assert drive.command(0.1) == STOP


def test_two_keys_together_make_a_curve():
    drive = KeyDrive(0.1, 1.0)
    drive.press("w", 0.0)
    drive.press("a", 0.1)
    assert drive.command(0.2) == (0.1, 1.0)
    drive.press("x", 0.3)
    assert drive.command(0.3) == (-0.1, 1.0)


def test_speeds_stay_within_the_robots_limits():
    drive = KeyDrive(0.1, 1.0)
    for key, linear_m_s, angular_rad_s in (("+", 0.12, 1.0), ("_", 0.1, 1.0), (".", 0.1, 1.25), ("<", 0.1, 1.0)):
        drive.press(key, 0.0)
        assert (round(drive.linear_m_s, 9), drive.angular_rad_s) == (linear_m_s, angular_rad_s)
    for key, low, high in (("+", 0.2, 0.2), ("-", 0.02, 0.02)):
        for _ in range(50):
            drive.press(key, 0.0)
        assert low - 1e-9 <= drive.linear_m_s <= high + 1e-9
    for key, limit in ((">", 4.0), ("<", 0.25)):
        for _ in range(50):
            drive.press(key, 0.0)
        assert drive.angular_rad_s == limit


def test_other_keys_mean_nothing():
    drive = KeyDrive(0.1, 1.0)
    for key in "yuiophjklvbnm#@\r":
        drive.press(key, 0.0)
    assert drive.command(0.0) == STOP and (drive.linear_m_s, drive.angular_rad_s) == (0.1, 1.0)


def test_arrows_are_keys_whole_or_cut_in_two():
    assert split_keys("w\x1b[Ad\x1bOC") == (["w", "up", "d", "right"], "")
    keys, rest = split_keys("\x1b[")
    assert keys == [] and split_keys(rest + "B") == (["down"], "")


def test_other_escape_sequences_are_no_keys():
    assert split_keys("\x1b[3~w") == (["w"], "")
    assert split_keys("\x1b[1;5Aw") == (["w"], "")
    assert split_keys("\x1bOPw") == (["w"], "")
    assert split_keys("\x1b") == ([], "")


class Typed:
    """A terminal in which keys wait, so many for each read."""

    def __init__(self, *reads):
        self.reads = list(reads)

    def read_keys(self):
        return self.reads.pop(0) if self.reads else []


def test_of_keys_typed_during_a_pause_only_those_that_stop_or_end_count():
    keyboard = Typed(["w"] * 1000, ["w", "\r", "r", "up", "g"], ["s", "1", END_KEY])
    assert read_stops(keyboard) == ["\r", "s", END_KEY]
    assert keyboard.reads == []
    assert read_stops(Typed(["w"], None)) is None


def test_a_pause_is_longer_than_any_step_of_a_program_that_runs():
    pauses = PauseDetector(10.0)
    for number in range(100):
        assert not pauses.step(10.0 + 0.1 * number)
    assert pauses.is_paused(19.91 + PAUSE_S)
    assert pauses.step(19.91 + PAUSE_S)
    assert not pauses.step(19.92 + PAUSE_S)
