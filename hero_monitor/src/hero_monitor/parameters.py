"""The private parameters of the node, read once and checked."""

import os
import platform
import re
import stat
from typing import List, NamedTuple, Optional

from hero_node.errors import ProgramError
from hero_node.parameters import flag, number, whole_number
from hero_node.ros.private_parameters import read_parameters

from .serving.access import TOKEN_LENGTH_MIN, is_loopback

TOKEN_REMEDY = (
    "write one into a file that only you can read, and name it with token_file:=FILE: "
    "(umask 077; python3 -c 'import secrets; print(secrets.token_urlsafe())' > FILE)"
)


class Parameters(NamedTuple):
    """The checked parameters of the node."""

    host: str
    port: int
    token: Optional[str]
    host_names: List[str]
    control: bool
    rate_hz: float
    map_frame: str
    record_folder: str
    foxglove_origins: List[str]
    foxglove_publish: bool


def read_token(host: str, file: str) -> Optional[str]:
    """Return the token in a file; None if none is needed. Raises: ProgramError."""
    if not file:
        if is_loopback(host):
            return None
        raise ProgramError(
            "~host is %s, which other machines can reach: that needs a token; %s" % (host, TOKEN_REMEDY)
        )
    path = os.path.expanduser(file)
    try:
        with open(path, encoding="utf-8") as opened:
            mode = os.fstat(opened.fileno()).st_mode
            token = opened.read(1000).strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ProgramError("~token_file %s cannot be read: %s; %s" % (path, error, TOKEN_REMEDY)) from None
    if stat.S_ISREG(mode) and mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise ProgramError("~token_file %s can be read by others: chmod 600 %s" % (path, path))
    if len(token) < TOKEN_LENGTH_MIN:
        raise ProgramError(
            "~token_file %s holds less than %d characters: %s" % (path, TOKEN_LENGTH_MIN, TOKEN_REMEDY)
        )
    return token


def load_parameters() -> Parameters:
    """Return the node's private parameters. Raises: ProgramError."""
    given = read_parameters(
        {
            "host": "127.0.0.1",
            "port": whole_number(8088, 0, 65535),
            "token_file": "",
            "host_names": "",
            "control": flag(False),
            "rate_hz": number(10.0, 1.0, 30.0, "Hz"),
            "map_frame": "world",
            "record_folder": "~/hero_recordings",
            "foxglove_origins": "",
            "foxglove_publish": flag(False),
        }
    )
    host, token_file = str(given["host"]), str(given.pop("token_file"))
    if not host:
        raise ProgramError("~host is empty, but must be an address of this PC, such as 127.0.0.1")
    names, origins = (re.findall(r"[^\s,]+", str(given[name])) for name in ("host_names", "foxglove_origins"))
    own_name = platform.node()
    own_names = [name for name in (own_name, own_name.partition(".")[0] + ".local", host) if name]
    given.update(
        host=host,
        token=read_token(host, token_file),
        host_names=names + own_names,
        map_frame=str(given["map_frame"]).lstrip("/"),
        record_folder=str(given["record_folder"]),
        foxglove_origins=origins,
    )
    return Parameters(**given)
