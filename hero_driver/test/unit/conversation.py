"""Conversations with a session, for its tests: opening one, feeding it, counting its requests."""

from vectors import HANDSHAKE, REQUEST

from hero_driver.rosserial.session import MessagesReceived, Session, SessionLimits

T0 = 100.0
"""When sessions are opened in these tests; a clock need not begin at zero."""

TIME_OF_DAY_S = 1795240942.5


def open_session(**limits):
    """Return a session that has asked for topics once."""
    session = Session(SessionLimits(**limits), T0)
    session.poll(T0)
    assert session.take_packets() == [REQUEST]
    return session


def open_declared_session(**limits):
    """Return a session with the topics of the stock robot."""
    session = open_session(**limits)
    receive(session, HANDSHAKE, T0 + 0.1)
    session.take_packets()
    return session


def receive(session, data, now_s=T0 + 1.0):
    """Give data to session and return the events."""
    return session.receive_bytes(data, now_s, TIME_OF_DAY_S)


def list_messages(events):
    """Return the messages among events as (topic, payload)."""
    return [message for event in events if isinstance(event, MessagesReceived) for message in event.messages]


def list_requests(session):
    """Take what session wants to send; return the requests for topics and check that the rest answers times."""
    sent = session.take_packets()
    requests = [packet for packet in sent if packet == REQUEST]
    assert len(requests) + sum(packet[5:7] == b"\x0a\x00" for packet in sent) == len(sent)
    return requests


def poll_until(session, start_s, end_s, step_s=0.05):
    """Poll a session from start_s to end_s; return the times at which it asked for topics, and its events."""
    request_times_s, events = [], []
    for step in range(int(round((end_s - start_s) / step_s)) + 1):
        now_s = start_s + step * step_s
        events += session.poll(now_s)
        request_times_s += [now_s] * len(list_requests(session))
    return request_times_s, events
