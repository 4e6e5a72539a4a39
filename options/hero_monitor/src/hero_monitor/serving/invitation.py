"""Leads phones to the page of a lesson: its link, the class code, and both as a QR code (python3-qrcode, optional)."""

import platform
from typing import Any, Dict, List

from hero_node import find_source_address

HOTSPOT_ADDRESS = "10.42.0.1"
"""Address of a PC that shares its network with robots and phones; every PC has a route to it."""


def describe_invitation(host: str, port: int, code: str) -> Dict[str, Any]:
    """Return what pages of teachers show: code, link of the page, and rows of a QR code, of make_login_link()."""
    return {"code": code, "link": make_link(host, port), "qr": make_qr_rows(make_login_link(host, port, code))}


def make_login_link(host: str, port: int, code: str) -> str:
    """Return the address of the page with a code, which its login fills in."""
    return f"{make_link(host, port)}#{code}"


def make_link(host: str, port: int) -> str:
    """Return the address of the page of a server that listens on a host's address."""
    own = find_source_address(HOTSPOT_ADDRESS) or platform.node()
    name = own if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host
    return f"http://{name}:{port}/"


def make_qr_rows(text: str) -> List[str]:
    """Return the rows of a QR code, 1 for dark; none without the library, where users read the link."""
    try:
        import qrcode  # type: ignore[import-not-found]
    except ImportError:
        return []
    code = qrcode.QRCode(border=0)
    code.add_data(text)
    code.make()
    return ["".join("01"[cell] for cell in row) for row in code.get_matrix()]
