"""The simulator as a ROS node: faults on request, the driver that it waits for, and how it ends."""

import contextlib
from types import SimpleNamespace
from unittest.mock import Mock, create_autospec

import pytest

pytest.importorskip("rospy", reason="the node needs ROS")
import rospy

from hero_node.ros import MasterWatch
from hero_sim import node as node_module
from hero_sim.errors import OptionError
from hero_sim.faults import FaultInjector
from hero_sim.ground_truth import GroundTruth
from hero_sim.node import LINGER_S, FaultService, wait_for_driver
from hero_sim.simulator import Simulator
from hero_sim.srv import InjectFault, InjectFaultRequest


class Service:
    """The service, and a simulator whose steps a test takes."""

    def __init__(self, monkeypatch):
        self.simulator = create_autospec(Simulator, instance=True, before_advance=[])
        self.injector = create_autospec(FaultInjector, instance=True)
        self.injector.add.side_effect = self.inject
        self.is_stepping = True
        monkeypatch.setattr(rospy, "Service", self.offer)
        self.service = FaultService(self.simulator, self.injector)
        self.requests = self.service._requests
        put = self.requests.put_nowait

        def put_and_step(request):
            put(request)
            if self.is_stepping:
                self.step()

        self.requests.put_nowait = put_and_step

    def offer(self, name, kind, serve):
        assert (name, kind) == ("~fault", InjectFault)
        self.serve = serve

    def inject(self, fault):
        if fault.robot_id == 9:
            raise OptionError("robot 9 is not simulated here")
        return f"{fault.kind} for {fault.robot_id}"

    def step(self):
        for call in self.simulator.before_advance:
            call(5000)

    def ask(self, text):
        answer = self.serve(InjectFaultRequest(text))
        return answer.success, answer.message


def test_each_fault_that_is_asked_for_is_answered_also_after_a_wrong_one(monkeypatch):
    service = Service(monkeypatch)
    assert service.ask("no such fault")[0] is False
    assert service.ask("reboot:robot=9") == (False, "robot 9 is not simulated here")
    assert service.ask("vanish@5:robot=4,for=3") == (True, "vanish for 4")


def test_faults_that_wait_are_all_injected_at_the_next_step(monkeypatch):
    service = Service(monkeypatch)
    service.is_stepping = False
    monkeypatch.setattr(node_module, "SERVICE_LIMIT_S", 0.01)
    late = (False, "the simulator did not answer within 0.01 s")
    texts = ["reboot:robot=9", "reboot:robot=3", "stall:robot=4"]
    assert [service.ask(text) for text in texts] == [late] * 3
    service.step()
    assert [one.args[0].robot_id for one in service.injector.add.call_args_list] == [9, 3, 4]


def test_more_faults_than_can_wait_are_refused_at_once(monkeypatch):
    service = Service(monkeypatch)
    service.is_stepping = False
    for _ in range(100):
        service.requests.put_nowait(("reboot", Mock()))
    assert service.ask("reboot") == (False, "the simulator did not answer within 2 s")


def test_a_driver_is_waited_for_until_it_reports_or_the_node_ends(monkeypatch):
    calls = []

    def wait(topic, kind, timeout_s):
        calls.append(topic)
        if len(calls) < 3:
            raise rospy.ROSException("timeout exceeded")

    monkeypatch.setattr(rospy, "wait_for_message", wait)
    monkeypatch.setattr(rospy, "is_shutdown", lambda: len(calls) >= 5)
    monkeypatch.setattr(rospy, "loginfo", lambda text, name: None)
    assert wait_for_driver("/lab/driver") and calls == ["/lab/driver/robots"] * 3
    monkeypatch.setattr(rospy, "is_shutdown", lambda: True)
    assert not wait_for_driver("/lab/driver") and len(calls) == 3


class Run:
    """A run of the node without ROS, and what it did in which order."""

    def __init__(self, monkeypatch, *arguments, running="", stops=False):
        self.steps, self.hooks, self.stops, self.is_shutdown = [], [], stops, False
        robots = [SimpleNamespace(world="") for _ in range(2)]
        self.simulator = create_autospec(Simulator, instance=True, before_advance=[], stopping=False)
        self.simulator.swarm = SimpleNamespace(robots=robots)
        self.simulator.run.side_effect = self.run
        self.simulator.linger.side_effect = lambda limit_s: self.steps.append(("linger", limit_s))
        self.injector = create_autospec(FaultInjector, instance=True)
        self.truth = create_autospec(GroundTruth)
        self.watch = create_autospec(MasterWatch, instance=True)
        for name, value in (
            ("read_master_uri", lambda: "http://localhost:11311"),
            ("find_running_node", lambda name: running),
            ("init_ros_node", lambda name: self.steps.append("init " + name)),
            ("wait_for_driver", lambda name: self.steps.append("wait for " + name) or name == "/there"),
            ("GroundTruth", self.truth),
            ("FaultService", lambda simulator, injector: self.steps.append("service")),
            ("MasterWatch", lambda: self.watch),
        ):
            monkeypatch.setattr(node_module, name, value)
        monkeypatch.setattr(node_module.signal, "signal", lambda *_: None)
        monkeypatch.setattr(node_module.command_line, "simulate", self.simulate)
        monkeypatch.setattr(node_module.sys, "argv", ["hero_sim", *arguments])
        monkeypatch.setattr(rospy, "on_shutdown", self.hooks.append)
        monkeypatch.setattr(rospy, "is_shutdown", lambda: self.is_shutdown)
        monkeypatch.setattr(rospy, "myargv", list)

    @contextlib.contextmanager
    def simulate(self, options, report):
        try:
            yield self.simulator, self.injector
        finally:
            self.steps.append("closed")

    def run(self, seconds):
        self.steps.append(("run", seconds))
        self.simulator.stopping = self.stops


def test_robots_run_in_one_world_with_their_ground_truth(monkeypatch):
    run = Run(monkeypatch, "--seconds", "3", "--clock", "--no-tf")
    node_module._run()
    assert run.steps == ["init hero_sim", "service", ("run", 3.0), "closed"]
    run.truth.assert_called_once_with(run.simulator, True, False)
    first, second = (robot.world for robot in run.simulator.swarm.robots)
    assert first == second and first.startswith(" | World: ") and len(first) > 12
    (has_ended, _), _ = run.watch.start.call_args
    for hook in run.hooks:
        hook()
    assert run.simulator.stopping is True and has_ended.is_set()


@pytest.mark.parametrize(("is_shutdown", "lingers"), [(False, True), (True, False)])
def test_a_signal_lets_the_driver_stop_the_robots_before_they_leave(monkeypatch, is_shutdown, lingers):
    run = Run(monkeypatch, stops=True)
    run.is_shutdown = is_shutdown
    node_module._run()
    assert run.steps[-2:] == [("linger", LINGER_S) if lingers else ("run", None), "closed"]


def test_connections_close_also_when_a_run_breaks(monkeypatch):
    run = Run(monkeypatch)
    run.simulator.run.side_effect = ZeroDivisionError
    with pytest.raises(ZeroDivisionError):
        node_module._run()
    assert run.steps[-1] == "closed"


def test_a_second_simulator_of_one_name_does_not_end_the_first(monkeypatch):
    run = Run(monkeypatch, running="/hero_sim")
    with pytest.raises(OptionError, match="simulated robots already run as /hero_sim: end them, or give these another"):
        node_module._run()
    assert run.steps == []


@pytest.mark.parametrize(("driver", "runs"), [("/there", True), ("/gone", False)])
def test_robots_join_no_other_driver_than_the_one_that_is_named(monkeypatch, driver, runs):
    run = Run(monkeypatch, "--driver", driver)
    node_module._run()
    assert (("run", None) in run.steps) == runs and run.steps[:2] == ["init hero_sim", "wait for " + driver]
