"""Dimensions, limits and times of the HeRo and its firmware, each once, with its source."""

BODY_RADIUS_M = 0.036835
"""RangeSensor.ino:66; ranges count from the robot's center."""

WHEEL_DIAMETER_M = 0.0492
WHEEL_SEPARATION_M = 0.063
TICKS_PER_TURN = 288.0
"""Encoder ticks per turn of a wheel."""

MAX_WHEEL_SPEED_M_S = 1.0
"""Faster than any servo of the robot."""

MIN_RIM_RANGE_M = 0.01
"""The firmware's clamp, from the body's rim (RangeSensor.ino:123)."""

MAX_RIM_RANGE_M = 0.20
"""The firmware's range_max, from the body's rim; ranges beyond it stand for nothing in range."""

STOCK_BEAMS = 16
"""Ranges of a stock laser message; the odd ones are averages."""

SCAN_TIME_S = 0.2
"""RangeSensor's rate is 5 Hz; it leaves scan_time zero."""

MIN_DISTANCE_M = 0.04
MAX_DISTANCE_M = 2.9
"""Range of HeRo+'s VL53L1X in its medium mode, in the dark (data sheet)."""

DISTANCE_CONE_RAD = 0.26
"""Its field of view with the 4 x 4 detectors that the firmware uses (15 degrees, ST UM2555)."""

SERVO_CENTER_US = 1500
"""Servo pulse at which a wheel stops, up to the servo's own center."""

PULSE_RANGE_US = (1000, 2000)
"""Shortest and longest servo pulse."""

MAX_WATCHDOG_S = 4.0
"""After this time without a command the robot stops by itself (PositionControl.ino:105, MotorDriver.ino:111)."""
