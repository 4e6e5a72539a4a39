"""Machines: what their files say, and how robots follow them."""

import numpy as np
import pytest

from hero_sim.world import load_arena
from hero_swarm.behavior import Floor, Random, sense
from hero_swarm.behaviors import find_behavior, list_names
from hero_swarm.behaviors.machine import make_machine
from hero_swarm.describe import describe_behaviors
from hero_swarm.learning.observation import Observation, count_observations
from hero_swarm.learning.policy import dump_policy
from hero_swarm.machines.machine_file import read_controller
from hero_swarm.machines.modules import draw_dot, follow
from hero_swarm.trial import Trial

ARENA = """\
bounds_m: [-2, -2, 2, 2]
areas:
  - {name: spot, circle_m: [1, 0, 0.3], color: 0}
  - {name: nest, circle_m: [-1, 0, 0.3], color: 1}
lamps_m: [[0, 1.5]]
"""
SEARCH = """\
arena: arena.yaml
states:
  - {name: search, do: exploration, turn_steps: 20, next: [{to: rest, when: black floor, probability: 1.0}]}
  - {name: rest, do: stop}
"""


@pytest.fixture(name="folder")
def write_files(tmp_path):
    (tmp_path / "arena.yaml").write_text(ARENA)
    (tmp_path / "search.controller").write_text(SEARCH)
    return tmp_path


class Eyes:
    """Infrared sensors of robots that see nothing, but for what ranges_m says."""

    def __init__(self, robots, **ranges_m):
        self.proximity_m = np.full((robots, 8), np.inf)
        for ray, range_m in ranges_m.items():
            self.proximity_m[:, int(ray[1:])] = range_m
        self.counts = np.zeros((robots, 8))


def take_steps(behavior, folder, poses, steps=1, memory=None, **ranges_m):
    """Step robots of one world that stay at poses; return speeds and states."""
    poses = np.array(poses, dtype=float)[None]
    arena, random = load_arena(str(folder / "arena.yaml")), Random([1], poses.shape[1])
    for _ in range(steps):
        sensed = sense(behavior, 0.0, poses, random, arena=arena, robots=Eyes(poses.shape[1], **ranges_m))
        linear_m_s, angular_rad_s, memory = behavior.step(sensed, memory, random)
    return linear_m_s, angular_rad_s, memory[0]


def act(folder, do, poses, **numbers):
    """Return the speeds of a machine of one state."""
    return take_steps(make_machine([[{"name": "a", "do": do, **numbers}]], False)(), folder, poses)[:2]


def test_a_file_drives_robots_until_they_stand_on_the_spot(folder):
    behavior = find_behavior(str(folder / "search.controller"))()
    assert behavior.arena == str(folder / "arena.yaml")
    linear_m_s, _, states = take_steps(behavior, folder, [(1, 0, 0), (0, 0, 0), (-1, 0, 0)])
    assert states.tolist() == [1, 0, 0]
    assert linear_m_s.tolist() == [0.0, behavior.linear_m_s, behavior.linear_m_s]
    assert behavior.colors((states, None, None)).tolist() == [[1, 0, 0], [0, 0, 1], [0, 0, 1]]


def test_exploration_turns_away_from_an_obstacle_and_drives_on(folder):
    machine = make_machine([[{"name": "a", "do": "exploration", "turn_steps": 100}]], False)()
    linear_m_s, angular_rad_s, _ = take_steps(machine, folder, [(0, 0, 0)], r0=0.08, r1=0.08)
    assert linear_m_s[0] == 0.0 and angular_rad_s[0] == -machine.turn_rad_s
    linear_m_s, angular_rad_s, _ = take_steps(machine, folder, [(0, 0, 0)], r4=0.08)
    assert linear_m_s[0] == machine.linear_m_s and angular_rad_s[0] == 0.0


def test_a_turn_ends_with_its_state(folder):
    states = [
        {"name": name, "do": "exploration", "turn_steps": 100,
         "next": [{"to": to, "when": "fixed probability", "probability": 1.0}]}
        for name, to in ("ab", "ba")
    ]  # fmt: skip
    machine, random, memory = make_machine([states], False)(), Random([1], 1), None
    arena = load_arena(str(folder / "arena.yaml"))
    for eyes, speed_m_s in ((Eyes(1, r0=0.08), 0.0), (Eyes(1), machine.linear_m_s)):
        sensed = sense(machine, 0.0, np.zeros((1, 1, 3)), random, arena=arena, robots=eyes)
        linear_m_s, _, memory = machine.step(sensed, memory, random)
        assert linear_m_s.tolist() == [speed_m_s] and (memory[1] > 1.0) == (speed_m_s == 0.0)


@pytest.mark.parametrize("do, sign", [("phototaxis", 1.0), ("anti-phototaxis", -1.0)])
def test_taxis_turns_to_the_lamp_or_away(folder, do, sign):
    _, angular_rad_s = act(folder, do, [(0, 0, 0.0), (0, 0, np.pi)])
    assert (sign * angular_rad_s * [1, -1] > 1.0).all()


@pytest.mark.parametrize("do, sign", [("attraction", 1.0), ("repulsion", -1.0)])
def test_robots_turn_to_neighbors_or_away(folder, do, sign):
    linear_m_s, angular_rad_s = act(folder, do, [(0, 0, 0), (0, 0.3, 0), (2, 2, 0)], gain=2.0)
    assert (sign * angular_rad_s[:2] * [1, -1] > 1.0).all()
    assert angular_rad_s[2] == 0.0 and linear_m_s[2] > 0.1, "without neighbors straight ahead"


def share_of_moves(folder, poses, **condition):
    """Return which share of steps leads 400 robots at each of poses to the second state."""
    condition = {"to": "b", **condition}
    machine = make_machine([[{"name": "a", "do": "stop", "next": [condition]}, {"name": "b", "do": "stop"}]], False)()
    return take_steps(machine, folder, [pose for pose in poses for _ in range(400)])[2].reshape(-1, 400).mean(axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("color, row", [("black floor", 0), ("gray floor", 1), ("white floor", 2)])
def test_floors_and_probabilities_lead_on(folder, color, row):
    places = [(1, 0, 0), (0, 0, 0), (-1, 0, 0)]
    shares = share_of_moves(folder, places, when=color, probability=0.7)
    assert np.delete(shares, row).tolist() == [0.0, 0.0] and shares[row] == pytest.approx(0.7, abs=0.07)
    assert share_of_moves(folder, places, when="fixed probability", probability=0.3) == pytest.approx(0.3, abs=0.07)


def test_counts_of_neighbors_lead_on(folder):
    crowd = [(0.1 * number, 0.0, 0.0) for number in range(4)] + [(1.8, 1.8, 0.0)]
    for when, expected in (("neighbor count", [1, 1, 1, 1, 0]), ("inverted neighbor count", [0, 0, 0, 0, 1])):
        next_state = {"to": "b", "when": when, "neighbors": 2, "steepness": 20.0}
        machine = [{"name": "a", "do": "stop", "next": [next_state]}, {"name": "b", "do": "stop"}]
        assert take_steps(make_machine([machine], False)(), folder, crowd)[2].tolist() == expected


def test_children_of_a_tree_act_until_their_conditions_hold(folder):
    path = folder / "tree.controller"
    path.write_text(
        "tree:\n  - {do: stop, until: {when: gray floor, probability: 1.0}}\n"
        "  - {do: stop, until: {when: gray floor, probability: 1.0}}\n"
        "  - {do: exploration, turn_steps: 5, until: {when: black floor, probability: 1.0}}\n"
    )
    behavior = find_behavior(str(path))()
    _, _, states = take_steps(behavior, folder, [(0, 0, 0), (1, 0, 0)])
    assert states.tolist() == [2, 0], "two conditions hold in one step; none does"
    last = np.array([2]), np.zeros(1), np.ones(1)
    assert take_steps(behavior, folder, [(1, 0, 0)], memory=last)[2].tolist() == [0], "after the last, the first"


def test_machines_of_a_batch_do_what_each_does_alone(folder):
    arena = load_arena(str(folder / "arena.yaml"))
    machines = [
        [{"name": "a", "do": "attraction", "gain": 2.0}],
        [
            {"name": "a", "do": "exploration", "turn_steps": 3,
             "next": [{"to": "b", "when": "fixed probability", "probability": 0.5}]},
            {"name": "b", "do": "phototaxis"},
        ],
    ]  # fmt: skip
    batch = Trial(make_machine(machines, False)(), arena, robots=3, seeds=[4, 5])
    alone = [Trial(make_machine([one], False)(), arena, robots=3, seeds=[seed]) for one, seed in zip(machines, (4, 5))]
    for _ in range(8):
        for trial in (batch, *alone):
            trial.step()
    assert (batch.poses == np.concatenate([trial.poses for trial in alone])).all()


def test_numbers_of_another_behavior_are_a_controller(folder):
    path = folder / "apart.controller"
    path.write_text("arena: arena.yaml\nbehavior: dispersion\nnumbers: {spacing_m: 0.3, near.range_m: 0.7}\n")
    behavior = find_behavior(str(path))()
    assert behavior.arena == str(folder / "arena.yaml")
    assert behavior.spacing_m == 0.3 and behavior.near.range_m == 0.7 and type(behavior).__name__ == "Dispersion"


def test_pages_offer_the_controllers_of_a_folder(folder, capsys):
    (folder / "wrong.controller").write_text("states: []\n")
    offers = {offer["behavior"]: offer for offer in describe_behaviors([str(folder)])}
    offer = offers[str(folder / "search.controller")]
    assert offer["title"] == "search" and offer["sentence"] == "A machine whose states robots show by their lights."
    assert "wrong.controller, line 1: states is" in capsys.readouterr().err and len(offers) == len(list_names()) + 1


def test_pages_offer_networks_but_nothing_whose_arena_was_left_behind(folder, capsys):
    observation = Observation((-2.0, -2.0, 2.0, 2.0), 5, 0.5, {"floor": Floor()})
    layers = [(np.zeros((count_observations(5) + 4, 2)), np.zeros(2))]
    (folder / "net.npz").write_bytes(dump_policy(layers, observation, 10.0, "arena.yaml"))
    assert find_behavior(str(folder / "net.npz")).arena == str(folder / "arena.yaml")
    assert [offer["title"] for offer in describe_behaviors([str(folder)])[-2:]] == ["search", "net"]
    (folder / "arena.yaml").rename(folder / "other.yaml")
    assert len(describe_behaviors([str(folder)])) == len(list_names())
    told = capsys.readouterr().err
    for name in ("net.npz", "search.controller"):
        assert f"{name}: arena {folder}/arena.yaml: cannot be read" in told


def test_a_machine_is_drawn_with_its_conditions(folder):
    text = draw_dot(read_controller("a", (folder / "search.controller").read_bytes()).states)
    assert '"search" [label="search: exploration\\nturn_steps 20"]' in text and '"" -> "search"' in text
    assert '"search" -> "rest" [label="  1. black floor  \\n  probability 1  "]' in text
    assert follow([{"do": "stop", "until": {"when": "black floor", "probability": 1.0}}])[0]["next"][0]["to"] == "0"


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("black floor", "blue floor", "line 3: states.next.when is 'blue floor', but must be one of: black floor"),
        ("do: stop", "do: sleep", "line 4: states.do is 'sleep'"),
        ("to: rest", "to: bed", "line 3: states.next.to is 'bed', but must be one of: search, rest"),
        ("turn_steps: 20, ", "", "line 3: turn_steps is missing"),
        ("turn_steps: 20", "turn_steps: 0.5", "line 3: states.turn_steps is 0.5, but must be a whole number from 1"),
        (
            "probability: 1.0",
            "probability: 2",
            "line 3: states.next.probability is 2, but must be a number from 0 to 1",
        ),
        ("do: stop", "do: stop, gain: 2", "line 4: unknown 'gain'"),
        ("name: rest, do: stop}", "name: rest, do: stop}\n  - {name: rest, do: stop}", "states of different names"),
        ("states:", "tree: []\nstates:", "needs states, a tree or a behavior"),
        ("states:", "machine:", "needs states, a tree or a behavior"),
        ("states:", "numbers: {linear_m_s: 0.1}\nstates:", "line 2: unknown 'numbers'; allowed are: arena, states"),
        (SEARCH, "behavior: own.controller", "must be built in, FILE.py or FILE.py:Class"),
        (SEARCH, "behavior: dispersion\nnumbers: {speed: 1}", "search.controller: Dispersion has no parameter 'speed'"),
        (SEARCH, "a: [", "not YAML"),
        ("next: [", "next: [" + "{to: rest, when: black floor, probability: 1.0}, " * 4, "a list of at most 4"),
    ],
)
def test_a_controller_that_is_edited_wrongly_is_refused(folder, old, new, words):
    path = folder / "search.controller"
    path.write_text(SEARCH.replace(old, new))
    with pytest.raises(ValueError, match=words):
        find_behavior(str(path))
