"""Worlds that differ in what a simulation assumes: the nominal one, each assumption by itself, and all together.

Figures: docs/simulator.md; lag, friction and traction are assumptions there, and these worlds ask what hangs on them.
"""

from typing import Any, Dict

_NOMINAL = {"errors": "perfect", "errors.friction": 0.0, "wifi": "ideal", "delay_s": 0.0}
_SLIPPERY = {"errors.wheel_friction": 0.4, "errors.wheel_load": 0.8}

NOMINAL, USUAL, WORST = "nominal", "usual", "worst"

WORLDS: Dict[str, Dict[str, Any]] = {
    NOMINAL: _NOMINAL,
    "friction": {**_NOMINAL, "errors.friction": 0.3},
    "strong friction": {**_NOMINAL, "errors.friction": 0.5},
    "weak traction": {**_NOMINAL, "errors.friction": 0.3, **_SLIPPERY},
    "slow motors": {**_NOMINAL, "errors.lag_s": 0.16},
    "unlike robots": {**_NOMINAL, "errors": 2.0},
    "late poses": {**_NOMINAL, "delay_s": 0.2},
    "bad radio": {**_NOMINAL, "wifi": "bad"},
    USUAL: {"errors": "default", "wifi": "router", "delay_s": 0.05},
    WORST: {**_SLIPPERY, "errors": 2.0, "errors.friction": 0.5, "errors.lag_s": 0.16, "wifi": "bad", "delay_s": 0.2},
}
"""Settings of an experiment by the name of the world."""

OF_PAPERS: Dict[str, Dict[str, Any]] = {
    "points": {**_NOMINAL, "body": "point"},
    "discs": {**_NOMINAL, "errors.lag_s": 0.001},
}
"""Robots as papers have them: points that move at once as they want, and discs whose wheels follow at once."""
