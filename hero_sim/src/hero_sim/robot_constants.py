"""The firmware's own limits and watchdogs, beside hero_node.robot_constants. Source: config.h and the files named."""

MAX_ID = 2**31 - 1
"""Largest id of hero_msgs/Robot."""

VELOCITY_LIMIT_US = 250.0
POSITION_LIMIT_US = 130.0
"""Limit of each controller's PID output, from the center."""

COMMAND_GAP_MS = 50
"""A Twist that arrives earlier after its controller's watchdog was set is dropped, a zero too
(VelocityControl.ino:159). An accepted motion sets the watchdog, and self-tuning sets it in every run."""

VELOCITY_WATCHDOG_MS = 1000
POSITION_WATCHDOG_MS = 3000
"""A controller runs until this long after its watchdog was set (VelocityControl.ino:110, PositionControl.ino:105).

The watchdog is 0 at boot and after a zero: in its first 3 s of uptime a robot's position controller always runs.
"""

MOTOR_WATCHDOG_MS = 1000
"""The motors keep their pulse for this long after the last write (MotorDriver.ino:111)."""

LED_WATCHDOG_MS = 15000
"""The light goes out this long after the last command (LEDStatus.ino:76)."""

CONNECT_TIMEOUT_MS = 5000
"""WiFiClient's limit for a connect or a write, which block the firmware's loop."""

TIME_LOST_MS = 11000
"""Without an answer to its time requests a robot stops streaming after this (SYNC_SECONDS 5 * 2200, node_handle.h)."""

RECEIVE_WINDOW_LENGTH = 2144
"""Bytes that the ESP8266's TCP takes before the program reads them; the rest waits at the sender."""

MAX_PARAMETER = 1e30
"""Numbers beyond it are refused, as is NaN: what a robot does with them is unknown."""
