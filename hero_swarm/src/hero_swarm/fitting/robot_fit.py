"""Fits the simulator to one robot, and tells how much better it predicts paths that the fit has not seen. Pure."""

from typing import Dict, List, NamedTuple

import numpy as np

from hero_client.values.robot_constants import WHEEL_SEPARATION_M

from .body_fit import fit_body
from .motor_fit import fit_motors, predict_ends
from .recording import Recording
from .replay import Motors

__all__ = ["describe_fit", "fit_robot"]

HELD_OUT_SHARE = 1.0 / 3.0
"""The end of each recording, which the fit does not see."""

PATH_S = 5.0

SLIP = 0.02
"""Cannot be told from rolling less far: the usual one; what is lost by it, wheels roll farther."""


_SLIP_MEAN = float(np.sqrt(2.0 / np.pi))
"""Mean share of travel that is lost, by the sd that `slip` is."""


class Fit(NamedTuple):
    """The differences of one robot.

    Attributes:
        values: by key, as --error takes them.
        delay_s: how much later than in the simulator commands work.
        before_m, after_m: median error at the ends of held-out paths, of a robot as on the drawing and of this one.
    """

    name: str
    values: Dict[str, float]
    delay_s: float
    before_m: float
    after_m: float


def fit_robot(recordings: List[Recording]) -> Fit:
    """Return the differences of the robot of these recordings. Raises: ValueError if they tell too little."""
    share = 1.0 - HELD_OUT_SHARE
    body = fit_body([recording.cut(0.0, share * recording.time_s) for recording in recordings])
    motors = fit_motors(recordings, share)
    drawn = Motors({}), np.ones(3)
    ends_m = np.hstack([
        predict_ends(recording, [drawn, (own, body)], share, PATH_S) for recording, own in zip(recordings, motors)
    ])
    if not ends_m.size:
        raise ValueError("too short: %.0f s hold no path that the fit has not seen" % recordings[0].time_s)
    before_m, after_m = np.median(ends_m, axis=1).tolist()
    left_wheel, right_wheel = (body[:2] / (1.0 - SLIP * _SLIP_MEAN)).tolist()
    rolled = {"left_wheel": left_wheel, "right_wheel": right_wheel, "slip": SLIP}
    separation = {"wheel_separation_m": float(body[2]) * WHEEL_SEPARATION_M}
    values = {**motors[0].values, **rolled, **separation}
    return Fit(recordings[0].name, values, motors[0].delay_s, before_m, after_m)


def describe_fit(fit: Fit, robot_id: int) -> List[str]:
    """Return the lines of a robot in an error file: what was found as a remark, and its differences."""
    values = ",".join("%s=%.5g" % item for item in fit.values.items())
    ends = "held-out paths of %g s end %.1f mm off, before the fit %.1f mm"
    motors = "no servo pulses were recorded, so motors are as on the drawing"
    if "lag_s" in fit.values:
        motors = "commands work %.0f ms later than in the simulator" % (1e3 * fit.delay_s)
    return [
        "# %s: %s" % (fit.name, ends % (PATH_S, 1e3 * fit.after_m, 1e3 * fit.before_m)),
        "# %s: %s" % (fit.name, motors),
        "robot=%d,%s" % (robot_id, values),
    ]
