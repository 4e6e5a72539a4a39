"""The least that a bridge of robots can be in Python, to compare machines and event loops by: not a driver.

Passes the bytes of messages through, collects transforms, registers topics on a thread of its own. It corrects
nothing, checks only sums, has no services, and loses a stop after a burst of commands. Measure it with

    script/bench driver --server-command '/usr/bin/python3 hero_driver/bench/asyncio_gateway.py {port}'

Another word behind the port names a package with another event loop, such as uvloop.
"""

import asyncio
import importlib
import queue
import socket
import struct
import sys
import threading
import time

import rospy

from hero_driver import message_types
from hero_driver.message_types import MessageTypeError
from hero_driver.rosserial import frames, payloads

TRANSFORM_PERIOD_S = 0.01


class Robot(asyncio.Protocol):
    """One connection."""

    def __init__(self, gateway):
        self._gateway = gateway
        self._reader = frames.FrameReader()
        self._publishers = {}

    def connection_made(self, transport):
        """Ask for the topics."""
        self._transport = transport
        transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        transport.write(frames.encode_frame(frames.ID_PUBLISHER, b""))

    def data_received(self, data):
        """Pass on what came."""
        for topic_id, payload in zip(*self._reader.receive_columns(data)):
            publish = self._publishers.get(topic_id)
            if publish is not None:
                publish(payload)
            elif topic_id in (frames.ID_PUBLISHER, frames.ID_SUBSCRIBER):
                info = payloads.decode_topic_info(payload)
                if info.name == "/tf":
                    self._publishers[info.topic_id] = lambda payload: self._gateway.transforms.append(
                        payload[4:]
                    )
                else:
                    self._gateway.jobs.put(lambda info=info, kind=topic_id: self._register(info, kind))
            elif topic_id == frames.ID_TIME:
                answer = payloads.encode_time(payloads.split_seconds(time.time()))
                self._transport.write(frames.encode_frame(frames.ID_TIME, answer))

    def _register(self, info, kind):
        try:
            raw_class = make_class(info.message_type, info.md5sum)
        except MessageTypeError as error:
            print(error, file=sys.stderr)
            return
        if kind == frames.ID_PUBLISHER:
            publisher = rospy.Publisher(info.name, raw_class, queue_size=10, tcp_nodelay=True)
            self._publishers[info.topic_id] = lambda payload: publisher.publish(raw_class(payload))
            return

        def send(message):
            frame = frames.encode_frame(info.topic_id, message.data)
            self._gateway.loop.call_soon_threadsafe(self._transport.write, frame)

        rospy.Subscriber(info.name, raw_class, send, queue_size=10, tcp_nodelay=True)


class Gateway:
    """All robots."""

    def __init__(self, loop):
        self.loop = loop
        self.jobs = queue.Queue()
        self.transforms = []

    def register_for_ever(self):
        """Do what needs the ROS master."""
        while True:
            self.jobs.get()()

    async def serve(self, port):
        """Listen on port until the program is ended."""
        raw_class = make_class("tf2_msgs/TFMessage", "94810edda583a504dfda3829e70d7eec")
        publisher = rospy.Publisher("/tf", raw_class, queue_size=100, tcp_nodelay=True)
        await self.loop.create_server(lambda: Robot(self), "127.0.0.1", port, backlog=256)
        while True:
            await asyncio.sleep(TRANSFORM_PERIOD_S)
            transforms, self.transforms = self.transforms, []
            if transforms:
                publisher.publish(raw_class(struct.pack("<I", len(transforms)) + b"".join(transforms)))


def make_class(message_type, md5sum):
    """Return the class of message_type whose messages are their bytes."""
    return message_types.make_raw_class(message_types.find_message_class(message_type, md5sum))


def main():
    """Run from the command line."""
    rospy.init_node("asyncio_gateway", disable_signals=True)
    package = importlib.import_module(sys.argv[2] if len(sys.argv) > 2 else "asyncio")
    loop = package.new_event_loop()
    asyncio.set_event_loop(loop)
    gateway = Gateway(loop)
    threading.Thread(target=gateway.register_for_ever, daemon=True).start()
    loop.run_until_complete(gateway.serve(int(sys.argv[1])))


if __name__ == "__main__":
    main()
