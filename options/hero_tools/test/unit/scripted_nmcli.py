"""A program nmcli that records its calls and answers as nmcli 1.42 does, for what only Wi-Fi hardware could answer."""

import json
import sys
from typing import Dict, List, NamedTuple

PROGRAM = """#!%s
import json, os, sys
folder = os.path.dirname(os.path.abspath(__file__))
with open(folder + "/answers.json") as file:
    answers = json.load(file)
typed = sys.stdin.read() if "edit" in sys.argv else ""
with open(folder + "/calls.jsonl", "a") as file:
    json.dump({"arguments": sys.argv[1:], "typed": typed, "home": os.environ.get("HOME")}, file)
    file.write("\\n")
command = " ".join(sys.argv[1:])
for key, (code, output) in answers.items():
    if key in command:
        sys.stdout.write(output)
        sys.exit(code)
"""
ONE_DEVICE = "wlan0:wifi:disconnected:\neth0:ethernet:connected:Wired connection 1\nlo:loopback:unmanaged:\n"
ABLE = "WIFI-PROPERTIES.WPA2:yes\nWIFI-PROPERTIES.AP:yes\nWIFI-PROPERTIES.2GHZ:yes\nWIFI-PROPERTIES.5GHZ:yes\n"
ON = (
    "802-11-wireless.ssid:swarm\n802-11-wireless.band:bg\nconnection.interface-name:wlan0\n"
    "ipv4.addresses:10.42.0.1/24\nGENERAL.STATE:activated\nIP4.ADDRESS[1]:10.42.0.1/24\n"
)


class Call(NamedTuple):
    """One recorded call."""

    arguments: List[str]
    typed: str
    home: str


class ScriptedNmcli:
    """The program in a folder that is put first on PATH; answers by a part of the command line, first match wins."""

    def __init__(self, folder, monkeypatch):
        self.folder = folder
        self.answers: Dict[str, List] = {
            "device status": [0, ONE_DEVICE],
            "device show": [0, ABLE],
            "-f NAME connection show": [0, ""],
            "connection show hero_hotspot": [0, ON],
            "connection edit": [0, "Connection 'hero_hotspot' (1b4f) successfully updated.\n"],
        }
        self.write()
        program = folder / "nmcli"
        program.write_text(PROGRAM % sys.executable)
        program.chmod(0o755)
        monkeypatch.setenv("PATH", "%s:/usr/bin:/bin" % folder)

    def write(self):
        (self.folder / "answers.json").write_text(json.dumps(self.answers))

    def answer(self, part, code, output):
        """Answer so to command lines that hold part."""
        self.answers = {
            part: [code, output],
            **{key: old for key, old in self.answers.items() if key != part},
        }
        self.write()

    def read_calls(self):
        """Return the calls so far."""
        file = self.folder / "calls.jsonl"
        lines = file.read_text().splitlines() if file.is_file() else []
        return [Call(**json.loads(line)) for line in lines]

    def list_changes(self):
        """Return the arguments of the calls so far that are no questions."""
        return [call.arguments for call in self.read_calls() if "-f" not in call.arguments]
