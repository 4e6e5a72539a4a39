"""A simulator that is ready to run, from options: arena, places, world, robots and connections."""

import argparse
import os
from typing import Callable, List, Tuple

import numpy as np

from .errors import OptionError
from .faults import FaultInjector
from .link.tcp_link import TcpLink
from .population import build_radios, build_world, draw_seeds, draw_servo_timing
from .robot.firmware import Firmware
from .robot.flash import Flash
from .robot.models import parse_models
from .robot.ranges import FACTORY_CALIBRATION_COUNTS_M2, calibrate
from .simulator import Simulator
from .swarm import Swarm
from .world.body import Body, SharedReadings
from .world.robot_errors import SERVO_CENTER_US, RobotErrors

BOOT_SPREAD_MS = 200
"""Robots that are started together come up within this time of each other."""

Report = Callable[[str], None]


def _build_flash(options: argparse.Namespace, errors: RobotErrors, index: int) -> Flash:
    calibration_counts_m2 = {
        "calibrated": calibrate(errors.alpha_counts_m2[index], errors.beta_counts[index]).tolist(),
        "factory": [FACTORY_CALIBRATION_COUNTS_M2] * 8,
        "erased": [float("nan")] * 8,
    }[options.ir]
    centers_us = {
        "calibrated": np.rint(errors.servo_center_us[index]).tolist(),
        "factory": [SERVO_CENTER_US] * 2,
    }[options.motors]
    flash = Flash(calibration_counts_m2, centers_us)
    if options.flash_dir is not None:
        flash.keep_in(os.path.join(options.flash_dir, "hero_%d.json" % (options.first_id + index)))
    return flash


def build_swarm(options: argparse.Namespace, addresses: List[str], report: Report) -> Swarm:
    """Return the swarm that options describe, switched on; addresses are those of the boot lines.

    Raises: OptionError for an arena in which the robots find no place.
    """
    seeds, world = draw_seeds(options), build_world(options)
    boot_rng = np.random.RandomState(seeds["boot"])
    models = parse_models(options.model, options.first_id, options.count)
    infrared = SharedReadings(world)
    robots: List[Firmware] = []
    for index, (address, model, seed) in enumerate(zip(addresses, models, seeds["robots"])):
        body, flash = Body(world, index, infrared), _build_flash(options, world.errors, index)
        robot_id, rng = options.first_id + index, np.random.RandomState(seed)
        timing = draw_servo_timing(options, robot_id)
        robots.append(Firmware(robot_id, body, flash, rng, address, options.imu_hat, timing, report, model))
        robots[index].switch_on(world.time_ms + int(boot_rng.randint(BOOT_SPREAD_MS)))
    return Swarm(world, robots)


def build_simulator(options: argparse.Namespace, report: Report) -> Tuple[Simulator, FaultInjector]:
    """Return the simulator that options describe, and the injector of its faults.

    Raises: OptionError for a host, port or arena that cannot be used.
    """
    link = TcpLink(options.count, options.host, options.port, options.first_id)
    try:
        swarm = build_swarm(options, link.own_addresses, report)
        simulator = Simulator(swarm, link, build_radios(options), report, options.speed)
        injector = FaultInjector(simulator, report)
        for fault in options.fault:
            injector.add(fault)
    except (OptionError, OSError):
        link.close_all()
        raise
    names = [robot.name for robot in simulator.swarm.robots]
    who = names[0] if len(names) == 1 else f"{names[0]} .. {names[-1]}"
    report("%s: connecting to %s:%d" % (who, options.host, options.port))
    return simulator, injector
