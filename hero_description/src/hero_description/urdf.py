"""Dimensions of the robot -> URDF text, and nothing else. Source of the format: http://wiki.ros.org/urdf/XML.

Frames (REP 103: x ahead, y left, z up) are named as the robot names them, without its prefix hero_N: the wheels
turn about y, hat and laser are fixed. All shapes are primitives.
"""

import math
import xml.etree.ElementTree as ElementTree
from typing import Optional, Sequence

from . import dimensions as hero

Vector = Sequence[float]

COLOURS = {
    "shell": "0.15 0.15 0.17 1",
    "deck": "0.90 0.90 0.88 1",
    "board": "0.05 0.35 0.20 1",
    "rubber": "0.05 0.05 0.05 1",
    "rim": "0.95 0.55 0.10 1",
    "sensor": "0.05 0.05 0.25 1",
    "light": "0.75 0.77 0.80 0.9",
    "steel": "0.75 0.75 0.78 1",
}


def format_numbers(values: Vector) -> str:
    """Return numbers as URDF writes them, without noise in the last digits."""
    return " ".join("%.9g" % (round(value, 12) + 0.0) for value in values)


def add_origin(parent: ElementTree.Element, xyz_m: Vector, rpy_rad: Vector = (0.0, 0.0, 0.0)) -> None:
    """Say where something is in its parent's frame."""
    ElementTree.SubElement(parent, "origin", xyz=format_numbers(xyz_m), rpy=format_numbers(rpy_rad))


def add_shape(parent: ElementTree.Element, kind: str, size_m: Vector) -> None:
    """Add a box (x, y, z), a cylinder (radius, length) or a sphere (radius)."""
    geometry = ElementTree.SubElement(parent, "geometry")
    if kind == "box":
        ElementTree.SubElement(geometry, "box", size=format_numbers(size_m))
    elif kind == "cylinder":
        radius, length = (format_numbers([value]) for value in size_m)
        ElementTree.SubElement(geometry, "cylinder", radius=radius, length=length)
    else:
        ElementTree.SubElement(geometry, "sphere", radius=format_numbers(size_m))


def add_visual(
    link: ElementTree.Element,
    name: str,
    kind: str,
    size_m: Vector,
    colour: str,
    xyz_m: Vector = (0.0, 0.0, 0.0),
    rpy_rad: Vector = (0.0, 0.0, 0.0),
) -> None:
    """Add something to look at to a link."""
    visual = ElementTree.SubElement(link, "visual", name=name)
    add_origin(visual, xyz_m, rpy_rad)
    add_shape(visual, kind, size_m)
    ElementTree.SubElement(visual, "material", name=colour)


def add_collision(
    link: ElementTree.Element, size_m: Vector, xyz_m: Vector, rpy_rad: Vector = (0.0, 0.0, 0.0)
) -> None:
    """Add a cylinder (radius, length) to run into to a link."""
    collision = ElementTree.SubElement(link, "collision")
    add_origin(collision, xyz_m, rpy_rad)
    add_shape(collision, "cylinder", size_m)


def add_inertial(link: ElementTree.Element, inertia: hero.Inertia) -> None:
    """Add mass and moments of inertia."""
    inertial = ElementTree.SubElement(link, "inertial")
    add_origin(inertial, inertia.middle_m)
    ElementTree.SubElement(inertial, "mass", value=format_numbers([inertia.mass_kg]))
    ElementTree.SubElement(
        inertial,
        "inertia",
        ixx="%.6g" % inertia.xx_kg_m2,
        iyy="%.6g" % inertia.yy_kg_m2,
        izz="%.6g" % inertia.zz_kg_m2,
        ixy="0",
        ixz="0",
        iyz="0",
    )


def add_joint(
    robot: ElementTree.Element, name: str, kind: str, child: str, xyz_m: Vector, axis: Optional[Vector] = None
) -> None:
    """Join a link to base_link."""
    joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    ElementTree.SubElement(joint, "parent", link="base_link")
    ElementTree.SubElement(joint, "child", link=child)
    add_origin(joint, xyz_m)
    if axis is not None:
        ElementTree.SubElement(joint, "axis", xyz=format_numbers(axis))


def add_base(robot: ElementTree.Element) -> None:
    """The body: shell, deck, caster and the eight sensors."""
    link = ElementTree.SubElement(robot, "link", name="base_link")
    radius_m = hero.BODY_DIAMETER_M / 2
    middle_m = (0.0, 0.0, hero.BODY_BOTTOM_M + hero.BODY_HEIGHT_M / 2)
    # The wheels stand in slots: a shell narrower than the body leaves them in sight.
    shell_radius_m = hero.WHEEL_SEPARATION_M / 2 - hero.WHEEL_WIDTH_M / 2 - 0.001
    add_visual(link, "shell", "cylinder", (shell_radius_m, hero.BODY_HEIGHT_M), "shell", middle_m)
    for name, z_m in (
        ("lower_deck", hero.SENSOR_Z_M),
        ("upper_deck", hero.BODY_BOTTOM_M + hero.BODY_HEIGHT_M),
    ):
        add_visual(link, name, "cylinder", (radius_m, hero.DECK_THICKNESS_M), "deck", (0.0, 0.0, z_m))
    caster_x_m = -0.6 * shell_radius_m
    caster_z_m = hero.GROUND_Z_M + hero.CASTER_DIAMETER_M / 2
    add_visual(link, "caster", "sphere", [hero.CASTER_DIAMETER_M / 2], "steel", (caster_x_m, 0.0, caster_z_m))
    for index in range(hero.SENSOR_COUNT):
        angle_rad = math.tau * index / hero.SENSOR_COUNT
        reach_m = radius_m - hero.SENSOR_SIZE_M[0] / 2
        xyz_m = (reach_m * math.cos(angle_rad), reach_m * math.sin(angle_rad), hero.SENSOR_Z_M + 0.004)
        add_visual(
            link, "sensor_%d" % index, "box", hero.SENSOR_SIZE_M, "sensor", xyz_m, (0.0, 0.0, angle_rad)
        )
    # An arrow on the deck says where ahead is.
    deck_m = hero.BODY_BOTTOM_M + hero.BODY_HEIGHT_M + hero.DECK_THICKNESS_M
    add_visual(link, "ahead", "box", (0.012, 0.003, 0.001), "rim", (radius_m - 0.006, 0.0, deck_m))
    add_collision(link, (radius_m, hero.BODY_HEIGHT_M), middle_m)
    add_inertial(link, hero.BASE_INERTIA)


def add_wheel(robot: ElementTree.Element, side: str, y_m: float) -> None:
    """One wheel, turning about y."""
    link = ElementTree.SubElement(robot, "link", name=side + "_wheel_link")
    radius_m = hero.WHEEL_DIAMETER_M / 2
    lying = (math.pi / 2, 0.0, 0.0)
    add_visual(link, "tyre", "cylinder", (radius_m, hero.WHEEL_WIDTH_M), "rubber", rpy_rad=lying)
    add_visual(link, "rim", "cylinder", (0.7 * radius_m, hero.WHEEL_WIDTH_M + 0.0005), "rim", rpy_rad=lying)
    # A spoke, so that one sees the wheel turn.
    add_visual(link, "spoke", "box", (1.3 * radius_m, hero.WHEEL_WIDTH_M + 0.001, 0.003), "rubber")
    add_collision(link, (radius_m, hero.WHEEL_WIDTH_M), (0.0, 0.0, 0.0), lying)
    add_inertial(link, hero.WHEEL_INERTIA)
    xyz_m = (0.0, y_m, hero.WHEEL_AXLE_Z_M)
    add_joint(robot, side + "_wheel_joint", "continuous", side + "_wheel_link", xyz_m, (0.0, 1.0, 0.0))


def make_urdf() -> str:
    """Return the robot's URDF."""
    robot = ElementTree.Element("robot", name="hero")
    for name, rgba in COLOURS.items():
        material = ElementTree.SubElement(robot, "material", name=name)
        ElementTree.SubElement(material, "color", rgba=rgba)
    add_base(robot)
    add_wheel(robot, "left", hero.WHEEL_SEPARATION_M / 2)
    add_wheel(robot, "right", -hero.WHEEL_SEPARATION_M / 2)

    hat = ElementTree.SubElement(robot, "link", name="hat_link")
    add_visual(hat, "board", "cylinder", (hero.HAT_DIAMETER_M / 2, hero.DECK_THICKNESS_M), "board")
    add_visual(
        hat, "light", "sphere", [hero.LIGHT_DIAMETER_M / 2], "light", (0.0, 0.0, hero.DECK_THICKNESS_M)
    )
    add_inertial(hat, hero.HAT_INERTIA)
    add_joint(robot, "hat_joint", "fixed", "hat_link", hero.HAT_XYZ_M)
    laser = ElementTree.SubElement(robot, "link", name="laser_link")
    add_inertial(laser, hero.LASER_INERTIA)
    add_joint(robot, "laser_joint", "fixed", "laser_link", hero.LASER_XYZ_M)
    return '<?xml version="1.0"?>\n%s\n%s\n' % (
        "<!-- Made from src/hero_description/dimensions.py by: rosrun hero_description make_urdf. Do not edit. -->",
        format_element(robot),
    )


def format_element(element: ElementTree.Element, depth: int = 0) -> str:
    """Return an element as indented text (ElementTree.indent came with Python 3.9)."""
    indent = "  " * depth
    attributes = "".join(' %s="%s"' % item for item in element.attrib.items())
    if not len(element):
        return "%s<%s%s/>" % (indent, element.tag, attributes)
    children = "\n".join(format_element(child, depth + 1) for child in element)
    return "%s<%s%s>\n%s\n%s</%s>" % (indent, element.tag, attributes, children, indent, element.tag)
