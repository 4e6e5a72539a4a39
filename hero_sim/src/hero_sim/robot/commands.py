"""Effects of the server's packets on a robot, and responses of its services.

Pure. Texts and behavior are the firmware's (files named in messages and flash); ids as declared.
"""

import struct
from functools import partial
from typing import Callable, Dict, Optional, Tuple

from hero_driver.rosserial import packets
from hero_node import Pose

from ..errors import CommandError
from ..robot_constants import MAX_PARAMETER
from . import messages
from .flash import Flash
from .models import HERO, RobotModel
from .motor_control import Controller, MotorControl
from .sensing import Sensing

PULSES_US = 500
"""Time that writing pulses blocks the loop (MotorDriver.ino: measured as 500 us per cmd_motor)."""

STOP_US = 1000
LIGHT_US = 1000
"""The same for switching the motors off, and for setting the light."""

_TWIST = "<d32xd"  # linear.x (m/s) and angular.z (rad/s); the firmware uses no other

Answer = Tuple[bool, str]
"""Answer of a service: success and message."""


class CommandTable:
    """The callbacks of one robot, by the ids of what it receives.

    Attributes:
        blocked_us: how long the last callback blocked the robot's loop.
    """

    def __init__(
        self,
        name: str,
        sensing: Sensing,
        motors: MotorControl,
        flash: Flash,
        log: Callable[[str], None],
        warn: Callable[[str], None],
        model: RobotModel = HERO,
    ) -> None:
        """Serve the parts of the robot called name; log takes lines for the server, warn lines for users."""
        self._name = name
        self._sensing = sensing
        self._motors = motors
        self._flash = flash
        self._log = log
        self._warn = warn
        self._now_ms = 0
        self.blocked_us = 0
        callbacks: Dict[str, Tuple[str, Callable[..., Optional[Answer]]]] = {
            # layout of the message or request, in the order of its fields, and what it does
            "led": ("<4f", self._set_light),
            "laser_enable": ("<?", self._enable_laser),
            "ir_calibration": ("<8d", self._calibrate_ir),
            "set_odom": ("<3d", self._set_odom),
            "cmd_motor": ("<2h", self._drive_motors),
            "motors_parameters": ("<2h", self._set_motors),
        }
        for kind, controller in (("position", motors.position), ("velocity", motors.velocity)):
            callbacks[kind + "_controller/cmd_vel"] = (_TWIST, partial(self._drive, controller))
            callbacks[kind + "_controller/pid_parameters"] = ("<6f", partial(self._set_gains, controller))
            callbacks[kind + "_controller/pid_calibration"] = ("", partial(self._tune, controller))
        received_ids, sent_ids = model.received_ids, model.sent_ids
        self._callbacks = {
            received_ids[topic.key]: (topic.message_type, sent_ids.get(topic.key, 0), *callbacks[topic.key])
            for topic in model.topics
            if topic.key in received_ids
        }

    def receive(self, packet: packets.Packet, now_ms: int) -> Optional[bytes]:
        """Execute packet at now_ms of the robot; return a service's answer, as a packet.

        Raises: CommandError for a payload that is not the declared message, or numbers that no robot computes with.
        """
        self._now_ms = now_ms
        self.blocked_us = 0
        if packet.topic_id not in self._callbacks:
            return None  # The slots without a subscriber are empty: the firmware ignores them.
        message_type, answer_id, layout, callback = self._callbacks[packet.topic_id]
        length, expected_length = len(packet.payload), struct.calcsize(layout)
        if length != expected_length:
            text = "%s has %d bytes instead of %d"
            raise CommandError(text % (message_type, length, expected_length))
        values = struct.unpack(layout, packet.payload)
        if not all(abs(value) < MAX_PARAMETER for value in values):
            text = "%s with %s, with which a real robot would do anything"
            raise CommandError(text % (message_type, list(values)))
        answer = callback(*values)
        if answer is None:
            return None
        return packets.encode_packet(answer_id, messages.encode_answer(*answer))

    def _set_light(self, *color: float) -> None:
        self._sensing.set_light(self._now_ms, color)
        self.blocked_us = LIGHT_US

    def _enable_laser(self, is_enabled: bool) -> None:
        self._sensing.laser_enabled = is_enabled

    def _drive(self, controller: Controller, linear_m_s: float, angular_rad_s: float) -> None:
        # The robot's ros_lib reads a float64 into single precision (deserializeAvrFloat64).
        twist = messages.round_to_float32((linear_m_s, angular_rad_s))
        if self._motors.receive_twist(controller, self._now_ms, *twist):
            self.blocked_us = STOP_US

    def _drive_motors(self, left_us: int, right_us: int) -> None:
        self._motors.receive_pulses(self._now_ms, left_us, right_us)
        self.blocked_us = PULSES_US

    def _calibrate_ir(self, *calibration_counts_m2: float) -> Answer:
        self._flash.ir_calibration_counts_m2 = list(calibration_counts_m2)
        return self._record("IR calibration parameters have been successfully recorded!")

    def _set_odom(self, x_m: float, y_m: float, yaw_rad: float) -> Answer:
        self._sensing.set_odometry(Pose(x_m, y_m, yaw_rad))
        self._log("[HERO] Odometry was changed!")
        return True, "Odometry was changed!"

    def _set_motors(self, *centers_us: int) -> Answer:
        self._flash.motor_centers_us = [float(center_us) for center_us in centers_us]
        self._motors.motors.centers_us = list(centers_us)
        return self._record("Motor Parameters has been succesfully recorded!")

    def _record(self, text: str) -> Answer:
        self._save_flash()
        self._log(text)
        return True, text

    def _set_gains(self, controller: Controller, *gains: float) -> Answer:
        text = "PID Parameters has been succesfully recorded!"
        controller.set_gains(gains)
        self._log_green("Left  Motor PID = [%f, %f, %f]" % gains[:3])
        self._log_green("Right Motor PID = [%f, %f, %f]" % gains[3:])
        self._log_green("Recording values in the flash... ")
        self._save_flash()
        self._log_green(text + " ")
        return True, text

    def _save_flash(self) -> None:
        """Write the flash; where that fails, the robot uses its new parameters, and an error is reported."""
        try:
            self._flash.save()
        except CommandError as error:
            self._warn(str(error))

    def _log_green(self, text: str) -> None:
        self._log(f"\x1b[92m[/{self._name}] {text}\x1b[0m")

    def _tune(self, controller: Controller) -> Answer:
        self._motors.start_tuning(controller, self._now_ms)
        self.blocked_us = PULSES_US
        # The firmware never sets success here (VelocityControl.ino:229-245).
        return False, "PID Autotuning!"
