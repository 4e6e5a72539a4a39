"""Commands of each behavior in a varied state: results of experiments must not change without a word in CHANGELOG.rst.

See hero_test.checks.kept_results.
"""

import zlib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hero_client.values import PlacedObjects
from hero_sim.world.arena import Area, build_rectangle
from hero_swarm.behavior import Random, act, decide, sense
from hero_swarm.behaviors import find_behavior, list_names
from hero_swarm.behaviors.machine import make_machine
from hero_swarm.machines.modules import draw_dot, follow, stack
from hero_test.checks.kept_results import check_sums

WORLDS, ROBOTS, STEPS = 2, 6, 5

KEPT = {
    "aggregation": [5.7889031, -0.2425223, 240],
    "box_pushing": [-5.1337322, 37.303637, 360],
    "cooperative_transport": [-2.1212139, 15.1193509, 240],
    "coverage": [6.6708798, 2.0902476, 240],
    "cyclic_pursuit": [7.0507647, 3.2668529, 240],
    "dispersal": [0.3918216, -0.3137486, 240],
    "dispersion": [6.4268467, 2.4066803, 240],
    "evolved_aggregation": [1.9540397, -4.4171226, 240],
    "flocking": [3.4510487, 0.3972577, 240],
    "formation": [3.159205, 18.7888663, 240],
    "leader_followers": [4.3030868, -0.2229715, 240],
    "majority": [-5.728803, -1.0275207, 720],
    "milling": [5.525234, 4.1590931, 240],
    "molecules": [-39.9282978, 22.9494229, 1200],
    "object_clustering": [1.8561141, -2.9773616, 240],
    "potential_segregation": [-1.0569477, 37.2244889, 720],
    "random_fields": [-8.5676372, 4.8815514, 960],
    "rendezvous": [0.6994382, 6.0376763, 240],
    "segregation": [0.5837733, 41.9702444, 720],
    "voter": [-7.5500902, 6.927879, 720],
    "wall_following": [0.5026255, -2.1209429, 240],
    "wheel_genome": [0.7028137, -4.1700969, 240],
}

ACCELERATED = Path(__file__).resolve().parents[2] / "src" / "hero_swarm" / "published" / "accelerated.py"


def run(behavior, arena=None, reach_m=0.25):
    """Return the commands, acts and memory of some steps among moving robots, one of which has no pose."""
    random = np.random.RandomState(7)
    poses = random.uniform((-reach_m, -reach_m, -3.0), (reach_m, reach_m, 3.0), (WORLDS, ROBOTS, 3))
    poses[1, 4] = np.nan
    things, memory, kept = random.uniform(-0.3, 0.3, (WORLDS, 2, 3)), None, {}
    ranges_m = random.uniform(0.04, 0.3, (STEPS, WORLDS * ROBOTS, 8))
    ranges_m[ranges_m > 0.2], ranges_m[:, 3, 2:5] = np.inf, np.nan
    own, acts, found = Random([3, 4], ROBOTS), {}, []
    for step, own_m in enumerate(ranges_m):
        readings = SimpleNamespace(proximity_m=own_m, counts=1.0 / own_m)
        placed = PlacedObjects(things + 0.01 * step, np.array((0.05, 0.1)))
        around = {"arena": arena, "robots": readings, "kept": kept, **acts}
        sensed = sense(behavior, step / behavior.rate_hz, poses, own, placed, **around)
        linear_m_s, angular_rad_s, memory = decide(behavior, sensed, memory, own)
        acts = act(behavior, memory, WORLDS * ROBOTS)
        states = memory if isinstance(memory, tuple) else () if memory is None else (memory,)
        found += [linear_m_s, angular_rad_s, *states, *(values for values in acts.values() if values is not None)]
        speeds = np.column_stack((linear_m_s, 0.0 * linear_m_s, angular_rad_s)).reshape(poses.shape)
        poses = poses + 0.1 * np.nan_to_num(np.clip(speeds, -1.0, 1.0))
    return found


@pytest.mark.parametrize("name", list_names())
def test_each_behavior_commands_what_it_did_in_a_crowd_and_a_swarm(name):
    numbers = {"left0": 0.8, "right0": 1.0, "left1": 0.5, "right1": -0.6} if name == "wheel_genome" else {}
    behavior = find_behavior(name)(**numbers)
    check_sums(KEPT[name], *run(behavior, reach_m=0.15), *run(behavior, reach_m=0.6))


def make_states(shift):
    """Return states of all kinds, with conditions of all kinds between them."""
    do = [{"do": "exploration", "turn_steps": 3}, {"do": "phototaxis"}, {"do": "anti-phototaxis"},
          {"do": "attraction", "gain": 1.5}, {"do": "repulsion", "gain": 2.5}, {"do": "stop"}]  # fmt: skip
    when = [{"when": "black floor", "probability": 0.4}, {"when": "neighbor count", "neighbors": 2, "steepness": 1.5},
            {"when": "white floor", "probability": 0.3}, {"when": "fixed probability", "probability": 0.2},
            {"when": "gray floor", "probability": 0.25},
            {"when": "inverted neighbor count", "neighbors": 3, "steepness": 0.7}]  # fmt: skip
    count = len(do)
    tos = [[(number + step + shift) % count for step in range(2 + number % 2)] for number in range(count)]
    return [
        {"name": "S%d" % number, **do[number],
         "next": [{"to": "S%d" % to, **when[(number + column) % count]} for column, to in enumerate(tos[number])]}
        for number in range(count)
    ]  # fmt: skip


def make_tree():
    until = [{"when": "black floor", "probability": 0.7}, {"when": "fixed probability", "probability": 0.5},
             {"when": "neighbor count", "neighbors": 1, "steepness": 2.0}]  # fmt: skip
    do = [{"do": "exploration", "turn_steps": 5}, {"do": "attraction", "gain": 2.0}, {"do": "anti-phototaxis"}]
    return follow([{**child, "until": condition} for child, condition in zip(do, until)])


AREAS = Area("dark", (-1.0, -1.0, 0.1, 0.05), (0.0, 0.2, 0.1)), Area("light", (0.2, 0.2, 0.3), (1.0, 0.9, 0.8))
FLOOR = build_rectangle(2.0, 2.0, 1)._replace(areas=AREAS, lamps_m=np.array([(0.4, 0.3), (-0.5, 0.1)]))


def test_machines_and_trees_command_what_they_did_on_floors_and_by_lamps():
    found = []
    for machines, is_tree in (
        ([make_states(1)], False),
        ([make_states(1), make_states(2)], False),
        ([make_tree()], True),
    ):
        found += run(make_machine(machines, is_tree)(), FLOOR, 0.4)
    found += run(make_machine([make_states(1)], False, turn_rad_s=1.25, rate_hz=5.0)(), FLOOR, 0.3)
    check_sums([19.488865, 3.7802159, 1920], *found)


def test_machines_become_the_tables_and_the_graph_that_they_did():
    check_sums([-5.6211954, -21.4311523, 7687], *stack([make_states(1), make_tree(), make_states(2)]))
    graph = draw_dot(make_states(1))
    assert zlib.crc32(graph.encode()) == 1392506245, graph


def test_accelerated_points_move_as_they_did():
    check_sums([12.3374894, -51.3249267, 600], *run(find_behavior(str(ACCELERATED))(noise=0.2), None, 2.0))


def test_pages_may_set_numbers_up_to_the_limits_that_they_had():
    kinds = [find_behavior(name) for name in list_names()]
    settings = [(getattr(kind, name), *one.limits) for kind in kinds for name, one in sorted(kind.settings.items())]
    check_sums([98.1656097, -1007.9284495, 183], *settings)


def test_a_machine_takes_floors_at_the_bounds_for_gray_and_shows_its_state():
    when = [{"to": str(number), "when": f"{name} floor", "probability": 1.0}
            for number, name in enumerate(("black", "gray", "white"))]  # fmt: skip
    states = [{"name": str(number), "do": "stop", "next": when} for number in range(3)]
    machine = make_machine([states], False)()
    gray = np.array([0.0, 0.2499, 0.25, 0.5, 0.75, 0.7501, 1.0])
    sensed = SimpleNamespace(floor=SimpleNamespace(gray=gray), near=SimpleNamespace(counts=np.zeros(7, dtype=int)))
    found = machine._move(sensed, 0, np.zeros(7, dtype=int), np.zeros((7, 5)))
    assert found.tolist() == [0, 0, 1, 1, 1, 2, 2] and machine.rate_hz == 10.0
    shown = machine.colors((np.arange(8),)).tolist()
    assert shown[0] == shown[7] == [0, 0, 1] and len({tuple(color) for color in shown}) == 7
    assert {part for color in shown for part in color} == {0.0, 1.0}
