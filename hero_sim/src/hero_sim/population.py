"""Which robots a simulator has, from its options: their number, differences, arena and places. Pure.

The same options give the same robots behind sockets and stepped in process.
"""

import argparse
import copy
import numbers
from typing import Any, Dict, List, Optional, Sequence

import numpy as np

from hero_node.parameters import within

from .errors import OptionError
from .faults import MAX_DURATION_S
from .link.wifi import PROFILES, Radio, build_network, parse_wifi
from .robot.models import build_body, parse_models
from .robot.servo_pins import CORE_2, CORE_3
from .robot_constants import MAX_ID
from .world.arena import Arena, build_default, place_robots
from .world.arena_file import load_arena
from .world.pushing.shapes import PushedBody
from .world.robot_errors import RobotErrors, draw_errors, read_known, set_known
from .world.world import World

MAX_ROBOTS = 1000

_DRAWN = "drawn"
SERVO_TIMINGS = (CORE_2, CORE_3, _DRAWN)
"""Servo timing of all robots, or one of the two for each: which core real robots carry is not known."""


def draw_seeds(options: argparse.Namespace) -> Dict[str, Any]:
    """Return a seed for each purpose, so that one more draw does not change all others; of robots and radios (N,)."""
    seeds = _reseed(options.seed).randint(0, 2**31 - 1, size=3 + 2 * options.count)
    return dict(zip(("places", "world", "boot"), seeds), robots=seeds[3::2], radios=seeds[4::2])


_SCRATCH = np.random.RandomState(0)


def _reseed(seed: Any) -> np.random.RandomState:
    """Return a stream for draws that are done before the next call: far faster than a new one."""
    _SCRATCH.seed(seed)
    return _SCRATCH


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that programs with simulated robots share."""
    add = parser.add_argument
    add("--count", type=int, default=1, metavar="N", help="number of robots (%(default)s)")
    add("--seed", type=int, default=0, help="seed of all random numbers (%(default)s)")
    add("--arena", metavar="FILE", help="YAML file, or empty, obstacles, maze, box, discs (a square that fits them)")
    text = f"quality of the network: {', '.join(PROFILES)}; robots of a channel share its airtime (ideal; 1 channel)"
    add("--wifi", default="ideal", metavar="PROFILE[,channels=C]", help=text)
    add("--seconds", type=within(0.001, MAX_DURATION_S), metavar="S", help="end after S simulated seconds")
    add("--perfect", action="store_true", help="identical robots: no wheel errors or slip (sensors stay noisy)")
    text = "model of all robots or of one: hero, hero_plus, or v3.0 (older stock firmware); may be repeated (hero)"
    add("--model", action="append", default=[], metavar="MODEL[,robot=ID]", help=text)


def check_population(options: argparse.Namespace, worlds: int = 1) -> None:
    """Raise OptionError for a number of robots, an id or a seed that cannot be used; each world needs a seed."""
    given = {"--count": options.count, "--first-id": options.first_id, "--seed": options.seed, "worlds": worlds}
    for name, value in given.items():
        if not isinstance(value, numbers.Integral) or isinstance(value, bool):
            raise OptionError(f"{name} {value!r}: must be a whole number")
    count = options.count
    if not 1 <= count <= MAX_ROBOTS:
        raise OptionError("--count %d: must be 1..%d" % (count, MAX_ROBOTS))
    if not 0 <= options.first_id <= MAX_ID - count + 1:
        raise OptionError("--first-id %d: ids must be 0..%d (%d robots)" % (options.first_id, MAX_ID, count))
    if worlds < 1:
        raise OptionError("worlds %d: must be 1 or more" % worlds)
    if not 0 <= options.seed <= 2**32 - worlds:
        raise OptionError("--seed %d: must be 0..%d" % (options.seed, 2**32 - worlds))


def build_errors(options: argparse.Namespace) -> RobotErrors:
    """Return how the robots differ: drawn from the seed, then known errors put over it.

    Raises: OptionError for an error that cannot be set.
    """
    # By id, so that a robot is the same one in any swarm.
    ids = range(options.first_id, options.first_id + options.count)
    rngs = (_reseed([options.seed, robot_id % 2**32]) for robot_id in ids)
    errors = draw_errors(rngs, 0.0 if options.perfect else 1.0)
    for row, model in enumerate(parse_models(options.model, options.first_id, options.count)):
        build_body(model, errors, row)
    known = read_known(options.errors, ids) if options.errors else []
    for text in [*known, *options.error]:
        set_known(errors, options.first_id, text)
    return errors


def draw_servo_timing(options: argparse.Namespace, robot_id: int) -> str:
    """Return the servo timing of a robot, which as its errors depends on seed and id alone."""
    if options.servo_timing != _DRAWN:
        return str(options.servo_timing)
    rng = np.random.RandomState([options.seed, robot_id % 2**32, len(SERVO_TIMINGS)])
    return (CORE_2, CORE_3)[rng.randint(2)]


def build_world(options: argparse.Namespace, worlds: int = 1) -> World:
    """Return the robots in their places: one world of the options' seed, or more worlds, of the seeds that follow.

    Raises: OptionError for an arena that cannot be used, or in which the robots find no place.
    """
    arena = load_arena(options.arena) if options.arena else build_default(options.count)
    each = _list_worlds(options, worlds)
    seeds = list(map(draw_seeds, each))
    errors = RobotErrors(*map(np.concatenate, zip(*map(build_errors, each))))
    radius_m = float(errors.radius_m.max())
    rngs = [np.random.RandomState(own["places"]) for own in seeds]
    poses = [place_robots(arena, options.count, rng, radius_m) for rng in rngs]
    return World(arena, np.concatenate(poses), [np.random.RandomState(own["world"]) for own in seeds], errors)


def place_worlds(
    arena: Arena,
    poses: np.ndarray,
    seeds: Sequence[int],
    errors: float,
    objects: Optional[Sequence[Sequence[PushedBody]]] = None,
    known: Sequence[str] = (),
) -> World:
    """Return one world of robots at poses (W, N, 3) for each seed; errors: 0 for nominal robots, 1 for usual ones.

    objects: of each world; None: those of the arena. known: errors of robots 0 to N - 1 of each world: see set_known().
    Raises: OptionError for an error that cannot be set.
    """
    worlds, robots, _ = poses.shape
    drawn = draw_errors((_reseed([seed, robot]) for seed in seeds for robot in range(robots)), errors)
    for world in range(worlds):
        own = RobotErrors(*(array[world * robots : (world + 1) * robots] for array in drawn))
        for text in known:
            set_known(own, 0, text)
    rngs = [np.random.RandomState(seed) for seed in seeds]
    return World(arena, poses.reshape(worlds * robots, 3), rngs, drawn, objects)


def build_radios(options: argparse.Namespace, worlds: int = 1) -> List[Radio]:
    """Return the Wi-Fi of each robot, world after world: worlds share no channel. Raises: OptionError."""
    profile, channels = parse_wifi(options.wifi)
    seeds = (draw_seeds(one)["radios"] for one in _list_worlds(options, worlds))
    return [radio for own in seeds for radio in build_network(profile, channels, own)]


def _list_worlds(options: argparse.Namespace, worlds: int) -> List[argparse.Namespace]:
    """Return the options of each world, which differ in their seeds."""
    each = [copy.copy(options) for _ in range(worlds)]
    for index, one in enumerate(each):
        one.seed = options.seed + index
    return each
