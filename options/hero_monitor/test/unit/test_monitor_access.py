"""Who may see the fleet monitor's page: the token, names of this machine, pages of other servers."""

import pytest

from hero_monitor.serving.access import Access
from hero_monitor.serving.lesson import TEACHER, User

TOKEN = "a secret of more than sixteen letters"


@pytest.mark.parametrize("name", ["localhost", "127.0.0.1", "[::1]", "10.42.0.1", "Lab-PC", "lab-pc."])
def test_names_and_addresses_of_this_machine_are_let_in(name):
    assert Access(None, ["lab-pc"]).admits_host(name)


@pytest.mark.parametrize(
    "name", ["evil.example", "127.0.0.1.evil.example", "localhost.evil.example", "", "@", "user@lab-pc", "lab-pc/path"]
)
def test_a_name_that_was_made_to_resolve_to_this_machine_is_refused(name):
    assert not Access(None, ["lab-pc"]).admits_host(name)


@pytest.mark.parametrize(
    ("origin", "admitted"),
    [
        ("http://localhost:8088", True),
        ("https://LOCALHOST:8088", True),
        ("http://localhost:8089", False),
        ("http://evil.example", False),
        ("http://localhost:8088.evil.example", False),
        ("null", False),
        ("file://", False),
        ("", False),
        (None, False),
    ],
)
def test_only_a_page_of_this_very_server_may_open_a_socket(origin, admitted):
    assert Access.admits_origin(origin, "localhost:8088") is admitted


def test_the_token_is_admitted():
    assert Access(TOKEN, []).find_key(TOKEN)


@pytest.mark.parametrize("token", ["", TOKEN[:-1], TOKEN + " ", "\u00fc", "\ud800", "wrong"])
def test_a_wrong_token_is_refused(token):
    assert not Access(TOKEN, []).find_key(token)


def test_without_a_token_none_is_needed_and_none_is_right():
    access = Access(None, [])
    assert access.find_user(None) == User("", TEACHER) and Access(TOKEN, []).find_user(None) is None
    assert not access.find_key("")
