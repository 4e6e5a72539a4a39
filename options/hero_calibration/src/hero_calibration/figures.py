"""Draws the calibration of one robot: its servos, and its wheels and ranges before and after."""

from typing import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .models.dead_zone import NOMINAL_CENTER_US
from .models.infrared_model import BEAMS, name_beam
from .models.step_response import STEP_M_S
from .procedures.infrared import InfraredResult
from .procedures.motors import MotorResult
from .procedures.velocity import VelocityResult

_LEFT, _RIGHT, _GRAY = "#0072B2", "#D55E00", "0.55"  # two of Okabe and Ito's palette
_WHEELS = (("left", _LEFT), ("right", _RIGHT))


def draw_robot(name: str, results: Sequence[object]) -> Figure:
    """Return the figure of a robot, with a diagram for each result."""
    figure = Figure(figsize=(4.4 * len(results), 3.8), constrained_layout=True)
    figure.suptitle(name, fontweight="bold")
    for axes, result in zip(figure.subplots(1, len(results), squeeze=False)[0], results):
        axes.grid(color="0.9", linewidth=0.5)
        if isinstance(result, MotorResult):
            _draw_motors(axes, result)
        elif isinstance(result, VelocityResult):
            _draw_velocity(axes, result)
        elif isinstance(result, InfraredResult):
            _draw_ranges(axes, result)
        axes.legend(fontsize=7)
    return figure


def _draw_motors(axes: Axes, result: MotorResult) -> None:
    for pulses, speeds, zone, (wheel, color) in zip(result.pulses_us, result.speeds_m_s, result.zones, _WHEELS):
        axes.plot(pulses, speeds, ".-", color=color, linewidth=0.8, markersize=4, label=wheel)
        axes.axvspan(zone.low_us, zone.high_us, color=color, alpha=0.12)
        axes.axvline(zone.center_us, color=color, linewidth=1.2, label=f"center {zone.center_us:.0f} us")
    axes.axvline(NOMINAL_CENTER_US, color=_GRAY, linestyle=":", label="nominal %d us" % NOMINAL_CENTER_US)
    axes.set_title("Servos: dead zones", fontsize=9)
    axes.set_xlabel("pulse (us)")
    axes.set_ylabel("speed of the wheel (m/s)")


def _draw_velocity(axes: Axes, result: VelocityResult) -> None:
    for responses, style, when in ((result.before, ":", "before"), (result.after, "-", "after")):
        for response, (wheel, color) in zip(responses, _WHEELS):
            label = f"{wheel}, {when}: mean error {100.0 * response.mean_error:.0f} %"
            for times_s, speeds_m_s in response.curves:
                axes.plot(times_s, speeds_m_s, style, color=color, linewidth=1.0, label=label)
                label = ""
    axes.axhline(STEP_M_S, color=_GRAY, linewidth=0.8)
    axes.set_title("Wheels: step response", fontsize=9)
    axes.set_xlabel("time since the command (s)")
    axes.set_ylabel("speed, both directions (m/s)")


def _draw_ranges(axes: Axes, result: InfraredResult) -> None:
    sensors = np.arange(BEAMS)
    for errors_m, marker, color, label in (
        (result.before_m, "o", _GRAY, "before"),
        (result.after_m, "D", _LEFT, "after"),
    ):
        known = np.isfinite(errors_m)
        # A sensor without a calibration has no range.
        label += "" if known.any() else ": no calibration"
        axes.plot(sensors[known], errors_m[known] * 1e3, marker, color=color, markersize=5, label=label)
    axes.axhline(0.0, color=_GRAY, linewidth=0.8)
    axes.set_xticks(sensors)
    axes.set_xticklabels([name_beam(index).replace(" ", "\n") for index in sensors], fontsize=7)
    axes.set_title("Infrared: range error at 10 cm", fontsize=9)
    axes.set_ylabel("range too far (mm)")
