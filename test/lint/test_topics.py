"""Every topic of a robot is in all its places: page, links, recorder, simulated robots (CONTRIBUTING, Add a topic)."""

import ast
import re

import sources

ONLY_OVER_ROS = {"imu": "stepped robots have no IMU hat"}
NOT_DECLARED = {
    "neighbors": "published by hero_swarm",
    "proximity": "made of laser by the driver",
    "odom_raw": "the robot's odom, as it sent it",
    "range": "made of distance by the driver",
}
NOT_RECORDED = {
    "neighbors": "follow from the poses",
    "distance": "is recorded as range",
    **dict.fromkeys(("odom_raw", "laser", "laser_enable"), "are recorded as odom and proximity"),
}


def find_assigned(module, name):
    """Return the value that a module gives to a name."""
    found = []
    for node in ast.walk(sources.parse(sources.list_source_modules()[module])):
        targets = getattr(node, "targets", [getattr(node, "target", None)])
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and ast.unparse(targets[0]) == name:
            found.append(node.value)
    assert len(found) == 1, f"{module}: {name}"
    return found[0]


def list_texts(node):
    return {part.value for part in ast.walk(node) if isinstance(part, ast.Constant) and isinstance(part.value, str)}


def list_keys(module, name):
    return {key.value for key in find_assigned(module, name).keys}


def list_link_topics():
    """Return the topics that the interface to one robot names."""
    tree = sources.parse(sources.list_source_modules()["hero_client.values.robot_link"])
    (link,) = [node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == "RobotLink"]
    return set(re.findall(r'"(\w+)"', ast.get_docstring(link)))


def list_page_topics(title):
    """Return the topics of robots in the table below a title of the page."""
    text = (sources.ROOT / "docs" / "robot_interface.md").read_text(encoding="utf-8")
    return set(re.findall(r"`/hero_N/([\w/]+)`", text.partition(f"\n## {title}\n")[2].partition("\n## ")[0]))


def list_declared(kind):
    """Return the topics that simulated robots of one model or another declare: kind PUB or SUB."""
    declared = [
        find_assigned("hero_sim.robot.declarations", "STOCK_TOPICS"),
        find_assigned("hero_sim.robot.models", "_PLUS_TOPICS"),
    ]
    calls = [node for tree in declared for node in ast.walk(tree) if isinstance(node, ast.Call)]
    calls = [call for call in calls if ast.unparse(call.args[0]) == kind]
    return {list_texts(call.args[1]).pop().rpartition("%s")[2].lstrip("/") for call in calls}


def test_topics_of_a_robots_interface_are_those_over_ros_and_in_the_page():
    over_ros = list_keys("hero_client.ros.ros_link", "MESSAGE_CLASSES")
    assert list_link_topics() == over_ros - set(ONLY_OVER_ROS)
    assert over_ros <= list_page_topics("Data")


def test_topics_of_a_robots_interface_come_from_stepped_robots():
    stepped = list_texts(find_assigned("hero_sim.stepped.link", "self._arrivals_ms"))
    assert stepped == list_link_topics()


def test_topics_of_the_page_come_from_simulated_robots():
    assert list_page_topics("Data") - set(NOT_DECLARED) == list_declared("PUB") - {"tf"}


def test_commands_of_the_page_are_declared_by_simulated_robots_or_aliases():
    declared = list_declared("SUB")
    assert {"led", "laser_enable", "cmd_motor"} <= declared
    for topic in list_page_topics("Commands"):
        assert topic in declared or any(one.endswith("/" + topic) or topic.endswith("/" + one) for one in declared), (
            topic
        )


def test_topics_of_the_page_are_recorded():
    recorded = list_keys("hero_recording.bags.topics", "ROBOT_TOPICS")
    assert list_page_topics("Data") | list_page_topics("Commands") <= recorded | set(NOT_RECORDED)


def test_every_kind_of_a_recorded_topic_has_a_table():
    kinds = {value.elts[0].value for value in find_assigned("hero_recording.bags.topics", "ROBOT_TOPICS").values}
    assert kinds <= list_keys("hero_recording.bags.tables", "TABLES")


def test_topics_of_the_page_are_declared_in_the_test_of_the_driver():
    tree = sources.parse(sources.ROOT / "hero_driver" / "test" / "rostest" / "test_driver_topics.py")
    tested = {
        key.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Dict)
        for key in node.value.keys
    }
    assert list_page_topics("Data") | list_page_topics("Commands") <= tested | {"neighbors"}
