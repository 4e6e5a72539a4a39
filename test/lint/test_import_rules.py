"""The borders between the layers, as ARCHITECTURE.md draws them: who may import what."""

import ast

import pytest
import sources

MODULES = {name: path for name, path in sources.list_source_modules().items() if not name.startswith("hero_test")}
NOT_IN_PURE_ROOMS = {"asyncio", "logging", "select", "selectors", "socket", "ssl", "threading", "time"}
SOCKETS = {"asyncio", "socket", "socketserver", "ssl", "tornado"}
# The robots' connections, on each side; the connections to subscribers and publishers that rospy has made; the program
# check, which asks for the addresses of names; and the pages of the fleet monitor.
SOCKET_OWNERS = (
    "hero_driver.transport",
    "hero_driver.ros.rospy_internals",
    "hero_driver.ros.raw_subscriber",
    "hero_node.ros",
    "hero_sim.link.tcp_link",
    "hero_tools.checkup.network",
    "hero_monitor.server",
    "hero_monitor.program",
)

# Each room, and what it may import of its package besides itself; what runs the rooms stands on top and may import all.
SIM_GROUND = {"errors", "key_values", "robot_constants"}
ROOMS = {
    "hero_driver.rosserial": set(),
    "hero_driver.transport": set(),
    "hero_driver.fleet": set(),
    "hero_driver.corrections": {"robot_constants"},
    "hero_driver.commands": {"corrections", "robot_constants"},
    "hero_driver.ros": {"rosserial", "transport", "fleet", "corrections", "commands", "robot_constants"},
    "hero_sim.world": SIM_GROUND,
    "hero_sim.robot": SIM_GROUND | {"world"},
    "hero_sim.link": SIM_GROUND,
    "hero_sim.stepped": SIM_GROUND | {"world", "robot", "link", "population"},
    "hero_client.values": set(),
    "hero_client.controllers": {"values"},
    "hero_client.ros": {"values"},
    "hero_client.robots": {"controllers", "values"},
    "hero_localization.prints": {"errors"},
    "hero_localization.camera": {"errors"},
    "hero_localization.tracking": {"errors", "prints", "camera"},
    "hero_localization.filter": {"errors"},
    "hero_localization.mapping": {"errors", "filter"},
    "hero_localization.calibration": {"errors", "prints", "camera", "tracking", "filter"},
    "hero_localization.simulated_camera": {"errors", "prints"},
}
PURE_ROOMS = (
    "hero_driver.rosserial",
    "hero_driver.fleet",
    "hero_driver.corrections",
    "hero_driver.commands",
    "hero_sim.population",
    "hero_sim.world",
    "hero_sim.robot",
    "hero_sim.stepped",
    "hero_sim.swarm",  # moves both through simulated time
    "hero_client.values",
    "hero_client.controllers",
    "hero_client.robots",
    "hero_client.apps.formations",
    "hero_client.apps.goals",
    "hero_node.clock",
    "hero_node.errors",
    "hero_node.parameters",
    "hero_node.texts",
    "hero_node.token_bucket",
    "hero_calibration.dead_zone",
    "hero_calibration.encoder_readings",
    "hero_calibration.infrared",
    "hero_calibration.infrared_model",
    "hero_calibration.motors",
    "hero_calibration.placement",
    "hero_calibration.restore",
    "hero_calibration.session",
    "hero_calibration.step_response",
    "hero_calibration.velocity",
    "hero_localization.calibration",
    "hero_localization.camera.camera_model",
    "hero_localization.camera.lens_file",
    "hero_localization.filter",
    "hero_localization.mapping",
    "hero_localization.prints",
    "hero_localization.stepped_localization",
    "hero_localization.tracking",
)


def imports_of(name):
    return sources.read_imports(MODULES[name])


def modules_below(package):
    return [name for name in MODULES if name == package or name.startswith(package + ".")]


def part_of(module, package):
    """Return the room, or the top-level module, of package that module is or lies in; None for all others."""
    parts = module.split(".")
    return parts[1] if parts[0] == package and len(parts) > 1 and ".".join(parts[:2]) in MODULES else None


@pytest.mark.parametrize("name", [name for room in PURE_ROOMS for name in modules_below(room)])
def test_pure_rooms_know_no_ros_clock_socket_or_thread(name):
    for found in imports_of(name):
        assert found.top not in NOT_IN_PURE_ROOMS, f"line {found.line}"
        assert not sources.is_ros_import(found.module), f"line {found.line}"


@pytest.mark.parametrize("room", ROOMS)
def test_rooms_import_only_what_lies_below_them(room):
    package, own = room.split(".")
    for name in modules_below(room):
        for found in imports_of(name):
            part = part_of(found.module, package)
            assert part in ROOMS[room] | {own, None}, f"{name}, line {found.line}: {found.module}"


@pytest.mark.parametrize("package", ("hero_driver", "hero_sim", "hero_client", "hero_localization"))
def test_neither_rooms_nor_modules_import_each_other_in_a_circle(package):
    modules = set(modules_below(package)) - {package}
    by_module = {name: {found.module for found in imports_of(name)} & modules - {name} for name in modules}
    by_room = {}
    for name, imported in by_module.items():
        room = part_of(name, package)
        by_room.setdefault(room, set()).update({part_of(other, package) for other in imported} - {room})
    for imports in (by_module, by_room):
        while imports:
            leaves = {name for name, imported in imports.items() if not imported & imports.keys()}
            assert leaves, f"circle among {sorted(imports)}"
            imports = {name: imported for name, imported in imports.items() if name not in leaves}


@pytest.mark.parametrize("name", sorted(MODULES))
def test_nothing_imports_the_gateway_except_the_node(name):
    assert name == "hero_driver.node" or not [f for f in imports_of(name) if f.module == "hero_driver.gateway"]


@pytest.mark.parametrize("name", sorted(MODULES))
def test_only_the_transports_touch_sockets(name):
    touched = {found.top for found in imports_of(name)} & SOCKETS
    owner = any(name == module or name.startswith(module + ".") for module in SOCKET_OWNERS)
    assert owner or not touched, f"{name} imports {', '.join(sorted(touched))}"


@pytest.mark.parametrize("name", sorted(MODULES))
def test_nothing_imports_a_node(name):
    assert not [found for found in imports_of(name) if found.module.endswith(".node")]


@pytest.mark.parametrize("name", modules_below("hero_localization"))
def test_real_cameras_and_their_calibration_need_no_simulator(name):
    simulated = part_of(name, "hero_localization") in {"simulated_camera", "stepped_localization"}
    assert simulated or "hero_sim" not in {found.top for found in imports_of(name)}


@pytest.mark.parametrize("name", modules_below("hero_sim"))
def test_only_stepped_robots_need_the_client(name):
    # `python3 -m hero_sim` runs without ROS, and hero_client lies beside it only in a workspace.
    assert part_of(name, "hero_sim") == "stepped" or "hero_client" not in {found.top for found in imports_of(name)}


@pytest.mark.parametrize("name", modules_below("hero_sim"))
def test_the_simulator_shares_only_packets_and_payloads_with_the_driver(name):
    core = "hero_driver.rosserial"
    shared = [f"{core}.{module}" for module in ("errors", "packets", "payloads")]
    if part_of(name, "hero_sim") == "stepped":  # stands in for the driver, too: its pure rules, never its protocol
        shared += ["hero_driver.commands", "hero_driver.corrections", "hero_driver.robot_constants"]
    for found in imports_of(name):
        if found.top == "hero_driver" and found.module != core:  # `from hero_driver.rosserial import ...`
            allowed = any(
                found.module == module or found.module.startswith(module + ".") for module in shared
            )
            assert allowed, f"line {found.line}: {found.module}"


@pytest.fixture(scope="module")
def names_by_module():
    names = {}
    for path in sources.list_python_files():  # a directory of tests is on the path: its modules go by their stem
        names.setdefault(path.stem, set()).update(sources.list_top_level_names(path))
    modules = sources.list_source_modules().items()
    return {**names, **{name: sources.list_top_level_names(path) for name, path in modules}}


@pytest.mark.parametrize("path", sources.list_python_files(), ids=sources.name_of)
def test_names_that_are_imported_from_our_modules_exist(path, names_by_module):
    for node in ast.walk(sources.parse(path)):
        if isinstance(node, ast.ImportFrom) and not node.level and node.module in names_by_module:
            for alias in node.names:
                is_module = f"{node.module}.{alias.name}" in names_by_module
                is_name = names_by_module[node.module] & {alias.name, "__getattr__"}
                assert is_module or is_name, f"line {node.lineno}: {alias.name}"


def test_the_rooms_and_modules_that_the_rules_name_exist():
    assert {*ROOMS, *PURE_ROOMS, *SOCKET_OWNERS} <= set(MODULES)
