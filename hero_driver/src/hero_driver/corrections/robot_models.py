"""Tells the models of a robot apart: by its Encoder message, and by what contradicts that. Pure.

HeRo+ (github.com/varunraveendra/hero_plus) has encoders on the wheels instead of the gears, an Encoder message with
one field more, a distance sensor on the hat, and a bump shield. Its firmware logs the version of the stock one.
"""

from typing import List

from hero_node import PLUS_ENCODER_MD5
from hero_node.files import HERO_PLUS, STOCK

from .correction_settings import CorrectionSettings
from .tick_odometry import WheelGeometry

DISTANCE = "/distance"
"""Topic below a robot's namespace that only HeRo+ declares."""


class ModelWatch:
    """The model of one robot, by its newest Encoder declaration; STOCK before that. Kept over reconnects."""

    def __init__(self, namespace: str, settings: CorrectionSettings) -> None:
        self.model = STOCK
        self._name = namespace.strip("/")
        self._settings = settings
        self._former: List[str] = []  # the models of its last two declarations, the older one first
        self.restart()

    def restart(self) -> None:
        """A new connection begins."""
        self._is_declared = self._has_distance = False

    def note_encoder(self, md5sum: str) -> None:
        """The robot declares an Encoder message of this md5."""
        self.model = HERO_PLUS if md5sum == PLUS_ENCODER_MD5 else STOCK
        self._former = [*self._former[-1:], self.model]
        self._is_declared = True

    def find_geometry(self) -> WheelGeometry:
        """Return the robot's wheels."""
        return self._settings.find_geometry(self._name, self.model)

    def find_conflict(self, name: str) -> str:
        """The robot declares the topic called name; return what contradicts its model, for users; empty: nothing."""
        self._has_distance |= name.endswith(DISTANCE)
        if not self._is_declared:
            return ""
        if self._former[0] != self.model:
            text = "it was a %s and is a %s now, by whose wheels its odometry goes on: two robots need two ids"
            return text % (self._former[0], self.model)
        own = self._settings.own_wheels.get(self._name)
        calibrated = "" if own is None else own.others.get("model", "")
        if calibrated not in ("", self.model):
            text = "it is a %s, but its calibration file says %s, whose wheels are not used: calibrate it again"
            return text % (self.model, calibrated)
        if self.model == STOCK and self._has_distance:
            return (
                "it declares the distance sensor of HeRo+ but the Encoder message of stock robots: if its encoders are"
                " those of HeRo+, its odometry is too short by two thirds; flash the firmware of HeRo+"
            )
        return ""
