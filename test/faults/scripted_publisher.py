"""A publisher of one topic that refuses and drops connections when a test says so. Source: ROS slave API and TCPROS."""

import io
import socket
import threading
import xmlrpc.server

import rosgraph
from geometry_msgs.msg import Twist
from rosgraph.network import read_ros_handshake_header, write_ros_handshake_header

HEADER = {"callerid": "/scripted", "type": Twist._type, "md5sum": Twist._md5sum, "latching": "0"}
GONE = {"error": "[/scripted] is not a publisher of this topic"}


class ScriptedPublisher:
    """A node of its own for the ROS master; use it with `with`."""

    def __init__(self, topic):
        self.connections = []
        self.refused = 0
        self.refuses = False
        self._topic = topic
        self._master = rosgraph.Master(HEADER["callerid"])
        self._listener = socket.create_server(("localhost", 0))
        self._api = xmlrpc.server.SimpleXMLRPCServer(("localhost", 0), logRequests=False)
        self._api.register_function(self._request_topic, "requestTopic")
        self._api.register_function(self._get_publications, "getPublications")
        self._uri = "http://localhost:%d/" % self._api.server_address[1]
        for serve in (self._api.serve_forever, self._accept):
            threading.Thread(target=serve, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._master.unregisterPublisher(self._topic, self._uri)
        self._api.shutdown()
        self._api.server_close()
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for connection in self.connections:
            connection.close()

    def _request_topic(self, _caller, _topic, _protocols):
        return [1, "", ["TCPROS", *self._listener.getsockname()]]

    def _get_publications(self, _caller):
        return [1, "", [] if self.refuses else [[self._topic, Twist._type]]]

    def _accept(self):
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return  # closed
            read_ros_handshake_header(connection, io.BytesIO(), 4096)
            write_ros_handshake_header(connection, GONE if self.refuses else HEADER)
            if self.refuses:
                self.refused += 1
                connection.close()
            else:
                self.connections.append(connection)

    def announce(self):
        """Register, again if need be: the master tells the subscribers of it."""
        self._master.unregisterPublisher(self._topic, self._uri)
        self._master.registerPublisher(self._topic, Twist._type, self._uri)
