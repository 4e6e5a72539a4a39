"""Options -> a simulator that is ready to run: arena, places, world, robots and connections."""

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
from .simulator import Simulator
from .swarm import Swarm
from .world import arena as arenas
from .world.arena_file import load_arena
from .world.body import Body
from .world.range_sensors import FACTORY_CALIBRATION_COUNTS_M2, calibrate
from .world.robot_errors import (
    SERVO_CENTRE_US,
    RobotErrors,
    describe_robot,
    draw_errors,
    load_known,
    set_known,
)
from .world.world import World

BOOT_SPREAD_MS = 200
"""Robots that are started together come up within this time of each other."""


_SEEDS_BEFORE_ROBOTS = 4
_SEEDS_PER_ROBOT = 2


def draw_seeds(options: argparse.Namespace) -> np.ndarray:
    """Return the seeds of all streams of chance: places, world, boot times, faults, then two per robot."""
    size = _SEEDS_BEFORE_ROBOTS + _SEEDS_PER_ROBOT * options.count
    return np.random.RandomState(options.seed).randint(0, 2**31 - 1, size=size)


def _build_flash(options: argparse.Namespace, errors: RobotErrors, index: int) -> Flash:
    calibration_counts_m2 = {
        "calibrated": calibrate(errors.alpha_counts_m2[index], errors.beta_counts[index]).tolist(),
        "factory": [FACTORY_CALIBRATION_COUNTS_M2] * 8,
        "erased": [float("nan")] * 8,
    }[options.ir]
    centres_us = {
        "calibrated": np.rint(errors.servo_centre_us[index]).tolist(),
        "factory": [SERVO_CENTRE_US] * 2,
    }[options.motors]
    robot_id = options.first_id + index
    flash = Flash(calibration_counts_m2, centres_us)
    if not options.flash_dir:
        # Another seed or another --error makes another robot, which has a flash of its own.
        body = describe_robot(errors, index) + [options.ir, options.motors]
        flash.keep_in(os.path.join(find_flash_dir(), "hero_%d-%s.json" % (robot_id, make_fingerprint(body))))
    elif options.flash_dir != NO_FLASH_DIR:
        check_folder(options.flash_dir)
        flash.keep_in(os.path.join(options.flash_dir, "hero_%d.json" % robot_id))
    return flash


def build_errors(options: argparse.Namespace) -> RobotErrors:
    """Return how the robots that options describe differ: drawn from the seed, then what is known put over it.

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


def build_swarm(options: argparse.Namespace, addresses: List[str], report: Callable[[str], None]) -> Swarm:
    """Return the swarm that options describe, switched on.

    Raises: OptionError for an arena in which the robots find no place.
    """
    # One stream of chance for each purpose, so that one more draw here does not change everything there.
    seeds = draw_seeds(options)
    try:
        arena = load_arena(options.arena) if options.arena else arenas.build_default(options.count)
        poses = arenas.place_robots(arena, options.count, np.random.RandomState(seeds[0]))
    except arenas.ArenaError as error:
        raise OptionError(str(error)) from error
    errors = build_errors(options)
    world = World(arena, poses, np.random.RandomState(seeds[1]), errors)
    exact = options.firmware_odometry == "exact"
    robots: List[Firmware] = []
    for index in range(options.count):
        flash = _build_flash(options, errors, index)
        robots.append(
            Firmware(
                options.first_id + index,
                Body(world, index),
                flash,
                np.random.RandomState(seeds[_SEEDS_BEFORE_ROBOTS + _SEEDS_PER_ROBOT * index]),
                FirmwareOptions(options.imu_hat, exact, addresses[index]),
                report,
            )
        )
    remembering = ["hero_%d" % robot.robot_id for robot in robots if robot.flash.is_from_file]
    if remembering:
        report(
            "%s: with the parameters of an earlier run (--flash-dir none begins anew)" % ", ".join(remembering)
        )
    swarm = Swarm(world, robots)
    swarm.switch_on(np.random.RandomState(seeds[2]), BOOT_SPREAD_MS)
    return swarm


def describe_start(options: argparse.Namespace, host: str) -> str:
    """Return what the robots are about to do, in one line."""
    first, last = options.first_id, options.first_id + options.count - 1
    who = "hero_%d" % first if first == last else "hero_%d .. hero_%d" % (first, last)
    if options.serve is None:
        return "%s: dialling %s:%d" % (who, host, options.port)
    ports = (
        "%d" % options.serve if first == last else "%d..%d" % (options.serve, options.serve + last - first)
    )
    return "%s: awaiting a driver on %s, port %s" % (who, host, ports)


def build_simulator(options: argparse.Namespace, report: Callable[[str], None]) -> Tuple[Simulator, FaultInjector]:
    """Return the simulator that options describe, and what takes faults for its robots.

    Raises: OptionError for a host, port or arena that cannot be used.
    """
    serve = options.serve is not None
    host = options.host or ("0.0.0.0" if serve else "127.0.0.1")
    link = TcpLink(options.count, host, options.serve if serve else options.port, serve, options.first_id)
    try:
        swarm = build_swarm(options, link.own_addresses, report)
    except OptionError:
        link.close_all()
        raise
    seeds = draw_seeds(options)
    radios = [
        Radio(PROFILES[options.wifi], np.random.RandomState(seed))
        for seed in seeds[_SEEDS_BEFORE_ROBOTS + 1 :: _SEEDS_PER_ROBOT]
    ]
    simulator = Simulator(swarm, link, radios, report, options.speed)
    injector = FaultInjector(simulator, np.random.RandomState(seeds[3]), report)
    try:
        for text in options.fault:
            injector.add(parse_fault(text))
    except OptionError:
        link.close_all()
        raise
    report(describe_start(options, host))
    return simulator, injector
