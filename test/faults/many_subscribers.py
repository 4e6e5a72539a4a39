"""Many subscribers of one topic, each with its own connection, in one process: many_subscribers.py TOPIC COUNT.

rospy shares one connection among the subscribers of a process, so these speak to the driver by themselves. Prints
how many are connected, and stays until it is killed.
"""

import socket
import struct
import sys
import time
import xmlrpc.client

import rosgraph


def encode_header(fields):
    """Return a TCPROS connection header."""
    parts = [("%s=%s" % field).encode() for field in fields.items()]
    data = b"".join(struct.pack("<I", len(part)) + part for part in parts)
    return struct.pack("<I", len(data)) + data


def find_publisher(topic):
    """Return the address of the first publisher of topic, as TCPROS (host, port)."""
    master = rosgraph.Master("/many_subscribers")
    node = dict(master.getSystemState()[0])[topic][0]
    api = xmlrpc.client.ServerProxy(master.lookupNode(node))
    _, _, (_, host, port) = api.requestTopic("/many_subscribers", topic, [["TCPROS"]])
    return host, port


def subscribe(address, topic, number):
    """Return a socket on which messages come."""
    sock = socket.create_connection(address, 60.0)
    fields = {
        "callerid": "/many_subscribers_%d" % number,
        "topic": topic,
        "md5sum": "*",
        "type": "*",
        "tcp_nodelay": "1",
    }
    sock.sendall(encode_header(fields))
    length = struct.unpack("<I", sock.recv(4, socket.MSG_WAITALL))[0]
    answer = sock.recv(length, socket.MSG_WAITALL)
    if b"error=" in answer:
        raise ConnectionError(answer)
    return sock


if __name__ == "__main__":
    place = find_publisher(sys.argv[1])
    socks = [subscribe(place, sys.argv[1], number) for number in range(int(sys.argv[2]))]
    print(len(socks), flush=True)
    while True:
        time.sleep(1.0)
