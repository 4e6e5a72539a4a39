"""Floor, light, messages and pheromone: values that can be computed by hand, worlds apart, and bad files."""

import math
from types import SimpleNamespace
from unittest.mock import create_autospec

import numpy as np
import pytest

from hero_sim import scene
from hero_sim.errors import OptionError
from hero_sim.world import load_arena
from hero_swarm.behavior import Behavior, Floor, Light, Pheromone, Random, RangeAndBearing, sense
from hero_swarm.trial import Trial
from hero_test.nonempty import nonempty

ARENA = """\
bounds_m: [-1, -1, 1, 1]
areas:
  - {name: nest, rectangle_m: [-1, -1, 1, -0.6], color: 1}
  - {name: food, circle_m: [0.5, 0, 0.3], color: [0, 0, 0]}
  - {name: core, circle_m: [0.5, 0, 0.1], color: [1, 0, 0]}
lamps_m: [[0, 1], [0, 0.9]]
"""


@pytest.fixture(name="arena")
def write_arena(tmp_path):
    (tmp_path / "arena.yaml").write_text(ARENA)
    return load_arena(str(tmp_path / "arena.yaml"))


def read(sensor, poses, arena=None, **around):
    behavior = Behavior()
    behavior.sensor = sensor
    poses = np.array(poses, dtype=float)
    return sense(
        behavior, around.pop("time_s", 0.0), poses, Random(range(len(poses)), poses.shape[1]), arena=arena, **around
    ).sensor


def test_the_floor_has_the_color_of_its_last_area(arena):
    places = [[(0.0, -0.7, 0.0), (0.25, 0.0, 0.0), (0.45, 0.0, 0.0), (0.0, 0.5, 1.0), (math.nan, 0.0, 0.0)]]
    ground = read(Floor(), places, arena)
    assert ground.area.tolist() == [0, 1, 2, -1, -1]
    assert ground.gray[:4] == pytest.approx([1.0, 0.0, 1.0 / 3.0, 0.5]) and np.isnan(ground.gray[4])
    assert ground.color[2].tolist() == [1.0, 0.0, 0.0]
    assert read(Floor(ahead_m=0.1), [[(0.15, 0.0, 0.0), (0.15, 0.0, math.pi)]], arena).area.tolist() == [1, -1]


def test_light_comes_from_lamps_and_halves_at_its_reach(arena):
    one = arena._replace(lamps_m=arena.lamps_m[:1])
    light = read(Light(reach_m=0.5), [[(0.0, 1.0, 0.0), (0.0, 0.5, 0.0), (0.5, 1.0, 0.0), (math.nan,) * 3]], one)
    assert light.intensity[:3] == pytest.approx([1.0, 0.5, 0.5]) and np.isnan(light.intensity[3])
    assert light.bearing_rad[1:3] == pytest.approx([math.pi / 2.0, math.pi])
    assert read(Light(), [[(0.0, 0.0, 0.0)]], arena).intensity[0] > 1.0, "two lamps are brighter than one"
    dark = read(Light(), [[(0.0, 0.0, 0.0), (math.nan,) * 3]], arena._replace(lamps_m=np.empty((0, 2))))
    assert dark.intensity[0] == dark.bearing_rad[0] == 0.0 and np.isnan([dark.intensity[1], dark.bearing_rad[1]]).all()


def test_messages_reach_neighbors_in_range_of_the_same_world():
    poses = [[(0, 0, 0), (0.4, 0, 0), (2, 0, 0)], [(0, 0, 0), (5, 0, 0), (0, -0.3, 0)]]
    sent = np.arange(12.0).reshape(6, 2)
    got = read(RangeAndBearing(0.5), poses, messages=sent)
    assert np.argwhere(got.seen).tolist() == [[0, 1], [1, 0], [3, 2], [5, 0]]
    assert got.data[0, 1].tolist() == [2.0, 3.0] and got.data[3, 2].tolist() == [10.0, 11.0]
    assert got.range_m[0, 1] == pytest.approx(0.4) and got.bearing_rad[3, 2] == pytest.approx(-math.pi / 2.0)
    assert not read(RangeAndBearing(0.5), poses).seen.any(), "nobody has sent yet"
    share = np.mean(
        [read(RangeAndBearing(9.0, loss=0.85), poses[:1] * 500, messages=np.ones(1500)).seen.sum() / 3000.0]
    )
    assert share == pytest.approx(0.15, abs=0.02)
    kept, heard = {}, []
    for step in range(20):
        got = read(RangeAndBearing(0.5, rate_hz=2.0), poses, messages=sent, kept=kept, time_s=step * 0.1)
        heard.append(got.seen.any())
    assert heard == ([True] + [False] * 4) * 4
    kept, rarely = {}, RangeAndBearing(0.5, rate_hz=10.0)
    times_s = [step * 0.1 for step in range(100)]  # rounded: some are a little earlier than 0.1 s after the one before
    assert all(read(rarely, poses, messages=sent, kept=kept, time_s=time_s).seen.any() for time_s in nonempty(times_s))


def test_pheromone_stays_evaporates_and_keeps_worlds_apart(arena):
    sensor, kept = Pheromone(half_life_s=2.0, cell_m=0.05, reach_m=0.1, angle_rad=0.5), {}
    around = {"arena": arena, "kept": kept}
    start = [[(0.01, 0.01, 0.0)], [(0.01, 0.01, 0.0)]]
    read(sensor, start, time_s=0.0, **around)
    here = read(sensor, start, time_s=0.5, deposits=np.array([4.0, 0.0]), **around).here
    assert here.tolist() == [2.0, 0.0], "4 per second for half a second"
    later = read(sensor, start, time_s=2.5, deposits=np.zeros(2), **around)
    assert later.here.tolist() == pytest.approx([1.0, 0.0])
    left_m, right_m = (
        (0.01 - 0.1 * math.cos(0.5), 0.01 - 0.1 * math.sin(0.5)),
        (0.01 - 0.1 * math.cos(0.5), 0.01 + 0.1 * math.sin(0.5)),
    )
    for (x_m, y_m), name in ((left_m, "left"), (right_m, "right")):
        trail = read(sensor, [[(x_m, y_m, 0.0)]] * 2, time_s=2.5, **around)._asdict()
        assert {part: values[0] for part, values in trail.items() if values[0]} == {name: pytest.approx(1.0)}
    outside = read(sensor, [[(9.0, 0.0, 0.0)], [(math.nan, 0.0, 0.0)]], time_s=2.5, deposits=np.ones(2), **around)
    assert outside.here[0] == 0.0 and np.isnan(outside.here[1])


def test_pheromone_beside_the_arena_is_not_that_of_its_other_side(arena):
    kept, sensor = {}, Pheromone(cell_m=0.5)
    places = [[(0.9, 0.1, 0.0), (-1.1, 0.1, 0.0), (0.1, 0.9, 0.0), (0.1, -1.1, 0.0), (0.0, 0.6, 0.0)]]
    read(sensor, places, arena, kept=kept)
    here = read(sensor, places, arena, kept=kept, time_s=1.0, deposits=np.array([1.0, 2.0, 4.0, 8.0, 0.0])).here
    assert here.tolist() == [1.0, 0.0, 4.0, 0.0, 4.0]


def test_virtual_sensors_have_the_defaults_of_their_document():
    assert Floor() == (0.0,) and Light() == (1.0,) and RangeAndBearing() == (0.5, 0.0, math.inf)
    assert Pheromone() == (30.0, 0.04, 0.06, 0.6)


class Marking(Behavior):
    trail = Pheromone()
    radio = RangeAndBearing(range_m=10.0)

    def step(self, sensed, memory, random):
        return 0.0, 0.0, sensed

    def messages(self, memory):
        return memory.numbers + 10.0

    def deposits(self, memory):
        return np.where(memory.numbers == 0, 1.0, 0.0)


def test_a_behavior_sends_and_deposits_in_many_worlds(arena):
    trial = Trial(Marking(), arena, robots=2, seeds=[1, 2])
    for _ in range(21):
        trial.step()
    sensed = trial.memory
    assert sensed.trail.here[::2] == pytest.approx([1.0, 1.0], rel=0.05) and (sensed.trail.here[1::2] == 0.0).all()
    assert sensed.radio.data[sensed.radio.seen][:, 0].tolist() == [11.0, 10.0, 11.0, 10.0]


@pytest.mark.parametrize(
    ("name", "given"), [("messages", np.zeros(3)), ("deposits", np.zeros((4, 2))), ("colors", 0.5)]
)
def test_what_robots_send_leave_or_show_has_a_row_for_each(name, given, arena, monkeypatch):
    monkeypatch.setattr(Marking, name, lambda behavior, memory: given)
    with pytest.raises(
        ValueError, match=r"Marking.%s\(\) gives an array of shape .* a row for each of 4 robots" % name
    ):
        Trial(Marking(), arena, robots=2, seeds=[1, 2]).step()


def test_sensors_of_an_arena_say_that_they_need_one():
    for sensor in (Floor(), Light(), Pheromone()):
        with pytest.raises(ValueError, match=f"{type(sensor).__name__} needs an arena: give arena:=FILE"):
            read(sensor, [[(0.0, 0.0, 0.0)]])
    with pytest.raises(ValueError, match="Pheromone: 2500 x 2500 cells of 0.04 m in 1 worlds are more than 1000000"):
        Trial(Marking(), robots=1).step()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("color: 1}", "color: 2}", "line 3: areas.color is '2', but must be a number from 0 to 1"),
        ("color: [1, 0, 0]", "color: [1, 0]", "line 5: .*color is a list, but must be .red, green, blue"),
        ("name: nest, ", "", "line 3: name is missing in areas"),
        ("circle_m: [0.5, 0, 0.3]", "circle_m: [0.5, 0, 0]", "line 4: .*circle whose radius is more than 0"),
        ("[-1, -1, 1, -0.6]", "[1, -1, -1, -0.6]", "line 3: .*each minimum less than its maximum"),
        ("circle_m: [0.5, 0, 0.3], ", "", "line 4: .*circle_m or rectangle_m"),
        ("[[0, 1]", "[[0, up]", "line 6: "),
        ("{name: food", "{shade: 1, name: food", "line 4: unknown 'shade'"),
    ],
)
def test_a_wrong_area_is_refused_with_its_line(tmp_path, old, new, words):
    (tmp_path / "arena.yaml").write_text(ARENA.replace(old, new))
    with pytest.raises(OptionError, match=words):
        load_arena(str(tmp_path / "arena.yaml"))


def test_viewers_draw_areas_flat_below_walls_and_in_their_colors(arena):
    nest, food, core, *lamps = scene.draw_arena(arena)
    assert (nest.kind, nest.pose, nest.size_m[:2]) == (scene.CUBE, (0.0, -0.8, 0.0), pytest.approx((2.0, 0.4)))
    assert food.kind == scene.CYLINDER and core.color == (1.0, 0.0, 0.0, 1.0) and core.z_m > food.z_m > nest.z_m
    assert {shape.namespace for shape in (nest, food, core)} == {"areas"} and len(lamps) == 2


def test_the_program_publishes_what_each_robot_senses(tmp_path, monkeypatch):
    rospy = pytest.importorskip("rospy", reason="the program needs ROS")
    from std_msgs.msg import Float32, Float32MultiArray

    from hero_node.parameters import check_parameters
    from hero_swarm.ros import virtual_sensors_node as module

    sent, receivers, clock = {}, {}, [0.0]
    monkeypatch.setattr(
        rospy, "Publisher",
        lambda topic, kind, **_: SimpleNamespace(
            publish=sent.setdefault(topic, []).append, get_num_connections=lambda: int(topic == "/hero_3/neighbors")
        ),
    )  # fmt: skip
    monkeypatch.setattr(rospy, "Subscriber", lambda topic, kind, receive, **_: receivers.update({topic: receive}))
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(3))
    (tmp_path / "arena.yaml").write_text(ARENA)
    given = {"arena": str(tmp_path / "arena.yaml"), "robots": "7 3 9", "frame": "world", "message_range_m": 0.6}
    node = module.VirtualSensorsNode(check_parameters(module.PARAMETERS, given))
    poses = np.array([(0.5, 0.0, 0.0), (0.0, 0.0, math.pi / 2.0), (math.nan,) * 3])
    monkeypatch.setattr(node._source, "read", lambda: (poses, np.zeros(3)))
    node.step()
    receivers["/hero_7/send_message"](Float32MultiArray(data=[1.5, 2.5]))
    receivers["/hero_3/send_message"](Float32MultiArray(data=[]))
    receivers["/hero_7/deposit"](Float32(2.0))
    clock[0] = 0.5
    node.step()
    floor, light = sent["/hero_7/floor"][-1], sent["/hero_3/light"][-1]
    assert (floor.r, floor.g, floor.b) == (1.0, 0.0, 0.0)
    assert light.x > 0.9 and light.y == pytest.approx(0.0, abs=1e-9) and light.z == 0.0, "the lamps are ahead"
    assert sent["/hero_7/pheromone"][-1].x == pytest.approx(1.0) and sent["/hero_3/pheromone"][-1].x == 0.0
    heard = sent["/hero_3/messages"][-1]
    assert heard.data == pytest.approx([7.0, 0.5, -math.pi / 2.0, 1.5, 2.5]) and heard.layout.dim[0].size == 1
    assert [near.id for near in sent["/hero_3/neighbors"][-1].neighbors] == [7]
    assert sent["/hero_7/neighbors"] == [], "none listens"
    assert sent["/hero_7/messages"][-1].data == [] and sent["/hero_9/floor"] == []
    clock[0] = 5.0
    for amount in (math.nan, math.inf):
        receivers["/hero_7/deposit"](Float32(amount))
        node.step()
    assert 0.0 < sent["/hero_7/pheromone"][-1].x < 1.0, "its program has fallen silent, or tells no number"


def test_numbers_of_the_program_are_taken_up_to_their_limits():
    pytest.importorskip("rospy", reason="the program needs ROS")
    from hero_swarm.ros.virtual_sensors_node import PARAMETERS

    numbers = {name: (one.default, *one.limits) for name, one in PARAMETERS.items() if one.limits}
    assert numbers == {
        "seed": (0, 0, 2**31 - 1), "rate_hz": (10.0, 1.0, 50.0), "range_m": (1000.0, 0.0, 1000.0),
        "field_rad": (math.tau, 0.0, math.tau), "range_noise_m": (0.0, 0.0, 1.0), "bearing_noise_rad": (0.0, 0.0, 1.0),
        "dropout": (0.0, 0.0, 1.0), "message_range_m": (0.5, 0.0, 1000.0), "message_loss": (0.0, 0.0, 1.0),
        "light_reach_m": (1.0, 0.01, 1000.0), "half_life_s": (30.0, 0.1, 1e6),
    }  # fmt: skip
    assert PARAMETERS["occlusion"].default is False and PARAMETERS["arena"].default == "empty"


def test_robots_that_join_a_driver_later_are_added_once(monkeypatch):
    rospy = pytest.importorskip("rospy", reason="the program needs ROS")
    from hero_client.ros.drivers import Drivers
    from hero_node.parameters import check_parameters
    from hero_swarm.ros import virtual_sensors_node as module

    drivers, made, told = create_autospec(Drivers, instance=True), [], []
    for name in ("Publisher", "Subscriber"):
        made_by = create_autospec(getattr(rospy, name), side_effect=lambda topic, *_, **__: made.append(topic))
        monkeypatch.setattr(rospy, name, made_by)
    monkeypatch.setattr(module, "share_drivers", lambda: drivers)
    node = module.VirtualSensorsNode(check_parameters(module.PARAMETERS, {"arena": "empty"}))
    source = create_autospec(module.PoseSource, instance=True)
    source.describe_missing.return_value, source.warn.side_effect, node._source = "no poses", told.append, source
    node._publish = create_autospec(node._publish)
    source.read.side_effect = lambda: (node._ids[:], np.zeros(0))
    made.clear()
    for ready in ([], [3], [3, 7], [7]):
        drivers.list_ready.return_value = ready
        node.step()
    assert told[0] == "no robot has joined a driver yet: are the robots on?"
    assert told[1:] == ["no poses; who has no pose senses nothing"] * 3
    assert [call.args[0] for call in node._publish.call_args_list] == [[3], [3, 7], [3, 7]], "one that left may return"
    topics = [*module.TOPICS, "send_message", "deposit"]
    assert sorted(made) == sorted(f"/hero_{number}/{topic}" for number in (3, 7) for topic in topics)
    assert [call.args[0] for call in source.add_robots.call_args_list] == [[], [3], [7], []]
