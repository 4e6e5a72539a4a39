"""The borders between the layers, as ARCHITECTURE.md draws them: who may import what."""

import pytest
import sources

MODULES = sources.list_source_modules()
NOT_IN_THE_CORE = {"asyncio", "logging", "rospy", "select", "selectors", "socket", "ssl", "threading", "time"}
SOCKETS = {"asyncio", "socket", "socketserver", "ssl", "tornado"}
# The robots' connections, on each side; the connections to subscribers and publishers that rospy has made; the program
# check, which asks for the addresses of names; and the pages of the fleet monitor.
SOCKET_OWNERS = (
    "hero_driver.transport",
    "hero_driver.handshakes",
    "hero_driver.rospy_internals",
    "hero_driver.inlet",
    "hero_sim.link.tcp_link",
    "hero_tools.checkup.network",
    "hero_monitor.server",
    "hero_monitor.program",
)


def imports_of(name):
    return sources.read_imports(MODULES[name])


def modules_below(package):
    return [name for name in MODULES if name == package or name.startswith(package + ".")]


@pytest.mark.parametrize("name", modules_below("hero_driver.rosserial"))
def test_the_rosserial_core_imports_nothing_of_ours_no_clock_and_no_socket(name):
    for found in imports_of(name):
        assert found.top not in NOT_IN_THE_CORE, f"line {found.line}"
        assert not sources.is_ros_import(found.module), f"line {found.line}"
        if found.top.startswith("hero_"):
            assert found.module.startswith("hero_driver.rosserial"), f"line {found.line}"


@pytest.mark.parametrize("name", sorted(MODULES))
def test_only_the_transports_touch_sockets(name):
    touched = {found.top for found in imports_of(name)} & SOCKETS
    owner = any(name == module or name.startswith(module + ".") for module in SOCKET_OWNERS)
    assert owner or not touched, f"{name} imports {', '.join(sorted(touched))}"


@pytest.mark.parametrize("name", sorted(MODULES))
def test_nothing_imports_a_node(name):
    assert not [found for found in imports_of(name) if found.module.endswith(".node")]


@pytest.mark.parametrize("name", modules_below("hero_sim"))
def test_the_simulator_shares_frames_and_payloads_with_the_driver_and_nothing_else(name):
    core = "hero_driver.rosserial"
    shared = [f"{core}.{module}" for module in ("errors", "frames", "payloads")]
    for found in imports_of(name):
        if found.top == "hero_driver" and found.module != core:  # `from hero_driver.rosserial import ...`
            allowed = any(
                found.module == module or found.module.startswith(module + ".") for module in shared
            )
            assert allowed, f"line {found.line}: {found.module}"


# What each room of the simulator may import of hero_sim besides itself; what runs the rooms stands on top.
SIM_GROUND = {"errors", "robot_constants", "yaml_file"}
SIM_ROOMS = {"robot": {"world"} | SIM_GROUND, "world": SIM_GROUND, "link": SIM_GROUND}


def sim_part_of(module):
    """The room of hero_sim that a module is in, or the module itself."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 and parts[0] == "hero_sim" else None


@pytest.mark.parametrize("name", [name for name in modules_below("hero_sim") if sim_part_of(name) in SIM_ROOMS])
def test_the_rooms_of_the_simulator_import_only_what_lies_below_them(name):
    room = sim_part_of(name)
    for found in imports_of(name):
        part = sim_part_of(found.module)
        assert part in SIM_ROOMS[room] | {room, None}, f"line {found.line}: {found.module}"


@pytest.mark.parametrize("name", modules_below("hero_sim.robot") + modules_below("hero_sim.world"))
def test_simulated_robots_and_their_world_know_no_clock_socket_thread_or_ros(name):
    for found in imports_of(name):
        assert found.top not in NOT_IN_THE_CORE and not sources.is_ros_import(found.module), f"line {found.line}"


def test_no_module_of_the_simulator_imports_itself_through_others():
    modules = set(modules_below("hero_sim"))
    imports = {name: {found.module for found in imports_of(name)} & modules - {name} for name in modules}
    while imports:
        leaves = {name for name, imported in imports.items() if not imported & imports.keys()}
        assert leaves, f"circle among {sorted(imports)}"
        imports = {name: imported for name, imported in imports.items() if name not in leaves}


@pytest.mark.parametrize("name", modules_below("hero_client") + modules_below("hero_examples") + modules_below("hero_tutorial"))
def test_examples_and_lessons_know_topics_only(name):
    assert not [found for found in imports_of(name) if found.top in ("hero_driver", "hero_sim")]


@pytest.mark.parametrize("name", modules_below("hero_driver"))
def test_the_driver_knows_nothing_of_the_packages_built_on_it(name):
    others = {name for name in sources.list_packages() if name not in ("hero_msgs", "hero_driver")}
    assert not [found for found in imports_of(name) if found.top in others]


def test_the_layers_that_the_rules_name_exist():
    core = {f"hero_driver.rosserial.{module}" for module in ("errors", "frames", "payloads", "session")}
    assert core.union(SOCKET_OWNERS) <= set(MODULES)
