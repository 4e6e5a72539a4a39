"""Who is here: arrivals, returns, take-overs, duplicates, departures."""

from hypothesis import given
from hypothesis import strategies as st

from hero_driver.fleet.namespaces import Identity
from hero_driver.fleet.registry import (
    ALIVE_S,
    GONE_MAX,
    FleetRegistry,
    RobotState,
    Verdict,
)
from hero_msgs.msg import Robot

HERO = Identity("/hero_0", 0)
OTHER = Identity("/hero_1", 1)
GRACE_S = 10.0
T0 = 100.0


def make_fleet():
    return FleetRegistry(GRACE_S)


def identify(fleet, link, now_s, host="10.0.0.1", identity=HERO, opened_s=None):
    """Let a connection, opened 0.1 s ago unless opened_s says so, say who it is."""
    opened_s = now_s - 0.1 if opened_s is None else opened_s
    return fleet.claim_identity(link, identity, host, "%s:%d" % (host, link), opened_s, now_s)


def test_a_robot_arrives_and_joins():
    fleet = make_fleet()
    decision = identify(fleet, 1, T0)
    assert decision.verdict is Verdict.ARRIVED
    assert decision.old_link is None
    record = fleet.robots["/hero_0"]
    assert decision.record is record
    assert (record.identity, record.address, record.link) == (HERO, "10.0.0.1:1", 1)
    assert (record.state, record.since_s, record.reconnects) == (RobotState.JOINING, T0, 0)


def test_a_robot_that_leaves_is_away_with_the_reason():
    fleet = make_fleet()
    identify(fleet, 1, T0)
    record = fleet.leave(1, "silent for 6.1 s", T0 + 10.0)
    assert record is fleet.robots["/hero_0"]
    assert (record.state, record.since_s, record.link) == (RobotState.AWAY, T0 + 10.0, None)
    assert record.last_error == "silent for 6.1 s"


def test_a_robot_that_was_away_returns_from_any_address():
    fleet = make_fleet()
    identify(fleet, 1, T0)
    fleet.leave(1, "closed", T0 + 10.0)
    decision = identify(fleet, 2, T0 + 12.0, host="10.0.0.99")
    assert decision.verdict is Verdict.RETURNED
    assert decision.old_link is None
    record = decision.record
    assert (record.state, record.link, record.address) == (RobotState.JOINING, 2, "10.0.0.99:2")
    assert (record.reconnects, record.joined_s) == (1, T0 + 12.0)


def test_a_robot_stays_known_for_exactly_the_grace_period():
    fleet = make_fleet()
    identify(fleet, 1, T0)
    identify(fleet, 2, T0, identity=OTHER)
    fleet.leave(1, "closed", T0 + 5.0)
    assert fleet.collect_expired(T0 + 14.9) == []
    (record,) = fleet.collect_expired(T0 + 15.0)
    assert record.identity == HERO
    assert sorted(fleet.robots) == ["/hero_1"]
    assert identify(fleet, 3, T0 + 16.0).verdict is Verdict.ARRIVED


def test_a_robot_that_was_ready_stays_listed_as_gone_until_it_returns():
    fleet = make_fleet()
    for link, identity, is_ready in ((1, HERO, True), (2, OTHER, False)):
        record = identify(fleet, link, T0, identity=identity).record
        if is_ready:
            record.enter(RobotState.READY, T0)
        fleet.leave(link, "closed", T0 + 1.0)
    assert fleet.gone == {}
    fleet.collect_expired(T0 + 100.0)
    assert [(record.identity, record.since_s) for record in fleet.gone.values()] == [(HERO, T0 + 1.0)]
    identify(fleet, 3, T0 + 200.0)
    assert fleet.gone == {}


def test_of_very_many_robots_that_are_gone_the_last_ones_stay_listed():
    fleet = make_fleet()
    for number in range(GONE_MAX + 3):
        identify(fleet, number, T0, identity=Identity("/hero_%d" % number, number)).record.enter(RobotState.READY, T0)
        fleet.leave(number, "closed", T0 + number)
        fleet.collect_expired(T0 + 1000.0)
    assert [record.identity.number for record in fleet.gone.values()] == list(range(3, GONE_MAX + 3))


# Second connections.


def test_a_robot_after_a_power_cycle_takes_its_dead_connection_over():
    fleet = make_fleet()
    identify(fleet, 1, T0)
    decision = identify(fleet, 2, T0 + 4.0)
    assert decision.verdict is Verdict.TOOK_OVER
    assert decision.old_link == 1
    assert (decision.record.link, decision.record.reconnects) == (2, 1)
    assert decision.record.state is RobotState.JOINING


def test_a_robot_that_boots_fast_takes_over_although_it_was_heard_just_now():
    fleet = make_fleet()
    identify(fleet, 1, T0)
    fleet.robots["/hero_0"].last_heard_s = T0 + 60.0
    assert identify(fleet, 2, T0 + 61.7).verdict is Verdict.TOOK_OVER


def test_the_end_of_the_connection_that_was_taken_over_changes_nothing():
    fleet = make_fleet()
    identify(fleet, 1, T0)
    identify(fleet, 2, T0 + 4.0)
    assert fleet.leave(1, "replaced", T0 + 4.0) is None
    assert fleet.robots["/hero_0"].state is RobotState.JOINING


def test_a_second_robot_with_the_same_id_is_refused_and_both_are_named():
    fleet = make_fleet()
    identify(fleet, 1, T0)
    decision = identify(fleet, 2, T0 + 1.0, host="10.0.0.2")
    assert decision.verdict is Verdict.REFUSED
    assert decision.old_link is None
    record = fleet.robots["/hero_0"]
    text = record.refused["10.0.0.2:2"]
    assert "10.0.0.1:1 was first and keeps the id, 10.0.0.2:2 is refused" in text
    assert "/hero_0" in text
    assert "configuration page" in text
    assert (record.link, record.address, record.reconnects) == (1, "10.0.0.1:1", 0)
    assert list(record.refused) == ["10.0.0.2:2"]


def refuse_second(fleet, heard_s=None):
    """Let a robot arrive and a second one be refused at T0 + 1.0; the first one was heard last at heard_s."""
    identify(fleet, 1, T0)
    assert identify(fleet, 2, T0 + 1.0, host="10.0.0.2").verdict is Verdict.REFUSED
    if heard_s is not None:
        fleet.robots["/hero_0"].last_heard_s = heard_s


def test_the_id_of_a_robot_that_is_away_is_kept_from_its_duplicate():
    fleet = make_fleet()
    refuse_second(fleet, heard_s=T0 + 1.1)
    fleet.leave(1, "closed", T0 + 2.0)
    assert identify(fleet, 3, T0 + 2.1, host="10.0.0.2").verdict is Verdict.REFUSED
    assert identify(fleet, 4, T0 + 11.9, host="10.0.0.2").verdict is Verdict.REFUSED
    assert fleet.robots["/hero_0"].state is RobotState.AWAY
    assert identify(fleet, 5, T0 + 11.9).verdict is Verdict.RETURNED


def test_a_known_robot_may_be_away_and_come_from_a_third_address():
    fleet = make_fleet()
    refuse_second(fleet, heard_s=T0 + 1.1)
    fleet.leave(1, "closed", T0 + 2.0)
    decision = identify(fleet, 3, T0 + 3.0, host="10.0.0.3")
    assert decision.verdict is Verdict.RETURNED
    # The second one's address has not become the robot's by that.
    fleet.leave(3, "closed", T0 + 4.0)
    assert identify(fleet, 4, T0 + 4.1, host="10.0.0.2").verdict is Verdict.REFUSED


def test_a_connection_that_dies_does_not_give_the_id_to_the_second_robot():
    fleet = make_fleet()
    refuse_second(fleet, heard_s=T0 + 1.1)
    assert identify(fleet, 3, T0 + 1.1 + 2 * ALIVE_S, host="10.0.0.2").verdict is Verdict.REFUSED


def test_a_robot_at_a_new_address_joins_when_its_old_connection_ends():
    fleet = make_fleet()
    refuse_second(fleet)  # nothing came over the old connection any more
    assert not fleet.is_reserved(fleet.robots["/hero_0"], "10.0.0.2")
    fleet.leave(1, "silent", T0 + 6.0)
    decision = identify(fleet, 2, T0 + 6.1, host="10.0.0.2")
    assert decision.verdict is Verdict.RETURNED
    assert decision.record.refused == {}
    assert decision.record.host == "10.0.0.2"


def test_a_duplicate_behind_the_same_address_waits_for_the_grace_period():
    fleet = make_fleet()
    identify(fleet, 1, T0)
    identify(fleet, 2, T0 + 1.0)
    record = fleet.robots["/hero_0"]
    record.last_heard_s = T0 + 1.5
    assert identify(fleet, 3, T0 + 1.6, opened_s=T0 + 1.4).verdict is Verdict.REFUSED
    record.last_heard_s = T0 + 2.0
    assert fleet.is_reserved(record, "10.0.0.1")
    fleet.leave(2, "closed", T0 + 2.0)
    # What connects now may be the one that was here: its address tells nothing.
    assert identify(fleet, 4, T0 + 2.5).verdict is Verdict.RETURNED


def test_two_robots_behind_one_address_stop_taking_over_each_other():
    fleet = make_fleet()
    identify(fleet, 1, T0)
    verdicts = []
    now_s = T0 + 1.0
    for link in range(2, 20):
        # The one that is here keeps talking while the other connects.
        fleet.robots["/hero_0"].last_heard_s = now_s
        verdicts.append(identify(fleet, link, now_s + 0.1, opened_s=now_s - 0.1).verdict)
        now_s += 0.1
    assert verdicts[0] is Verdict.TOOK_OVER
    assert verdicts[1:] == [Verdict.REFUSED] * 17


def test_a_robot_that_boots_twice_in_a_row_is_let_in_both_times():
    fleet = make_fleet()
    identify(fleet, 1, T0)
    assert identify(fleet, 2, T0 + 10.0).verdict is Verdict.TOOK_OVER
    # Its second connection dies with its power, before the third one is opened.
    fleet.robots["/hero_0"].last_heard_s = T0 + 10.5
    assert identify(fleet, 3, T0 + 12.2, opened_s=T0 + 12.1).verdict is Verdict.TOOK_OVER


def test_a_state_is_entered_once():
    fleet = make_fleet()
    record = identify(fleet, 1, T0).record
    assert record.enter(RobotState.READY, T0 + 1.0)
    assert not record.enter(RobotState.READY, T0 + 2.0)
    assert (record.state, record.since_s) == (RobotState.READY, T0 + 1.0)


def test_the_states_have_the_numbers_of_the_message():
    assert {state.name: state.value for state in RobotState} == {
        name: getattr(Robot, name) for name in ("JOINING", "READY", "AWAY", "REFUSED")
    }


actions = st.lists(
    st.tuples(
        st.sampled_from(["identify", "leave", "hear", "expire"]),
        st.integers(0, 5),
        st.sampled_from(["10.0.0.1", "10.0.0.2"]),
        st.floats(0.01, 8.0),
    ),
    max_size=60,
)


@given(script=actions)
def test_robots_and_connections_belong_to_at_most_one_of_each_other(script):
    fleet, now_s, links = make_fleet(), T0, []
    for action, number, host, pause_s in script:
        now_s += pause_s
        if action == "identify":
            link = len(links)
            links.append(link)
            known = fleet.robots.get("/hero_%d" % (number % 2))
            before = None if known is None else known.link
            decision = identify(fleet, link, now_s, host, (HERO, OTHER)[number % 2])
            if decision.verdict is Verdict.REFUSED:
                assert decision.record.link == before
            else:
                assert decision.record.link == link
                assert decision.old_link == before
        elif action == "leave":
            record = fleet.leave(number, "closed", now_s)
            assert record is None or (record.link is None and record.state is RobotState.AWAY)
        elif action == "hear":
            for record in fleet.robots.values():
                if record.link is not None:
                    record.last_heard_s = now_s
        else:
            assert all(record.link is None for record in fleet.collect_expired(now_s))
        held = [record.link for record in fleet.robots.values() if record.link is not None]
        assert len(held) == len(set(held))
        for record in fleet.robots.values():
            assert (record.link is None) == (record.state is RobotState.AWAY)


def test_a_robot_silent_for_three_seconds_gives_way_to_its_new_address():
    for silent_s, verdict in ((2.9, Verdict.REFUSED), (3.0, Verdict.TOOK_OVER)):
        fleet = make_fleet()
        identify(fleet, 1, T0)
        assert identify(fleet, 2, T0 + silent_s, host="10.0.0.2").verdict is verdict


def test_take_overs_five_seconds_apart_are_of_one_robot():
    for later_s, verdict in ((4.9, Verdict.REFUSED), (5.0, Verdict.TOOK_OVER)):
        fleet = make_fleet()
        identify(fleet, 1, T0)
        record = identify(fleet, 2, T0 + 1.0).record
        record.last_heard_s = T0 + 1.0 + later_s
        assert identify(fleet, 3, T0 + 1.0 + later_s).verdict is verdict


def test_sixteen_addresses_of_duplicates_are_remembered():
    fleet = make_fleet()
    record = identify(fleet, 0, T0).record
    for number in range(1, 20):
        identify(fleet, number, T0 + 1.0, host="10.0.1.%d" % number)
    assert len(record.rivals) == 16


def test_an_id_is_kept_for_a_robot_that_was_heard_after_its_duplicate_came():
    for heard_s, is_reserved in ((T0 + 1.0, False), (T0 + 1.001, True)):
        fleet = make_fleet()
        record = identify(fleet, 1, T0).record
        identify(fleet, 2, T0 + 1.0, host="10.0.0.2")
        record.last_heard_s = heard_s
        assert fleet.is_reserved(record, "10.0.0.2") == is_reserved
        assert not fleet.is_reserved(record, "10.0.0.3")


def test_a_robot_may_return_to_an_address_at_which_it_was_refused_once():
    fleet, wifi, other = make_fleet(), "10.0.0.1", "10.0.0.2"
    identify(fleet, 1, T0, host=wifi)
    # Its old connection was heard a moment ago, and never again.
    assert identify(fleet, 2, T0 + 1.0, host=other).verdict is Verdict.REFUSED
    assert identify(fleet, 3, T0 + 4.0, host=other).verdict is Verdict.TOOK_OVER
    for number, host in ((4, wifi), (5, other)):
        fleet.leave(number - 1, "switched off", T0 + 10.0 * number)
        assert identify(fleet, number, T0 + 10.0 * number + 1.0, host=host).verdict is Verdict.RETURNED, host
