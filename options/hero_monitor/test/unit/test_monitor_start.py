"""The monitor's parameters, sockets and background: tokens, limits, and pages that take nothing."""

import dataclasses
import json
import runpy
import sys
from types import SimpleNamespace

import pytest

from hero_monitor import background as background_module
from hero_monitor import parameters as parameters_module
from hero_monitor.background import Background
from hero_monitor.control.offers import OFFERS, describe_offers
from hero_monitor.parameters import list_host_names, load_parameters, read_token
from hero_monitor.serving import server as server_module
from hero_monitor.serving.access import Access
from hero_monitor.serving.server import PageSocket
from hero_node import ProgramError
from hero_node.parameters import check_parameters
from hero_test.nonempty import nonempty

TOKEN_LENGTH_MIN, WAITING_MAX = 16, 5

TOKEN = "x" * TOKEN_LENGTH_MIN


def test_a_token_is_needed_where_others_can_reach_the_page(tmp_path):
    assert read_token("127.0.0.1", "") is None
    with pytest.raises(ProgramError, match="~host is 0.0.0.0, which other machines can reach: that needs a token"):
        read_token("0.0.0.0", "")
    file = tmp_path / "token"
    file.write_text(" %s\n" % TOKEN)
    for mode, is_private in ((0o600, True), (0o400, True), (0o640, False), (0o604, False), (0o610, False)):
        file.chmod(mode)
        if is_private:
            assert read_token("0.0.0.0", str(file)) == TOKEN == read_token("127.0.0.1", str(file))
        else:
            with pytest.raises(ProgramError, match="can be read by others: chmod 600"):
                read_token("0.0.0.0", str(file))
    file.chmod(0o600)
    file.write_text(TOKEN[1:])
    with pytest.raises(ProgramError, match="holds less than 16 characters"):
        read_token("0.0.0.0", str(file))
    file.write_bytes(b"\xff" * 20)
    for wrong in (str(file), str(tmp_path / "none"), str(tmp_path)):
        with pytest.raises(ProgramError, match="cannot be read"):
            read_token("0.0.0.0", wrong)


def test_parameters_are_checked_and_name_this_pc(monkeypatch):
    given = {}
    monkeypatch.setattr(parameters_module, "read_parameters", lambda declared: check_parameters(declared, given))
    monkeypatch.setattr(parameters_module.platform, "node", lambda: "pc.lab")
    defaults = load_parameters()
    safe = "127.0.0.1", 8088, "", [], False, 10.0, "world", "~/hero_recordings", "~/hero_behaviors", False
    assert dataclasses.astuple(defaults) == safe
    assert list_host_names(defaults) == ["pc.lab", "pc.local", "127.0.0.1"]
    given.update(host_names=" a, b c", map_frame="/map", control=True)
    loaded = load_parameters()
    assert list_host_names(loaded)[:4] == ["a", "b", "c", "pc.lab"]
    assert loaded.map_frame == "/map" and loaded.control and loaded.record_folder == "~/hero_recordings"
    for right in ({"port": 0, "rate_hz": 1.0}, {"port": 65535, "rate_hz": 30.0}):
        given.update(right)
        assert (load_parameters().port, load_parameters().rate_hz) == tuple(right.values())
    for wrong in ({"port": 65536}, {"port": -1}, {"rate_hz": 0.9}, {"rate_hz": 30.1}, {"host": ""}):
        given.clear()
        given.update(wrong)
        with pytest.raises(ProgramError, match=next(iter(wrong))):
            load_parameters()


def test_a_token_of_any_characters_is_compared_and_names_without_case():
    access = Access("geheim-äöü-1234567", ["PC.lab."])
    assert access.find_key("geheim-äöü-1234567") and not access.find_key("geheim-äöü-1234568")
    assert not access.find_key("\ud800") and access.admits_host("pc.LAB") and not access.admits_host("pc")


@pytest.mark.parametrize("name", ["hero_monitor.program", "hero_monitor.page_requests"])
def test_a_pc_without_tornado_loads_what_says_so(monkeypatch, name):
    monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setitem(sys.modules, "tornado", None)
    monkeypatch.setitem(sys.modules, "hero_monitor.serving.server", None)
    assert runpy.run_module(name)


class Socket(PageSocket):
    """A page's socket of which a test says when it has sent."""

    def __init__(self):
        self.written, self.seen, self.is_done = [], None, True
        self._sending = None
        self._waiting = server_module.deque(maxlen=WAITING_MAX)

    def write_message(self, text):
        self.written.append(json.loads(text))
        return SimpleNamespace(done=lambda: self.is_done, add_done_callback=lambda call: None)


def test_a_slow_page_keeps_its_newest_notices():
    page = Socket()
    page.tell("info", "hello")
    assert page.written == [{"notice": {"level": "info", "text": "hello"}}] and page.ready
    page.acknowledge("stop")
    assert page.written.pop() == {"received": "stop"}
    page.end_hold(5000.5)
    assert page.written.pop() == {"hold_over": 5000.5}
    page.is_done = False
    page.acknowledge("stop")
    for number in range(WAITING_MAX + 2):
        page.tell("warn", str(number))
    assert len(page.written) == 1
    page.is_done = True
    page.send_waiting()
    waited = [value["notice"]["text"] for value in page.written[1:] if "notice" in value]
    assert waited == [str(number) for number in range(2, WAITING_MAX + 2)]


def test_warnings_wait_for_no_terminal(monkeypatch):
    said = []
    monkeypatch.setattr(background_module.rospy, "logwarn_throttle", None, raising=False)
    background = Background()
    jobs = []
    background.submit = lambda function, *arguments: jobs.append(arguments) or SimpleNamespace(done=lambda: bool(said))
    background.warn("first", 2.0)
    background.warn("second")
    assert jobs == [(2.0, "first")], "the terminal is paused"
    said.append("printed")
    background.warn("third")
    assert jobs[1:] == [(0.0, "third")]
    background.inform("fourth")
    assert jobs[2:] == [("fourth",)]
    background.shutdown()


def test_limits_of_what_pages_may_set_are_the_ends_of_their_fields():
    for offer in OFFERS.values():
        for name, field in nonempty(offer.fields.items()):
            assert field.check(name, field.default) == field.default, name
            if not isinstance(field.default, float):
                continue
            low, high = field.limits
            assert (field.check(name, low), field.check(name, high)) == (low, high)
            for outside in (low - 1e-6 * max(1.0, high), high + 1e-6 * max(1.0, high)):
                with pytest.raises(ProgramError, match=name):
                    field.check(name, outside)
    (formation,) = describe_offers(["swarm_go_to"])
    assert [field["name"] for field in formation["fields"] if field["on_map"]] == ["turn_deg", "x_m", "y_m"]
    follow, led_show = describe_offers(["follow", "led_show"])
    assert [offer["program"] for offer in (follow, led_show)] == ["follow", "led_show"]
    assert led_show["fields"][0]["choices"] == ("rainbow", "chase", "blink") and not led_show["fields"][0]["limits"]
    assert (follow["fields"][0]["limits"], follow["fields"][0]["step"]) == ((0.1, 2.0), "any")
    assert describe_offers(["behavior_segregation"])[0]["fields"][0]["step"] == 1


def test_only_a_page_that_was_opened_is_told_of_when_it_closes():
    closed, pages = [], []
    for number in (1, 2):
        page = PageSocket.__new__(PageSocket)
        page.pages, page.number, page.actions = pages, number, SimpleNamespace(close_page=closed.append)
        if number == 2:
            pages.append(page)
        for _ in range(2):
            page.on_close()
    assert closed == [2] and pages == []
