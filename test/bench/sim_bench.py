"""CPU of the simulator: behind real sockets at real time, stepped by a program, and its physics alone.

Behind sockets a small server in this process takes the driver's place: it requests topics, answers the time, and drives
every robot in a circle ten times a second. Only the simulator's process is counted. With --against, the simulator of
another workspace is measured at the same time: the speed of a virtual machine changes from one run to the next. The
other figures are seconds of simulated time in a second of CPU time, so what else runs on the machine matters little.
Run it with script/bench sim.
"""

import argparse
import selectors
import socket
import struct
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import List, NamedTuple

import numpy as np
from measuring import find_environment, print_machine, read_cpu_s, start, stop

from hero_driver.rosserial import packets, payloads
from hero_sim.build import build_swarm
from hero_sim.main import build_parser
from hero_sim.population import build_world
from hero_sim.robot.models import HERO
from hero_sim.stepped import StepSwarm
from hero_sim.world import STEP_MS, split_to_wheels

_STOCK_ODOM_HZ = 29.27
_SPEEDS = (0.08, 0.6)
_TWIST_ID = HERO.received_ids["velocity_controller/cmd_vel"]
_TWIST = packets.encode_packet(_TWIST_ID, struct.pack("<6d", _SPEEDS[0], 0, 0, 0, 0, _SPEEDS[1]))
_ODOM_ID = HERO.sent_ids["odom"]
_ARRIVAL_S, _SETTLE_S = 30.0, 4.0
"""On a busy machine the simulator's modules load for seconds."""

_SCAN_STEPS = 20
"""Physics steps from one infrared reading to the next."""

_PARTS = ("sockets", "steps", "physics")


class Measurement(NamedTuple):
    """One row of the table."""

    robots: int
    cpu_percent: float  # of one core
    odom_share: float  # odoms that came, of those due at the stock rate


class _Peer:
    def __init__(self, sock: socket.socket) -> None:
        self.socket = sock
        self.reader = packets.PacketReader()
        self.odoms = 0
        self.requested = False
        self.came_s = time.monotonic()


class _Server:
    """Stands for the driver."""

    def __init__(self) -> None:
        self._listener = socket.socket()
        self._listener.bind(("127.0.0.1", 0))
        self._listener.listen(256)
        self.port = self._listener.getsockname()[1]
        self.peers: List[_Peer] = []
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listener, selectors.EVENT_READ, None)

    def run(self, seconds: float) -> None:
        end_s = time.monotonic() + seconds
        drive_s = 0.0
        while time.monotonic() < end_s:
            for key, _ in self._selector.select(0.02):
                if key.data is None:
                    self._accept()
                else:
                    self._receive(key.data)
            now_s = time.monotonic()
            for peer in self.peers:
                if not peer.requested and now_s - peer.came_s > 1.3:
                    peer.requested = True
                    peer.socket.sendall(packets.encode_packet(packets.ID_PUBLISHER, b""))
            if now_s - drive_s > 0.1:
                drive_s = now_s
                for peer in self.peers:
                    if peer.odoms:
                        peer.socket.sendall(_TWIST)

    def _accept(self) -> None:
        sock, _ = self._listener.accept()
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        peer = _Peer(sock)
        self.peers.append(peer)
        self._selector.register(sock, selectors.EVENT_READ, peer)

    def _receive(self, peer: _Peer) -> None:
        for frame in peer.reader.receive_bytes(peer.socket.recv(65536)):
            if frame.topic_id == _ODOM_ID:
                peer.odoms += 1
            elif frame.topic_id == packets.ID_TIME:
                now = payloads.split_seconds(time.time())
                peer.socket.sendall(packets.encode_packet(packets.ID_TIME, payloads.encode_time(now)))

    def close(self) -> None:
        for peer in self.peers:
            peer.socket.close()
        self._listener.close()
        self._selector.close()


def measure(python: List[str], robots: int, seconds: float) -> Measurement:
    """Measure the simulator that a Python interpreter finds, with robots connected to a server of this process."""
    server = _Server()
    command = [*python, "-m", "hero_sim", "--count", str(robots), "--port", str(server.port)]
    process = start([*command, "--quiet"], None)
    try:
        deadline_s = time.monotonic() + _ARRIVAL_S
        while len(server.peers) < robots and process.poll() is None and time.monotonic() < deadline_s:
            server.run(0.1)
        server.run(_SETTLE_S)
        if len(server.peers) < robots or process.poll() is not None:
            raise RuntimeError("only %d of %d robots came within %g s" % (len(server.peers), robots, _ARRIVAL_S))
        before = sum(peer.odoms for peer in server.peers)
        cpu_s, start_s = read_cpu_s(process.pid), time.monotonic()
        server.run(seconds)
        cpu_s, elapsed_s = read_cpu_s(process.pid) - cpu_s, time.monotonic() - start_s
        odoms = sum(peer.odoms for peer in server.peers) - before
    finally:
        stop(process)
        server.close()
    return Measurement(
        robots,
        100.0 * cpu_s / elapsed_s,
        odoms / (robots * _STOCK_ODOM_HZ * elapsed_s),
    )


def measure_fastest(robots: int, simulated_ms: int = 5000) -> float:
    """Return how many seconds of a driving swarm are simulated in a second of CPU, without sockets.

    CPU time, so that what else runs on the machine matters little.
    """
    swarm = build_swarm(build_parser().parse_args(["--count", str(robots)]), [""] * robots, lambda text: None)

    def run(until_ms: int) -> None:
        while swarm.now_ms < until_ms:
            for index in swarm.advance(swarm.now_ms + 5):
                robot = swarm.robots[index]
                robot.outbox.clear()
                if robot.wants_connection:
                    robot.connection_made(swarm.now_ms)
                    swarm.reschedule(index)

    run(2500)
    for robot in swarm.robots:
        robot.receive_bytes(swarm.now_ms, packets.encode_packet(packets.ID_PUBLISHER, b""))
    run(3000)
    start_s = time.process_time()
    for step in range(simulated_ms // 100):
        for robot in swarm.robots:
            robot.receive_bytes(swarm.now_ms, _TWIST)
        run(3000 + 100 * (step + 1))
    return simulated_ms / 1000.0 / (time.process_time() - start_s)


def measure_steps(robots: int, simulated_s: float = 20.0) -> float:
    """Return how many seconds a program that reads and commands each robot at 10 Hz simulates in a second of CPU."""
    with StepSwarm(count=robots) as swarm:
        swarm.sleep(1.0)  # until all have odometry and ranges
        start_s = time.process_time()
        for time_s in swarm.rate(10):
            for robot in swarm:
                _, ranges_m = robot.pose, robot.proximity
                robot.drive(_SPEEDS[0], _SPEEDS[1] if min(ranges_m) > 0.1 else -_SPEEDS[1])
            if time_s >= simulated_s:
                break
        return simulated_s / (time.process_time() - start_s)


def measure_physics(robots: int, worlds: int, simulated_s: float = 10.0) -> float:
    """Return how many seconds of worlds with this many driven robots each are simulated in a second of CPU."""
    world = build_world(build_parser().parse_args(["--count", str(robots)]), worlds)
    world.commands_m_s[:] = split_to_wheels(*_SPEEDS)
    everybody = np.arange(robots * worlds)
    start_s = time.process_time()
    for step in range(round(simulated_s * 1000 / STEP_MS)):
        world.step()
        if step % _SCAN_STEPS == 0:
            world.read_infrared(everybody)
    return simulated_s / (time.process_time() - start_s)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, nargs="+", default=[1, 20, 50, 100])
    parser.add_argument("--seconds", type=float, default=10.0, help="measured time of each row behind sockets")
    parser.add_argument("--only", choices=_PARTS, nargs="+", default=_PARTS, help="parts to measure")
    parser.add_argument(
        "--against",
        type=Path,
        metavar="DIR",
        help="measure the simulator of the workspace DIR, or of the checkout DIR, behind sockets at the same time",
    )
    options = parser.parse_args()
    simulators = {"this": [sys.executable]}
    if options.against:
        simulators["the other"] = [find_environment(options.against), sys.executable]
    print_machine()
    if "sockets" in options.only:
        print("| behind sockets | simulator | CPU of one core | odoms of the stock rate |\n|---|---|---|---|")
        for robots in options.count:
            with ThreadPoolExecutor() as pool:
                rows = pool.map(lambda python: measure(python, robots, options.seconds), simulators.values())  # noqa: B023
                for name, row in zip(simulators, rows):
                    print(
                        "| %d | %s | %.1f %% | %.1f %% |" % (row.robots, name, row.cpu_percent, 100.0 * row.odom_share),
                        flush=True,
                    )
        print("\n| robots, no sockets, as fast as they can | simulated s per s of CPU |\n|---|---|")
        for robots in options.count:
            print("| %d | %.1f |" % (robots, measure_fastest(robots)), flush=True)
    if "steps" in options.only:
        print("\n| stepped, each robot read and commanded at 10 Hz | simulated s per s of CPU |\n|---|---|")
        for robots in options.count:
            print("| %d | %.0f |" % (robots, measure_steps(robots)), flush=True)
    if "physics" in options.only:
        print("\n| physics alone, worlds x robots | simulated s per s of CPU | robot-seconds |\n|---|---|---|")
        for worlds, robots in [*((1, robots) for robots in options.count), (50, 20)]:
            fastest = max(measure_physics(robots, worlds) for _ in range(3))
            print("| %d x %d | %.0f | %.0f |" % (worlds, robots, fastest, fastest * worlds * robots), flush=True)


if __name__ == "__main__":
    main()
