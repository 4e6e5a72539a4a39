"""Fits the simulator to one robot, and tells how much better it predicts paths that the fit has not seen. Pure."""

from typing import Dict, List, NamedTuple

import numpy as np

from hero_client.values import WHEEL_SEPARATION_M

from .body_fit import fit_body
from .motor_fit import Motors, fit_motors, predict_ends
from .recording import Recording

HELD_OUT_SHARE = 1.0 / 3.0
"""The end of each recording, which the fit does not see."""

PATH_S = 5.0

NOISE_M = 0.005
"""Error at the ends of paths that noise makes: if a nominal robot is nearer, and a fit not better, it is one."""

MAX_DEVIATION = 0.15
"""Deviation of wheels and their distance from nominal ones beyond which a fit is refused; published odometry is off by
3 % of the path."""

SLIP = 0.02
"""Cannot be told from rolling less far: the usual one; what is lost by it, wheels roll farther."""

_SLIP_MEAN = float(np.sqrt(2.0 / np.pi))
"""Mean share of travel that is lost, by the sd that `slip` is."""


class Fit(NamedTuple):
    """The differences of one robot.

    Attributes:
        values: by key, as --error takes them.
        delay_s: how much later than in the simulator commands work.
        before_m, after_m: median error at the ends of held-out paths, of a nominal robot and of this one.
    """

    values: Dict[str, float]
    delay_s: float
    before_m: float
    after_m: float


def fit_robot(recordings: List[Recording]) -> Fit:
    """Return the differences of the robot of these recordings; a nominal one if that predicts them as well.

    Raises: ValueError if they tell too little, the fit predicts no better than a bad nominal one, or is implausible.
    """
    share = 1.0 - HELD_OUT_SHARE
    seen = [recording.cut(share) for recording in recordings]
    body, motors = fit_body(seen), fit_motors(seen)
    drawn = Motors({}), np.ones(3)
    ends_m = np.hstack(
        [predict_ends(recording, [drawn, (own, body)], share, PATH_S) for recording, own in zip(recordings, motors)]
    )
    if not ends_m.size:
        raise ValueError(f"too short: {recordings[0].time_s:.0f} s hold no path that the fit has not seen")
    before_m, after_m = np.median(ends_m, axis=1).tolist()
    if after_m >= before_m > NOISE_M:
        text = "held-out paths of %g s end %.1f mm off after the fit, %.1f mm before: nothing is told; drive longer"
        raise ValueError(text % (PATH_S, 1e3 * after_m, 1e3 * before_m))
    if after_m >= before_m:
        motors, body = [Motors({})], np.ones(3)
    _check_plausible(body)
    left_wheel, right_wheel = (body[:2] / (1.0 - SLIP * _SLIP_MEAN)).tolist()
    rolled = {"left_wheel": left_wheel, "right_wheel": right_wheel, "slip": SLIP}
    separation = {"wheel_separation_m": float(body[2]) * WHEEL_SEPARATION_M}
    return Fit({**motors[0].values, **rolled, **separation}, motors[0].delay_s, before_m, after_m)


def _check_plausible(body: np.ndarray) -> None:
    """Raise ValueError for wheels, or a distance between them, that no robot has."""
    for name, value, nominal, unit in zip(
        ("left wheel", "right wheel", "distance between the wheels"), body, (1.0, 1.0, 1e3 * WHEEL_SEPARATION_M),
        ("times the nominal one", "times the nominal one", "mm"),
    ):  # fmt: skip
        if abs(value - 1.0) > MAX_DEVIATION:
            text = "%s %.3g %s is implausible, more than %.0f %% off: did it touch walls, or do poses lag behind?"
            raise ValueError(text % (name, value * nominal, unit, 100.0 * MAX_DEVIATION))


def describe_fit(fit: Fit, robot_id: int) -> List[str]:
    """Return the lines of a robot in an error file: what was found as a remark, and its differences."""
    values = ",".join("%s=%.5g" % item for item in fit.values.items())
    ends = "held-out paths of %g s end %.1f mm off, before the fit %.1f mm"
    motors = "no servo pulses were recorded, so motors are nominal"
    if "lag_s" in fit.values:
        motors = f"commands work {1000.0 * fit.delay_s:.0f} ms later than in the simulator"
    remarks = [ends % (PATH_S, 1e3 * fit.after_m, 1e3 * fit.before_m), motors]
    if fit.after_m >= fit.before_m:
        remarks.insert(0, "nothing to correct: it drives as a nominal robot")
    return ["# hero_%d: %s" % (robot_id, remark) for remark in remarks] + ["robot=%d,%s" % (robot_id, values)]
