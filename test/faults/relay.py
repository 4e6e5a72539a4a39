"""A TCP relay between robots and driver that delays, bunches or holds back bytes.

relay.py LISTEN_HOST LISTEN_PORT TARGET_HOST TARGET_PORT
Lines on stdin set how: `jitter 0.2` (each piece up to so many seconds late, in order), `stall 3` (nothing for so
long, then all at once), `clear`. Each is answered with one line.
"""

import json
import queue
import random
import socket
import sys
import threading
import time

READ_LENGTH = 65536


class Weather:
    """How the path is now."""

    def __init__(self):
        self.jitter_s = 0.0
        self.stalled_until_s = 0.0

    def set(self, line):
        """Do what a line on stdin says."""
        word, _, value = line.strip().partition(" ")
        self.jitter_s = float(value) if word == "jitter" else 0.0
        self.stalled_until_s = time.monotonic() + float(value) if word == "stall" else 0.0

    def find_due_s(self, chance):
        """Return when a piece that comes now is to be passed on."""
        return max(time.monotonic() + chance.uniform(0.0, self.jitter_s), self.stalled_until_s)


def read(source, pieces, weather):
    """Put what source sends, with its time, into pieces, until its end."""
    chance = random.Random(3)
    data = b"begin"
    while data:
        try:
            data = source.recv(READ_LENGTH)
        except OSError:
            data = b""
        pieces.put((weather.find_due_s(chance), data))


def write(target, pieces):
    """Write each piece at its time, and after the one before it; the last one is the end."""
    while True:
        due_s, data = pieces.get()
        time.sleep(max(0.0, due_s - time.monotonic()))
        try:
            if not data:
                target.shutdown(socket.SHUT_RDWR)
                return
            target.sendall(data)
        except OSError:
            return


def connect(near, target, weather):
    """Pass on between near and a new connection to target."""
    try:
        far = socket.create_connection(target, 5.0)
    except OSError:
        near.close()
        return
    for source, other in ((near, far), (far, near)):
        source.settimeout(None)
        other.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        pieces = queue.Queue()
        threading.Thread(target=read, args=(source, pieces, weather), daemon=True).start()
        threading.Thread(target=write, args=(other, pieces), daemon=True).start()


def accept(listener, target, weather):
    """Take connections for ever."""
    while True:
        near, _ = listener.accept()
        connect(near, target, weather)


def main():
    """Run from the command line."""
    listen_host, listen_port, target_host, target_port = sys.argv[1:]
    weather = Weather()
    listener = socket.create_server((listen_host, int(listen_port)), backlog=256)
    target = (target_host, int(target_port))
    threading.Thread(target=accept, args=(listener, target, weather), daemon=True).start()
    print("{}", flush=True)
    for line in sys.stdin:
        weather.set(line)
        print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
