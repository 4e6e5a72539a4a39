from typing import Any
from xmlrpc.client import ServerProxy

class _LockedServerProxy(ServerProxy):
    def _ServerProxy__request(self, methodname: str, params: Any) -> Any: ...  # noqa: N802

def __getattr__(name: str) -> Any: ...
