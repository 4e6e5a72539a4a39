from socketserver import ThreadingMixIn
from typing import Any
from xmlrpc.server import SimpleXMLRPCServer

class ThreadingXMLRPCServer(ThreadingMixIn, SimpleXMLRPCServer):
    def __init__(self, addr: Any, log_requests: int = ...) -> None: ...

def __getattr__(name: str) -> Any: ...
