"""The page of parameters, the YAML file and the launch file agree with the code."""

import xml.etree.ElementTree
from pathlib import Path

import documented_parameters
import yaml

from hero_driver.config import DriverConfig, read_config

PACKAGE = Path(__file__).resolve().parents[2]


def test_the_page_and_the_yaml_file_hold_every_limit_and_default():
    page = PACKAGE.parent / "docs" / "driver_parameters.md"
    assert page.read_text() == documented_parameters.make_page()
    text = (PACKAGE / "config" / "hero_driver.yaml").read_text()
    assert text == documented_parameters.make_yaml()
    assert read_config(yaml.safe_load(text)) == DriverConfig()


def test_the_launch_file_has_the_defaults_of_the_code():
    root = xml.etree.ElementTree.parse(str(PACKAGE / "launch" / "hero_driver.launch")).getroot()
    arguments = {argument.get("name"): argument.get("default") for argument in root.iter("arg")}
    defaults = DriverConfig()
    assert arguments["host"] == defaults.host
    assert arguments["port"] == str(defaults.port)
    assert {name for name in arguments if name not in ("config", "name")} <= set(DriverConfig.__dataclass_fields__)


def test_the_launch_file_says_what_each_argument_means():
    root = xml.etree.ElementTree.parse(str(PACKAGE / "launch" / "hero_driver.launch")).getroot()
    assert all(argument.get("doc") for argument in root.iter("arg"))
