"""The URDF of HeRo+, from that of the stock robot: larger wheels, and a bump shield around the body. Pure.

Sources: wheels, their distance and the shield's radius as in docs/robot_interface.md; the shield's height is chosen
for the eye.
"""

import xml.etree.ElementTree as ElementTree

WHEEL_RADIUS_M = 0.025
STOCK_WHEEL_RADIUS_M = "0.0246"
WHEEL_Y_M = 0.0325
SHIELD_RADIUS_M = 0.060
SHIELD_HEIGHT_M = 0.004


def make_hero_plus(urdf: str) -> str:
    """Return the URDF of HeRo+."""
    robot = ElementTree.fromstring(urdf)  # noqa: S314 - this package's own file
    robot.set("name", "hero_plus")
    for cylinder in robot.iter("cylinder"):
        if cylinder.get("radius") == STOCK_WHEEL_RADIUS_M:
            cylinder.set("radius", f"{WHEEL_RADIUS_M:g}")
    for joint in robot.iter("joint"):
        origin, side = joint.find("origin"), {"left_wheel_joint": 1, "right_wheel_joint": -1}.get(joint.get("name", ""))
        if origin is not None and side is not None:
            _, _, z_m = origin.get("xyz", "").split()
            origin.set("xyz", f"0 {side * WHEEL_Y_M:g} {z_m}")
    base = robot.find("link[@name='base_link']")
    if base is not None:
        for kind in ("collision", "visual"):
            shape = ElementTree.SubElement(base, kind)
            ElementTree.SubElement(shape, "origin", xyz="0 0 0.02", rpy="0 0 0")
            size = {"radius": f"{SHIELD_RADIUS_M:g}", "length": f"{SHIELD_HEIGHT_M:g}"}
            ElementTree.SubElement(ElementTree.SubElement(shape, "geometry"), "cylinder", size)
        ElementTree.SubElement(shape, "material", name="rim")
    return ElementTree.tostring(robot, encoding="unicode")
