"""Services of hero_msgs that the stock package has, too."""

from hero_msgs.srv import (
    SetFrequency,
    SetFrequencyRequest,
    SetFrequencyResponse,
    SetIRCalibration,
    SetIRCalibrationRequest,
    SetIRCalibrationResponse,
    SetMotor,
    SetMotorRequest,
    SetMotorResponse,
    SetOdom,
    SetOdomRequest,
    SetOdomResponse,
    SetPID,
    SetPIDRequest,
    SetPIDResponse,
)

__all__ = [
    "SetFrequency",
    "SetFrequencyRequest",
    "SetFrequencyResponse",
    "SetIRCalibration",
    "SetIRCalibrationRequest",
    "SetIRCalibrationResponse",
    "SetMotor",
    "SetMotorRequest",
    "SetMotorResponse",
    "SetOdom",
    "SetOdomRequest",
    "SetOdomResponse",
    "SetPID",
    "SetPIDRequest",
    "SetPIDResponse",
]
