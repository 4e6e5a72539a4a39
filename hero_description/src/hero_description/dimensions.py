"""Every length and mass of the robot, once, with its source.

Lengths in m, masses in kg. Source of what is published: the robot's own transforms and the constants of its
firmware (v3.8), and the data that the robot's authors published. "shape" marks what is only for the eye: it was
chosen so that the parts fit together, and nothing depends on it.
"""

from typing import NamedTuple, Tuple

BODY_DIAMETER_M = 0.0737  # published; the firmware adds half of it, 0.0368, to every infrared range
WHEEL_SEPARATION_M = 0.063  # published; the firmware's own transforms put the wheels at y = +-0.0315
WHEEL_DIAMETER_M = 0.0492  # published; odometry is made with it
WHEEL_AXLE_Z_M = 0.01548  # the firmware's own transforms, base_link to the wheels
HAT_XYZ_M = (-0.00245, -0.00216, 0.051)  # the firmware's own transforms: the board with light and IMU
LASER_XYZ_M = (0.0, 0.0, 0.051)  # the firmware's own transforms
MASS_KG = 0.156  # published: one robot on the scales, with battery
SENSOR_COUNT = (
    8  # infrared sensors, every 45 degrees, counter-clockwise; index 4 of the driver's scan is ahead
)

WHEEL_WIDTH_M = 0.006  # shape
BODY_BOTTOM_M = -0.004  # shape: lowest point of the body above base_link's origin
BODY_HEIGHT_M = 0.050  # shape: up to just below the hat
DECK_THICKNESS_M = 0.002  # shape
HAT_DIAMETER_M = 0.060  # shape
LIGHT_DIAMETER_M = 0.012  # shape
SENSOR_SIZE_M = (0.004, 0.0102, 0.0058)  # TCRT5000 data sheet: 10.2 x 5.8 mm face; depth is shape
SENSOR_Z_M = 0.012  # shape
CASTER_DIAMETER_M = 0.008  # shape


class Inertia(NamedTuple):
    """Mass, and moments of inertia about the axes of the link, from its middle of mass."""

    mass_kg: float
    xx_kg_m2: float
    yy_kg_m2: float
    zz_kg_m2: float
    middle_m: Tuple[float, float, float] = (0.0, 0.0, 0.0)


# Published in the model that the robot's authors simulate it with. They are less than MASS_KG together, and are kept
# as they are, so that results can be compared. The wheels' own axis is y.
BASE_INERTIA = Inertia(0.090, 5.925e-05, 5.5125e-05, 5.925e-05, (0.0, 0.0002, 0.0))
HAT_INERTIA = Inertia(0.010, 3.39583333333e-06, 3.39583333333e-06, 6.125e-06)
WHEEL_INERTIA = Inertia(0.020, 1.61583333333e-06, 3.125e-06, 1.61583333333e-06)
LASER_INERTIA = Inertia(1e-05, 1e-06, 1e-06, 1e-06)

GROUND_Z_M = WHEEL_AXLE_Z_M - WHEEL_DIAMETER_M / 2
"""Where the wheels touch the ground, in base_link: the robot's frame lies a little above the ground."""
