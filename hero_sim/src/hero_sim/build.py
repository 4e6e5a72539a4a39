"""A simulator that is ready to run, from options: arena, places, world, robots and connections."""

import argparse
import os
from typing import Callable, List, Tuple

import numpy as np

from .errors import OptionError
from .fault_injector import FaultInjector
from .faults import parse_fault
from .link.tcp_link import TcpLink
from .link.wifi import PROFILES, Radio
from .robot.firmware import Firmware, FirmwareOptions
from .robot.flash import NO_FLASH_DIR, Flash, check_folder, find_flash_dir, make_fingerprint
from .robot.ranges import FACTORY_CALIBRATION_COUNTS_M2, calibrate
from .simulator import Simulator
from .swarm import Swarm
from .world.arena import build_default, place_robots
from .world.arena_file import load_arena
from .world.body import Body
from .world.robot_errors import (
    SERVO_CENTER_US,
    RobotErrors,
    describe_robot,
    draw_errors,
    load_known,
    set_known,
)
from .world.world import World

__all__ = ["build_errors", "build_simulator", "build_swarm"]

BOOT_SPREAD_MS = 200
"""Robots that are started together come up within this time of each other."""

Report = Callable[[str], None]


class _Rngs:
    """One stream of random numbers for each purpose, so that one more draw here does not change all others."""

    def __init__(self, options: argparse.Namespace) -> None:
        def make(seed: int) -> np.random.RandomState:
            return np.random.RandomState(seed)

        seeds = make(options.seed).randint(0, 2**31 - 1, size=4 + 2 * options.count)
        self.places, self.world, self.boot, self.faults = map(make, seeds[:4])
        self.robots, self.radios = list(map(make, seeds[4::2])), list(map(make, seeds[5::2]))


def build_errors(options: argparse.Namespace) -> RobotErrors:
    """Return how the robots differ: drawn from the seed, then known errors put over it.

    Raises: OptionError for an error that cannot be set.
    """
    # By id, so that a robot is the same one in any swarm.
    ids = range(options.first_id, options.first_id + options.count)
    rngs = [np.random.RandomState([options.seed, robot_id % 2**32]) for robot_id in ids]
    errors = draw_errors(rngs, 0.0 if options.perfect else 1.0)
    if options.errors is not None:
        load_known(errors, options.first_id, options.errors)
    for text in options.error:
        set_known(errors, options.first_id, text)
    return errors


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
    robot_id = options.first_id + index
    flash = Flash(calibration_counts_m2, centers_us)
    if not options.flash_dir:
        # Another seed or another --error makes another robot, which has its own flash.
        body = [*describe_robot(errors, index), options.ir, options.motors]
        flash.keep_in(os.path.join(find_flash_dir(), "hero_%d-%s.json" % (robot_id, make_fingerprint(body))))
    elif options.flash_dir != NO_FLASH_DIR:
        check_folder(options.flash_dir)
        flash.keep_in(os.path.join(options.flash_dir, "hero_%d.json" % robot_id))
    return flash


def build_swarm(options: argparse.Namespace, addresses: List[str], report: Report) -> Swarm:
    """Return the swarm that options describe, switched on; addresses are those of the boot lines.

    Raises: OptionError for an arena in which the robots find no place.
    """
    rngs = _Rngs(options)
    arena = load_arena(options.arena) if options.arena else build_default(options.count)
    poses = place_robots(arena, options.count, rngs.places)
    errors = build_errors(options)
    world = World(arena, poses, rngs.world, errors)
    exact = options.firmware_odometry == "exact"
    robots: List[Firmware] = []
    for index, address in enumerate(addresses):
        body, flash = Body(world, index), _build_flash(options, errors, index)
        firmware_options = FirmwareOptions(options.imu_hat, exact, address)
        robot_id = options.first_id + index
        robots.append(Firmware(robot_id, body, flash, rngs.robots[index], firmware_options, report))
    kept = ", ".join(robot.name for robot in robots if robot.flash.is_from_file)
    if kept:
        report("%s: with the parameters of an earlier run (--flash-dir none begins anew)" % kept)
    swarm = Swarm(world, robots)
    swarm.switch_on(rngs.boot, BOOT_SPREAD_MS)
    return swarm


def _describe_start(options: argparse.Namespace, host: str) -> str:
    """Return what the robots are about to do, in one line."""
    first, last = options.first_id, options.first_id + options.count - 1
    who = "hero_%d" % first if first == last else "hero_%d .. hero_%d" % (first, last)
    if options.serve is None:
        return "%s: connecting to %s:%d" % (who, host, options.port)
    last_port = options.serve + options.count - 1
    ports = "%d" % last_port if first == last else "%d..%d" % (options.serve, last_port)
    return "%s: awaiting a driver on %s, port %s" % (who, host, ports)


def build_simulator(options: argparse.Namespace, report: Report) -> Tuple[Simulator, FaultInjector]:
    """Return the simulator that options describe, and the injector of its faults.

    Raises: OptionError for a host, port or arena that cannot be used.
    """
    serve = options.serve is not None
    host = options.host or ("0.0.0.0" if serve else "127.0.0.1")
    link = TcpLink(options.count, host, options.serve if serve else options.port, serve, options.first_id)
    try:
        swarm = build_swarm(options, link.own_addresses, report)
        rngs = _Rngs(options)
        radios = [Radio(PROFILES[options.wifi], rng) for rng in rngs.radios]
        simulator = Simulator(swarm, link, radios, report, options.speed)
        injector = FaultInjector(simulator, rngs.faults, report)
        for text in options.fault:
            injector.add(parse_fault(text))
    except OptionError:
        link.close_all()
        raise
    report(_describe_start(options, host))
    return simulator, injector
