"""Roles by codes: what each may do, who is let in by which code, and what is noted of users."""

import csv
import time
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest
import rospkg
from test_monitor_requests import DRIVE, Desk

from hero_monitor.control import activity as activity_module
from hero_monitor.control.activity import Activity
from hero_monitor.control.requests import REQUESTS
from hero_monitor.serving import invitation as invitation_module
from hero_monitor.serving.access import TOKEN_KEY, Access
from hero_monitor.serving.invitation import describe_invitation, make_link, make_login_link, make_qr_rows
from hero_monitor.serving.lesson import TEACHER, VIEWER, Lesson, Role, User
from hero_node import find_source_address

CODES_MAX = 200

TOKEN = "a secret of more than sixteen letters"
DRIVER = Role("driver", frozenset({"hero_3", "hero_4"}))
STOPS = ("stop", "stop_some", "end_drive")


@pytest.mark.parametrize("role", [TEACHER, DRIVER, VIEWER])
def test_no_role_takes_a_stop_away(role):
    for do in (*STOPS, "show"):
        for robots in ((), ["hero_3"], ["hero_9"]):
            assert role.find_refusal(do, robots) == ""


def test_teachers_may_all_and_viewers_watch_and_stop():
    for do in set(REQUESTS) - {*STOPS, "show"}:
        assert TEACHER.find_refusal(do, ["hero_9"]) == ""
        assert VIEWER.find_refusal(do, ["hero_9"]) == "a viewer may not do that: ask the teacher"


def test_drivers_move_their_own_robots_and_no_others():
    for do in ("drive", "goal", "start", "end"):
        assert DRIVER.find_refusal(do, ["hero_4"]) == DRIVER.find_refusal(do, ["hero_3", "hero_4"]) == ""
        for robots in ([], ["hero_5"], ["hero_3", "hero_5"]):
            assert "you are the driver of hero_3, hero_4" in DRIVER.find_refusal(do, robots)
    for do in ("release", "record", "dismiss", "code", "withdraw"):
        assert DRIVER.find_refusal(do, ["hero_3"]) != ""


def test_a_code_gives_its_role_until_it_is_withdrawn():
    lesson = Lesson()
    code = lesson.add(["hero_4", "hero_3"])
    assert len(code) == 6 and code.isdecimal() and lesson.add(["hero_3", "hero_4"]) == code
    assert lesson.find(code) == lesson.find(f"{code[:3]} {code[3:]}") == DRIVER
    assert lesson.list_drivers() == [[code, ["hero_3", "hero_4"]]]
    for withdrawn in (code, lesson.class_code, "no code"):
        lesson.withdraw(withdrawn)
    assert lesson.find(code) is None and lesson.find(lesson.class_code) == VIEWER


def test_codes_of_several_roles_differ_and_are_bounded(monkeypatch):
    drawn = iter([7, 7, 7, 8])
    monkeypatch.setattr("hero_monitor.serving.lesson.secrets.randbelow", lambda limit: next(drawn, 9))
    lesson = Lesson()
    assert (lesson.class_code, lesson.add(["hero_0"])) == ("000007", "000008")
    monkeypatch.undo()
    for number in range(CODES_MAX + 5):
        lesson.add(["hero_%d" % number])
    assert len(lesson.list_drivers()) == CODES_MAX - 1


def test_a_cookie_names_the_user_and_outlives_no_withdrawn_code():
    lesson = Lesson()
    access, code = Access(TOKEN, [], lesson), lesson.add(["hero_3", "hero_4"])
    assert access.find_key(TOKEN) == TOKEN_KEY
    assert access.find_key(f"{code[:3]} {code[3:]}") == code
    assert access.find_key("wrong") == Access(TOKEN, []).find_key(code) == ""
    assert access.find_user(f"{code} Ada L.") == User("Ada L.", DRIVER)
    assert access.find_user(TOKEN_KEY) == User("", TEACHER)
    for cookie in (None, "", "in", TOKEN, "000000"):
        assert access.find_user(cookie) is None
    lesson.withdraw(code)
    assert access.find_user(f"{code} Ada L.") is None
    assert Access(None, []).find_user(None) == User("", TEACHER), "without a token only this PC is served"


def test_a_user_is_named_with_the_role():
    assert User("Ada", DRIVER).describe("10.42.0.7") == "Ada (driver of hero_3, hero_4), 10.42.0.7"
    assert User("", VIEWER).describe("::1") == "a viewer, ::1"
    assert User("", DRIVER).describe("::1") == "a driver of hero_3, hero_4, ::1"


class Background:
    def __init__(self):
        self.warned, self.informed = [], []
        self.warn, self.inform = self.warned.append, self.informed.append

    def submit(self, call, *arguments):
        call(*arguments)


def test_who_drove_and_who_stopped_is_in_the_log_and_a_file(monkeypatch, tmp_path):
    clock = SimpleNamespace(monotonic=lambda: clock.now_s, strftime=time.strftime, now_s=100.0)
    monkeypatch.setattr(activity_module, "time", clock)
    home = tmp_path / "new" / "ros"
    monkeypatch.setattr(rospkg, "get_ros_home", lambda: str(home))
    background = Background()
    activity = Activity(background)
    for elapsed_s in (0.0, 0.125, 10.0, 10.125):  # the last one: a new drive
        clock.now_s += elapsed_s
        activity.note_drive("Ada", ["hero_3"])
    activity.note_drive("Bob", ["hero_3"])
    activity.note("Bob", "stop")
    (path,) = (home / "hero_monitor").iterdir()
    with path.open(encoding="utf-8", newline="") as opened:
        rows = [row[1:] for row in csv.reader(opened)]
    ada = ["Ada", "drive", "hero_3"]
    assert rows == [["user", "request", "robots"], ada, ada, ["Bob", "drive", "hero_3"], ["Bob", "stop", ""]]
    assert background.warned == ["Bob: stop all robots"]
    assert background.informed == ["Ada: drive hero_3", "Ada: drive hero_3", "Bob: drive hero_3"]


def test_a_full_disk_costs_the_file_and_nothing_else(monkeypatch, tmp_path):
    warned = []
    monkeypatch.setattr(rospkg, "get_ros_home", lambda: str(tmp_path / "file"))
    monkeypatch.setattr(activity_module.rospy, "logwarn_throttle", lambda *said: warned.append(said))
    (tmp_path / "file").touch()
    Activity(Background()).note("Ada", "drive", ["hero_3"])
    ((period_s, text),) = warned
    assert period_s == 60.0 and text.endswith("cannot be written (Not a directory): who drives is in the log only")


def test_phones_find_the_page_by_its_address_and_the_code(monkeypatch):
    for address, name in (("10.42.0.7", "10.42.0.7"), ("", "lab-pc")):
        find = create_autospec(find_source_address, return_value=address)
        monkeypatch.setattr(invitation_module, "find_source_address", find)
        monkeypatch.setattr(invitation_module.platform, "node", lambda: "lab-pc")
        shown = describe_invitation("0.0.0.0", 8088, "123456")
        assert (shown["code"], shown["link"]) == ("123456", f"http://{name}:8088/")
        find.assert_called_with("10.42.0.1")
    assert make_login_link("10.0.0.9", 80, "123456") == "http://10.0.0.9:80/#123456"
    assert (make_link("::", 80), make_link("::1", 80)) == ("http://lab-pc:80/", "http://[::1]:80/")


def test_without_the_library_there_is_no_qr_code_and_with_it_a_square(monkeypatch):
    added, rows = [], []
    made = SimpleNamespace(add_data=added.append, make=lambda: rows.append([True, False, *added]))
    made.get_matrix = lambda: [row[:2] for row in rows if row[2:]] * 2
    monkeypatch.setitem(__import__("sys").modules, "qrcode", SimpleNamespace(QRCode=lambda border: made))
    assert make_qr_rows("http://10.42.0.1:8088/#123456") == ["10", "10"]
    monkeypatch.setitem(__import__("sys").modules, "qrcode", None)
    assert make_qr_rows("http://10.42.0.1:8088/#123456") == []


def test_pupils_drive_their_robot_and_stop_all_but_release_none(monkeypatch):
    desk = Desk(monkeypatch, lesson=Lesson())
    ada, viewer = desk.pages
    ada.user, ada.who = User("Ada", Role("driver", frozenset({"hero_1"}))), "Ada, 10.42.0.7"
    viewer.user, viewer.who = User("", VIEWER), "a viewer, 10.42.0.8"
    assert desk.ask("drive", **{**DRIVE, "robots": ["hero_1"]}) == []
    assert "driver of hero_1" in desk.ask("drive", **DRIVE)[0]
    assert "a viewer may not" in desk.ask("drive", page=1, **{**DRIVE, "robots": ["hero_1"]})[0]
    assert desk.ask("end", number=4) == [] and "driver of hero_1" in desk.ask("end", number=5)[0]
    assert "driver of hero_1" in desk.ask("end", number=99)[0], "the recording, or another's report"
    for number, page in enumerate((ada, viewer)):
        assert desk.ask("stop", page=number) == []
        assert page.received == ["stop"]
        assert "may not do that" in desk.ask("release", page=number)[0]
    assert desk.feed.stopper == "a viewer, 10.42.0.8"
    assert ("Ada, 10.42.0.7", "drive", "hero_1") in desk.noted_users
    assert ("a viewer, 10.42.0.8", "stop") in desk.noted_users
    assert not [noted for noted in desk.noted_users if noted[1] == "release"]


def test_teachers_make_and_withdraw_codes(monkeypatch):
    desk = Desk(monkeypatch, lesson=Lesson())
    assert desk.ask("code", robots=["hero_1", "hero_2"]) == []
    ((code, robots),) = desk.lesson.list_drivers()
    assert robots == ["hero_1", "hero_2"]
    assert desk.ask("withdraw", code=code) == [] and desk.lesson.list_drivers() == []
    assert "classroom:=true" in Desk(monkeypatch).ask("code", robots=["hero_1"])[0]
