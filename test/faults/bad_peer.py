"""Peers that misbehave for a while, one after the other, and reconnect when they are disconnected.

bad_peer.py --port PORT [--host HOST] [--victim N]
A line on stdin, `KIND ADDRESS`, starts one, with an address and a process of its own; it is answered when that is first
connected. The next line ends it, and is answered with one line of JSON: how often it connected, was thrown out, and how
many bytes it sent.
"""

import argparse
import contextlib
import itertools
import json
import os
import random
import select
import signal
import socket
import struct
import sys
import time

import emulated_swarm
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from hero_driver.rosserial import packets, payloads
from hero_driver.rosserial.payloads import TopicInfo
from hero_sim.robot.models import HERO

OWN_NUMBER = 66
STRING_MD5 = "992ce8a1687cec8c8bd883ec73ca41d1"
ANSWER_MD5 = "937c9679a518e3a18d831e57125ea522"
SET_PID_MD5 = "f0d0bdba02bc62a48d52638e38dc8a4b"
WRONG_MD5 = "0123456789abcdef0123456789abcdef"


def declare_topic(frame_id, topic_id, name, message_type, md5sum):
    """Return one packet of a declaration."""
    info = TopicInfo(topic_id, name, message_type, md5sum, 4096)
    return packets.encode_packet(frame_id, payloads.encode_topic_info(info))


def make_burst(number):
    """Return the packets of one burst of robot number, stamped now: odom, five transforms, encoder."""
    stamp = struct.pack("<II", int(time.time()), 0)
    return [bytes(packet) for packet in emulated_swarm.Templates(number).make_burst(10**6, stamp)]


class Peer:
    """Connections from one address until end()."""

    def __init__(self, options, source):
        self.address = (options.host, options.port)
        self.source = source
        self.victim = options.victim
        self.is_over = False
        self.connects = self.thrown_out = self.refused = self.sent_length = 0

    def end(self):
        """Let everything come to its end."""
        self.is_over = True

    def dial(self):
        """Return a new connection."""
        sock = socket.socket()
        sock.bind((self.source, 0))
        sock.settimeout(2.0)
        sock.connect(self.address)
        self.connects += 1
        if self.connects == 1:
            print("{}", flush=True)  # what the test waits for
        return sock

    def send(self, sock, data):
        """Send data, and read what there is, so that only kinds that want to are slow readers."""
        sock.sendall(data)
        self.sent_length += len(data)
        readable, _, _ = select.select([sock], [], [], 0.0)
        if readable and not sock.recv(65536):
            raise ConnectionResetError("thrown out")

    def repeat(self, talk):
        """Let talk(socket) happen on connection after connection."""
        while not self.is_over:
            try:
                with self.dial() as sock:
                    talk(sock)
            except OSError:
                self.thrown_out += 1
                # A robot that is refused dials again every 51 ms.
                time.sleep(0.05)

    def flood(self, prologue, pieces, pause_s=0.0):
        """Say prologue, then pieces for ever."""

        def talk(sock):
            self.send(sock, prologue)
            for piece in pieces():
                if self.is_over:
                    return
                self.send(sock, piece)
                if pause_s:
                    time.sleep(pause_s)

        self.repeat(talk)


def repeat_piece(piece):
    """Return what gives piece for ever."""
    return lambda: itertools.repeat(piece)


def garbage(peer):
    """Random bytes at full speed."""
    chance = random.Random(1)
    blocks = [bytes(chance.randrange(256) for _ in range(4096)) for _ in range(16)]
    peer.flood(b"", lambda: itertools.cycle(blocks))


def byte_by_byte(peer):
    """Fifty connections that send one byte per second each."""
    burst = emulated_swarm.declare(OWN_NUMBER)
    socks = [peer.dial() for _ in range(50)]
    for index in itertools.count():
        if peer.is_over:
            return
        for sock in socks:
            with contextlib.suppress(OSError):
                peer.send(sock, burst[index : index + 1])
        time.sleep(1.0)


def connects(peer):
    """Connects that end at once, as fast as they go."""
    while not peer.is_over:
        try:
            peer.dial().close()
        except OSError:
            peer.refused += 1


def silent_connections(peer):
    """As many connections as it gets, which say nothing."""
    socks = []
    while not peer.is_over:
        try:
            socks.append(peer.dial())
        except OSError:
            peer.refused += 1
        if len(socks) >= 300:
            socks.pop(0).close()
        time.sleep(0.005)


def never_reads(peer):
    """Asks for the time and reads no answer."""
    request = packets.encode_packet(packets.ID_TIME, bytes(8)) * 30

    def talk(sock):
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        sock.sendall(emulated_swarm.declare(OWN_NUMBER))
        while not peer.is_over:
            sock.sendall(request)
            peer.sent_length += len(request)
            time.sleep(0.01)

    peer.repeat(talk)


def huge_packets(peer):
    """The longest packets there are, and headers that promise more."""
    packet = packets.encode_packet(HERO.sent_ids["laser"], bytes(4096))
    promise = b"\xff\xfe\xff\xff\x01\x7d\x00"
    too_long = packets.encode_packet(HERO.sent_ids["laser"], bytes(65535))
    peer.flood(emulated_swarm.declare(OWN_NUMBER), repeat_piece(packet * 4 + promise + too_long))


def many_topics(peer):
    """Ten thousand topics, by new ids and by new names for old ids."""
    burst = [
        declare_topic(0, 200 + index % 300, "/hero_%d/topic_%d" % (OWN_NUMBER, index), "std_msgs/String", STRING_MD5)
        for index in range(10000)
    ]
    blocks = [b"".join(burst[start : start + 20]) for start in range(0, len(burst), 20)]
    peer.flood(emulated_swarm.declare(OWN_NUMBER), lambda: itertools.cycle(blocks), pause_s=0.005)


def renames(peer):
    """A new id with each connection, and other names within each."""
    numbers = itertools.count(1000)

    def talk(sock):
        number = next(numbers)
        peer.send(sock, emulated_swarm.declare(number) + emulated_swarm.declare(number + 1))
        time.sleep(0.02)

    peer.repeat(talk)


def stays(peer):
    """A new id with each connection, of which each stays for a few seconds."""
    socks = []
    for number in itertools.count(1000):
        if peer.is_over:
            return
        with contextlib.suppress(OSError):
            sock = peer.dial()
            peer.send(sock, emulated_swarm.declare(number))
            socks.append(sock)
        if len(socks) > 120:
            socks.pop(0).close()
        time.sleep(0.025)


def claims_an_id(peer):
    """Says that it is another robot, and sends that robot's messages."""
    burst = b"".join(make_burst(peer.victim))
    peer.flood(emulated_swarm.declare(peer.victim), repeat_piece(burst), pause_s=0.01)


def claims_topics(peer):
    """Declares another robot's topics beside its own, and sends on them."""
    victim = "/hero_%d" % peer.victim
    odometry, twist = "nav_msgs/Odometry", "geometry_msgs/Twist"
    foreign = declare_topic(0, 140, victim + "/odom", odometry, Odometry._md5sum)
    foreign += declare_topic(0, 141, victim + "/odom_raw", odometry, Odometry._md5sum)
    foreign += declare_topic(1, 120, victim + "/velocity_controller/cmd_vel", twist, Twist._md5sum)
    odom = make_burst(peer.victim)[0][packets.HEADER_LENGTH : -1]
    pieces = packets.encode_packet(140, odom) + packets.encode_packet(141, odom)
    peer.flood(emulated_swarm.declare(OWN_NUMBER) + foreign, repeat_piece(pieces), pause_s=0.001)


def foreign_transforms(peer):
    """Sends transforms of another robot's frames."""
    piece = b"".join(make_burst(peer.victim)[1:6])
    peer.flood(emulated_swarm.declare(OWN_NUMBER), repeat_piece(piece), pause_s=0.002)


def log_flood(peer):
    """Log lines as fast as they are let through, each another one."""

    def pieces():
        for index in itertools.count():
            line = payloads.Log(index % 5, "line %d \x1b[31m[FATAL] forged\n" % index)
            yield packets.encode_packet(packets.ID_LOG, payloads.encode_log(line)) * 5

    peer.flood(emulated_swarm.declare(OWN_NUMBER), pieces, pause_s=0.001)


def service_answers(peer):
    """Answers of a service that nobody called."""
    name = "/hero_%d/velocity_controller/pid_parameters" % OWN_NUMBER
    service = declare_topic(2, 135, name, "hero_common/SetPID", ANSWER_MD5)
    service += declare_topic(3, 110, name, "hero_common/SetPID", SET_PID_MD5)
    answer = packets.encode_packet(135, struct.pack("<?I", True, 2) + b"ok") * 20
    peer.flood(emulated_swarm.declare(OWN_NUMBER) + service, repeat_piece(answer), pause_s=0.005)


def bad_md5(peer):
    """Declares every topic with an md5 that is wrong, again and again."""
    reader = packets.PacketReader()
    burst = b""
    for packet in reader.receive_bytes(emulated_swarm.declare(OWN_NUMBER)):
        if packet.topic_id < packets.ID_SERVICE_SERVER_PUBLISHER:
            info = payloads.decode_topic_info(packet.payload)._replace(md5sum=WRONG_MD5)
            burst += packets.encode_packet(packet.topic_id, payloads.encode_topic_info(info))
    peer.flood(burst, repeat_piece(burst), pause_s=0.01)


KINDS = {
    function.__name__: function
    for function in (
        garbage,
        byte_by_byte,
        connects,
        silent_connections,
        never_reads,
        huge_packets,
        many_topics,
        renames,
        stays,
        claims_an_id,
        claims_topics,
        foreign_transforms,
        log_flood,
        service_answers,
        bad_md5,
    )
}


def misbehave(kind, peer):
    """Be a peer of a kind until SIGINT; end this process."""
    signal.signal(signal.SIGINT, lambda *_: peer.end())
    with contextlib.suppress(OSError):
        KINDS[kind](peer)
    names = ("connects", "thrown_out", "refused", "sent_length")
    print(json.dumps({name: getattr(peer, name) for name in names}), flush=True)
    # Its sockets end with it, without a word.
    os._exit(0)


def main():
    """Run from the command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--victim", type=int, default=0)
    options = parser.parse_args()
    for line in sys.stdin:
        kind, source = line.split()
        pid = os.fork()
        if pid == 0:
            misbehave(kind, Peer(options, source))
        sys.stdin.readline()
        os.kill(pid, signal.SIGINT)
        os.waitpid(pid, 0)


if __name__ == "__main__":
    main()
