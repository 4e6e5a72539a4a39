"""The borders between the layers, as ARCHITECTURE.md draws them: who may import what."""

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
    "hero_node.addresses",
    "hero_node.ros",
    "hero_sim.link.tcp_link",
    "hero_tools.checkup.network",
    "hero_monitor.serving.server",
    "hero_monitor.serving.fair_stream",
    "hero_monitor.program",
)

# Programs, each with its own needs; the protocol, whose modules are names that others use whole.
WITHOUT_A_FACE = ("hero_client.apps.", "hero_driver.rosserial.")

# Each room, and what it may import of its package besides itself; what runs the rooms stands on top and may import all.
SIM_GROUND = {"errors", "key_values", "robot_constants"}
ROOMS = {
    "hero_driver.rosserial": set(),
    "hero_driver.transport": set(),
    "hero_driver.fleet": set(),
    "hero_driver.corrections": set(),
    "hero_driver.commands": {"corrections"},
    "hero_driver.ros": {"rosserial", "transport", "fleet", "corrections", "commands"},
    "hero_driver.stops": {"commands", "corrections", "peer", "ros", "rosserial", "transport"},
    "hero_driver.reports": {"commands", "corrections", "fleet", "peer", "ros", "rosserial", "transport"},
    "hero_node.files": {"errors", "parameters", "texts"},
    "hero_node.parameters": {"errors", "texts"},
    "hero_sim.world": SIM_GROUND,
    "hero_sim.robot": SIM_GROUND | {"world"},
    "hero_sim.link": SIM_GROUND,
    "hero_sim.stepped.rules": SIM_GROUND | {"world", "robot", "link"},
    "hero_sim.stepped": SIM_GROUND | {"world", "robot", "link", "population", "scene"},
    "hero_client.values": set(),
    "hero_client.controllers": {"values"},
    "hero_client.ros": {"values"},
    "hero_client.robots": {"controllers", "values"},
    "hero_calibration.models": {"errors"},
    "hero_calibration.robots": {"errors", "models"},
    "hero_calibration.procedures": {"errors", "models", "robots", "store"},
    "hero_localization.prints": {"errors"},
    "hero_localization.camera": {"errors"},
    "hero_localization.tracking": {"errors", "prints", "camera"},
    "hero_localization.filter": {"errors"},
    "hero_localization.mapping": {"errors", "filter"},
    "hero_localization.calibration": {"errors", "prints", "camera", "tracking", "filter"},
    "hero_localization.simulated_camera": {"errors", "prints", "camera", "tracking"},
    "hero_recording.bags": {"errors"},
    "hero_recording.plots": {"bags"},
    "hero_swarm.behaviors": {"behavior", "learning", "machines", "sensors", "sources"},
    "hero_swarm.design": {"behavior", "behaviors", "experiments", "learning", "machines", "sources"},
    "hero_swarm.experiments": {"behavior", "behaviors", "control", "metrics", "safety", "sensors", "sources", "trial"},
    "hero_swarm.fitting": {"trial"},
    "hero_swarm.learning": {"behavior", "metrics", "sensors", "sources"},
    "hero_swarm.machines": set(),
    "hero_swarm.metrics": {"sources"},
    "hero_swarm.sensors": set(),
}
PURE_ROOMS = (
    "hero_driver.rosserial",
    "hero_driver.fleet",
    "hero_driver.corrections",
    "hero_driver.commands",
    "hero_sim.population",
    "hero_sim.world",
    "hero_sim.robot",
    "hero_sim.scene",
    "hero_sim.stepped",
    "hero_sim.swarm",  # moves both through simulated time
    "hero_client.values",
    "hero_client.controllers",
    "hero_client.robots",
    "hero_client.apps.formations",
    "hero_node.files.calibration_file",
    "hero_node.clock",
    "hero_node.errors",
    "hero_node.geometry",
    "hero_node.files.marked_yaml",
    "hero_node.parameters",
    "hero_node.texts",
    "hero_node.token_bucket",
    "hero_calibration.models",
    "hero_calibration.procedures",
    "hero_calibration.robots.session",
    "hero_localization.calibration",
    "hero_localization.camera.camera_model",
    "hero_localization.filter",
    "hero_localization.mapping",
    "hero_localization.prints",
    "hero_localization.tracking",
    "hero_swarm.behavior",
    "hero_swarm.behaviors",
    "hero_swarm.control",
    "hero_swarm.fitting",
    "hero_swarm.machines",
    "hero_swarm.metrics",
    "hero_swarm.safety",
    "hero_swarm.sensors",
    "hero_swarm.trial",
)


def imports_of(name):
    return sources.read_imports(MODULES[name])


def list_imports():
    """All imports of all modules, as (name of the module, import)."""
    return [(name, found) for name in sorted(MODULES) for found in imports_of(name)]


def check(violations):
    """Fail with all violations of a rule, one a line."""
    violations = list(violations)
    assert not violations, "\n".join(violations)


def describe(name, found):
    """Where an import stands."""
    return f"{sources.name_of(MODULES[name])}:{found.line}: imports {found.module}"


def modules_below(package):
    return [name for name in MODULES if name == package or name.startswith(package + ".")]


def part_of(module, package):
    """Return the room, or the top-level module, of package that module is or lies in; None for all others."""
    parts = module.split(".")
    return parts[1] if parts[0] == package and len(parts) > 1 and ".".join(parts[:2]) in MODULES else None


def test_pure_rooms_know_no_ros_clock_socket_or_thread():
    check(
        describe(name, found)
        for name in [name for room in PURE_ROOMS for name in modules_below(room)]
        for found in imports_of(name)
        if found.top in NOT_IN_PURE_ROOMS or sources.is_ros_import(found.module)
    )


def test_rooms_import_only_what_lies_below_them():
    check(
        describe(name, found)
        for room, below in ROOMS.items()
        for name in modules_below(room)
        for found in imports_of(name)
        if part_of(found.module, room.split(".")[0]) not in below | {room.split(".")[1], None}
    )


def test_neither_rooms_nor_modules_import_each_other_in_a_circle():
    for package in sorted({room.split(".")[0] for room in ROOMS}):
        rooms = {name.rpartition(".")[0] for name in MODULES}  # they import what they export
        modules = set(modules_below(package)) - rooms
        by_module = {name: {found.module for found in imports_of(name)} & modules - {name} for name in modules}
        by_room = {}
        for name, imported in by_module.items():
            room = part_of(name, package)
            by_room.setdefault(room, set()).update({part_of(other, package) for other in imported} - {room})
        check_no_circle(by_module)
        check_no_circle(by_room)


def check_no_circle(imports):
    """Remove what imports nothing of the others, again and again; what stays is a circle."""
    while imports:
        leaves = {name for name, imported in imports.items() if not imported & imports.keys()}
        assert leaves, f"circle among {sorted(imports)}"
        imports = {name: imported for name, imported in imports.items() if name not in leaves}


def test_other_packages_are_imported_through_their_rooms():
    # As in `from hero_sim.world import Arena`: what a package or room exports, or a module beside the rooms.
    check(
        describe(name, found)
        for name, found in list_imports()
        if found.module in MODULES and found.top != name.split(".")[0] and found.module.count(".") > 1
        if not found.module.startswith(WITHOUT_A_FACE)
    )


def test_nothing_imports_the_gateway_except_the_node():
    gateway = [(name, found) for name, found in list_imports() if found.module == "hero_driver.gateway"]
    check(describe(name, found) for name, found in gateway if name != "hero_driver.node")


def test_only_the_transports_touch_sockets():
    touching = [(name, found) for name, found in list_imports() if found.top in SOCKETS]
    owners = tuple(owner + "." for owner in SOCKET_OWNERS)
    check(describe(name, found) for name, found in touching if not f"{name}.".startswith(owners))


def test_nothing_imports_a_node():
    check(describe(name, found) for name, found in list_imports() if found.module.endswith(".node"))


def test_real_cameras_and_their_calibration_need_no_simulator():
    package, simulated = "hero_localization", {"simulated_camera"}
    others = [name for name in modules_below(package) if part_of(name, package) not in simulated]
    check(describe(name, found) for name in others for found in imports_of(name) if found.top == "hero_sim")


def test_only_stepped_robots_need_the_client():
    # `python3 -m hero_sim` runs without ROS, and hero_client lies beside it only in a workspace.
    others = [name for name in modules_below("hero_sim") if part_of(name, "hero_sim") not in ("stepped", "in_process")]
    check(describe(name, found) for name in others for found in imports_of(name) if found.top == "hero_client")


def test_the_simulator_shares_only_packets_and_payloads_with_the_driver():
    core = "hero_driver.rosserial"
    for name in modules_below("hero_sim"):
        shared = [f"{core}.{module}" for module in ("errors", "packets", "payloads")]
        if part_of(name, "hero_sim") == "stepped":  # stands in for the driver, too: its pure rules, never its protocol
            shared += ["hero_driver.commands", "hero_driver.corrections"]
        for found in imports_of(name):
            if found.top == "hero_driver" and found.module != core:  # `from hero_driver.rosserial import ...`
                allowed = any(found.module == module or found.module.startswith(module + ".") for module in shared)
                assert allowed, describe(name, found)


def test_the_rooms_and_modules_that_the_rules_name_exist():
    assert {*ROOMS, *PURE_ROOMS, *SOCKET_OWNERS} <= set(MODULES)
