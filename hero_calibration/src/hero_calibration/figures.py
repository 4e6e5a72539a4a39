"""What was measured of one robot -> a picture: servos, wheels before and after, ranges before and after."""

from typing import List, Optional

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from . import dead_zone, infrared, speed_response
from .procedures import InfraredResult, MotorResult, VelocityResult

_LEFT, _RIGHT, _GREY = "#0072B2", "#D55E00", "0.55"  # two of Okabe and Ito's palette


def draw_robot(
    name: str,
    motors: Optional[MotorResult],
    velocity: Optional[VelocityResult],
    ranges: Optional[InfraredResult],
) -> Figure:
    """Return the picture of a robot, with a diagram for each part that was measured."""
    parts: List[object] = [part for part in (motors, velocity, ranges) if part is not None]
    figure = Figure(figsize=(4.4 * max(1, len(parts)), 3.8), layout="constrained")
    figure.suptitle(name, fontweight="bold")
    for axes, part in zip(figure.subplots(1, max(1, len(parts)), squeeze=False)[0], parts):
        axes.grid(color="0.9", linewidth=0.5)
        if isinstance(part, MotorResult):
            _draw_motors(axes, part)
        elif isinstance(part, VelocityResult):
            _draw_velocity(axes, part)
        elif isinstance(part, InfraredResult):
            _draw_ranges(axes, part)
        axes.legend(fontsize=7)
    return figure


def _draw_motors(axes: Axes, result: MotorResult) -> None:
    for speeds, zone, colour, wheel in zip(
        result.speeds_m_s, result.zones, (_LEFT, _RIGHT), ("left", "right")
    ):
        axes.plot(result.pulses_us, speeds, ".-", color=colour, linewidth=0.8, markersize=4, label=wheel)
        axes.axvspan(zone.low_us, zone.high_us, color=colour, alpha=0.12)
        axes.axvline(zone.centre_us, color=colour, linewidth=1.2, label="centre %.0f us" % zone.centre_us)
    axes.axvline(
        dead_zone.NOMINAL_CENTRE_US,
        color=_GREY,
        linestyle=":",
        label="nominal %d us" % dead_zone.NOMINAL_CENTRE_US,
    )
    axes.set_title("Servos: where the wheels stand", fontsize=9)
    axes.set_xlabel("pulse (us)")
    axes.set_ylabel("speed of the wheel (m/s)")


def _draw_velocity(axes: Axes, result: VelocityResult) -> None:
    for responses, style, when in ((result.before, ":", "before"), (result.after, "-", "after")):
        for response, colour, wheel in zip(responses, (_LEFT, _RIGHT), ("left", "right")):
            for number, (times_s, speeds_m_s) in enumerate(response.curves):
                label = "%s, %s: %.0f %% off" % (wheel, when, 100.0 * response.mean_error)
                axes.plot(
                    times_s, speeds_m_s, style, color=colour, linewidth=1.0, label=None if number else label
                )
    axes.axhline(speed_response.STEP_M_S, color=_GREY, linewidth=0.8)
    axes.set_title("Wheels: speed after a start from rest", fontsize=9)
    axes.set_xlabel("time since the command (s)")
    axes.set_ylabel("speed, both directions (m/s)")


def _draw_ranges(axes: Axes, result: InfraredResult) -> None:
    sensors = np.arange(infrared.BEAMS)
    for errors_m, marker, colour, when in (
        (result.before_m, "o", _GREY, "before"),
        (result.after_m, "D", _LEFT, "after"),
    ):
        known = np.isfinite(errors_m)
        # A sensor without a calibration has no range; the legend says so.
        label = when if known.any() else when + ": no calibration"
        axes.plot(sensors[known], errors_m[known] * 1e3, marker, color=colour, markersize=5, label=label)
    axes.axhline(0.0, color=_GREY, linewidth=0.8)
    axes.set_xticks(sensors, [infrared.name_beam(index).replace(" ", "\n") for index in sensors], fontsize=7)
    axes.set_title("Infrared: error of the range at 10 cm", fontsize=9)
    axes.set_ylabel("range too far (mm)")
