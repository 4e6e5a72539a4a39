"""The private parameters of the node, read once and checked."""

import os
import platform
import re
import stat
from dataclasses import dataclass
from typing import Any, List, Optional, Sequence

from hero_node import ProgramError, is_loopback
from hero_node.parameters import Parameter, declare, find_declared, flag, make_error, number, string, whole_number
from hero_node.ros import read_parameters

from .serving.access import TOKEN_LENGTH_MIN

TOKEN_REMEDY = (
    "write one into a file that only you can read, and name it with token_file:=FILE: "
    "(umask 077; python3 -c 'import secrets; print(secrets.token_urlsafe())' > FILE)"
)


def _read_host(name: str, value: Any) -> str:
    if value == "":
        raise make_error(name, value, "an address of this PC, such as 127.0.0.1")
    return str(value)


def _read_words(name: str, value: Any) -> List[str]:
    return re.findall(r"[^\s,]+", str(value))


@dataclass(frozen=True)
class Parameters:
    """The checked parameters of the node."""

    host: str = declare(Parameter("127.0.0.1", _read_host))
    port: int = declare(whole_number(8088, 0, 65535))
    token_file: str = declare(string(""))
    host_names: Sequence[str] = declare(Parameter("", _read_words))
    control: bool = declare(flag(False))
    rate_hz: float = declare(number(10.0, 1.0, 30.0, "Hz"))
    map_frame: str = declare(string("world"))
    record_folder: str = declare(string("~/hero_recordings"))
    behavior_folder: str = declare(string("~/hero_behaviors"))
    classroom: bool = declare(flag(False))


def load_parameters() -> Parameters:
    """Return the node's private parameters. Raises: ProgramError."""
    parameters = Parameters(**read_parameters(find_declared(Parameters)))
    if parameters.classroom and not parameters.token_file:
        raise ProgramError(f"~classroom admits phones by codes, teachers by a token: {TOKEN_REMEDY}; and host:=0.0.0.0")
    return parameters


def list_host_names(parameters: Parameters) -> List[str]:
    """Return names of this PC: its own, and those that are given."""
    own_name = platform.node()
    own_names = [name for name in (own_name, own_name.partition(".")[0] + ".local", parameters.host) if name]
    return [*parameters.host_names, *own_names]


def read_token(host: str, file: str) -> Optional[str]:
    """Return the token in a file; None if none is needed. Raises: ProgramError."""
    if not file:
        if is_loopback(host):
            return None
        raise ProgramError(f"~host is {host}, which other machines can reach: that needs a token; {TOKEN_REMEDY}")
    path = os.path.expanduser(file)
    try:
        with open(path, encoding="utf-8") as opened:
            mode = os.fstat(opened.fileno()).st_mode
            token = opened.read(1000).strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ProgramError(f"~token_file {path} cannot be read: {error}; {TOKEN_REMEDY}") from None
    if stat.S_ISREG(mode) and mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise ProgramError(f"~token_file {path} can be read by others: chmod 600 {path}")
    if len(token) < TOKEN_LENGTH_MIN:
        raise ProgramError("~token_file %s holds less than %d characters: %s" % (path, TOKEN_LENGTH_MIN, TOKEN_REMEDY))
    return token
