"""Options -> a simulator that is ready to run: arena, places, world, robots and connections."""

import argparse
from typing import Callable, List

import numpy as np

from . import arena as arenas
from .errors import OptionError
from .firmware import Firmware, FirmwareOptions
from .flash import Flash
from .motor_control import Body
from .range_sensors import calibrate
from .simulator import Simulator
from .swarm import Swarm
from .tcp_link import TcpLink
from .world import World

BOOT_SPREAD_MS = 200
"""Robots that are started together come up within this time of each other."""


def build_swarm(options: argparse.Namespace, address: str, report: Callable[[str], None]) -> Swarm:
    """Return the swarm that options describe, switched on.

    Raises: OptionError for an arena in which the robots find no place.
    """
    # One stream of chance for each purpose, so that one more draw here does not change everything there.
    seeds = np.random.RandomState(options.seed).randint(0, 2**31 - 1, size=3 + options.robots)
    try:
        arena = arenas.build_default(options.robots)
        poses = arenas.place_robots(arena, options.robots, np.random.RandomState(seeds[0]))
    except arenas.ArenaError as error:
        raise OptionError(str(error)) from error
    world = World(arena, poses, np.random.RandomState(seeds[1]))
    firmware_options = FirmwareOptions(options.imu_hat, options.firmware_odometry == "exact", address)
    robots: List[Firmware] = []
    for index in range(options.robots):
        flash = Flash(calibrate(world.alpha_counts_m2[index]).tolist())
        robots.append(
            Firmware(
                options.first_id + index,
                Body(world, index),
                flash,
                np.random.RandomState(seeds[3 + index]),
                firmware_options,
                report,
            )
        )
    swarm = Swarm(world, robots)
    swarm.switch_on(np.random.RandomState(seeds[2]), BOOT_SPREAD_MS)
    return swarm


def build_simulator(options: argparse.Namespace, report: Callable[[str], None]) -> Simulator:
    """Return the simulator that options describe.

    Raises: OptionError for a host, port or arena that cannot be used.
    """
    serve = options.serve is not None
    host = options.host or ("0.0.0.0" if serve else "127.0.0.1")
    link = TcpLink(options.robots, host, options.serve if serve else options.port, serve)
    try:
        swarm = build_swarm(options, link.find_own_address(), report)
    except OptionError:
        link.close_all()
        raise
    last = options.first_id + options.robots - 1
    who = "hero_%d" % last if options.robots == 1 else "hero_%d .. hero_%d" % (options.first_id, last)
    if serve:
        report("%s: each awaits a driver, on %s, ports %d..%d" % (who, host, options.serve, options.serve + options.robots - 1))
    else:
        report("%s: dialling %s:%d" % (who, host, options.port))
    return Simulator(swarm, link, report)
