"""A node at a ROS master that ends and comes back: its registrations are whole again, whatever interrupts them."""

import threading
from types import SimpleNamespace

import pytest

from hero_node.errors import NodeError
from hero_node.ros import master_watch
from hero_node.ros.master import LimitedTransport, MasterRefusalError
from hero_node.ros.master_watch import MasterWatch

OWN = [("registerPublisher", "/odom"), ("registerSubscriber", "/led"), ("registerService", "/node/get_loggers")]


class Master:
    """A master, and the node itself, that keep what is registered.

    Attributes:
        failures: raised by the next registrations of a subscriber.
        node_ends: rospy has begun to take the node's registrations back.
        ends_after: number of registrations after which it begins.
    """

    def __init__(self):
        self.answers = True
        self.known = list(OWN)
        self.failures = []
        self.node_ends, self.ends_after = False, 100
        self.updates = []
        self.calls = 0

    def ask(self, method, *arguments):
        if not self.answers:
            raise NodeError("no answer")
        if method == "lookupService" and ("registerService", arguments[0]) not in self.known:
            raise MasterRefusalError("unknown service")
        if method == "registerSubscriber" and self.failures:
            raise self.failures.pop()
        if method.startswith("register"):
            self.calls += 1
            self.known.append((method, arguments[0]))
            self.node_ends = self.node_ends or self.calls == self.ends_after
        return ["http://publisher"]

    def restart(self):
        self.known.clear()

    def publisherUpdate(self, _, topic, publishers):  # noqa: N802 - of the ROS Slave API
        self.updates.append((topic, publishers))

    def connect(self, uri, transport):
        assert uri == "http://node" and isinstance(transport, LimitedTransport)
        return self

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass


@pytest.fixture
def master(monkeypatch):
    made = Master()
    topics = SimpleNamespace(
        get_publications=lambda: [["/odom", "nav_msgs/Odometry"]],
        get_subscriptions=lambda: [["/led", "std_msgs/ColorRGBA"]],
    )
    services = SimpleNamespace(get_services=lambda: [("/node/get_loggers", "rosrpc://node")])
    monkeypatch.setattr(master_watch, "ask_master", made.ask)
    monkeypatch.setattr(master_watch, "get_topic_manager", lambda: topics)
    monkeypatch.setattr(master_watch, "get_service_manager", lambda: services)
    monkeypatch.setattr(master_watch.xmlrpc.client, "ServerProxy", made.connect)
    monkeypatch.setattr(master_watch.rospy, "is_shutdown", lambda: made.node_ends)
    monkeypatch.setattr(master_watch.rospy, "get_node_uri", lambda: "http://node")
    monkeypatch.setattr(master_watch.rospy, "resolve_name", lambda name: name.replace("~", "/node/"))
    return made


def test_nothing_is_registered_again_at_a_master_that_stays(master):
    watch = MasterWatch()
    assert [watch.look(), watch.look(), watch.is_lost, master.calls] == ["", "", False, 0]


@pytest.mark.parametrize("meanwhile", [[], OWN[:1]])
def test_a_master_that_was_started_again_gets_all_registrations(master, meanwhile):
    watch = MasterWatch()
    watch.look()
    master.restart()
    master.known += meanwhile  # a topic that the node has registered since
    assert watch.look().startswith("the ROS master was started again: 2 topics and 1 services are registered again")
    assert master.known == meanwhile + OWN
    assert master.updates == [("/led", ["http://publisher"])]
    assert watch.look() == ""


@pytest.mark.parametrize("failure", [NodeError("late"), OSError("late")])
def test_registrations_that_were_cut_off_are_repeated(master, failure):
    watch = MasterWatch()
    master.restart()
    master.failures = [failure]
    with pytest.raises(type(failure)):
        watch.look()
    assert watch.is_lost
    assert watch.look() != ""
    assert set(master.known) == set(OWN)
    assert not watch.is_lost


def test_everything_is_registered_again_after_a_master_that_hung(master):
    watch = MasterWatch()
    master.answers = False
    with pytest.raises(NodeError):
        watch.look()
    assert watch.is_lost
    master.answers = True  # registrations may have been cut off meanwhile
    assert watch.look() == "the ROS master answers again; 2 topics and 1 services are registered again"
    assert [watch.is_lost, watch.look()] == [False, ""]


def test_a_node_that_ends_is_not_registered_again(master):
    watch = MasterWatch()
    master.restart()
    master.node_ends = True  # rospy unregisters: the master no longer knows the node
    assert [watch.look(), master.known] == ["", []]


@pytest.mark.parametrize("count", [1, 2])
def test_an_end_while_the_node_is_registered_again_leaves_the_rest(master, count):
    watch = MasterWatch()
    master.restart()
    master.ends_after = count
    with pytest.raises(NodeError, match="ends"):
        watch.look()
    assert master.known == OWN[:count]
    assert watch.look() == ""


class LooksThenEnd:
    """Stands for the event that ends the watch: each wait is followed by one look."""

    def __init__(self, monkeypatch, outcomes):
        self.outcomes, self.waited_s = list(outcomes), 0.0
        monkeypatch.setattr(master_watch, "ask_master", self.ask)
        monkeypatch.setattr(master_watch, "_register_again", lambda: (2, 1))

    def wait(self, timeout_s):
        self.waited_s += timeout_s
        return not self.outcomes

    def is_set(self):
        return False

    def ask(self, method, name):
        outcome = self.outcomes.pop(0)
        if outcome is not None:
            raise outcome


@pytest.mark.parametrize("failure", [NodeError("no answer"), OSError("refused"), master_watch.xmlrpc.client.Error()])
def test_the_watch_tells_of_a_loss_once_and_of_the_return(monkeypatch, failure):
    lost = NodeError("no ROS master")
    end = LooksThenEnd(monkeypatch, [None, lost, lost, failure, None, None, lost])
    news, losses = [], []
    monkeypatch.setattr(master_watch.rospy, "resolve_name", lambda name: name)
    MasterWatch().start(end, news.append, losses.append, 1.5)
    for thread in threading.enumerate():
        if thread.name == "master watch":
            thread.join()
    assert news == ["the ROS master answers again; 2 topics and 1 services are registered again"]
    assert losses == ["no ROS master: existing connections keep working"] * 2
    assert end.waited_s == 8 * 1.5
