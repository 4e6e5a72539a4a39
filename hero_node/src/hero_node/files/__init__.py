"""Files that users and programs write: safely replaced, YAML with line numbers, calibrations. Knows no ROS."""

from .calibration_file import (
    HERO_PLUS,
    PREVIOUS,
    SETTINGS,
    STOCK,
    CalibrationFileError,
    Calibrations,
    KeptCalibration,
    list_files,
    read_calibration,
    read_calibrations,
)
from .fleet_file import ExtraTopic, FleetFile, RobotNotes, name_fleet_file, read_fleet_file
from .marked_yaml import Entry, EntryError, load_entries, mark_values, read_entries
from .safe_file import hold_file, lock_file, make_new_name, name_file, read_file, replace_file, write_file
from .yaml_edit import replace_values
from .yaml_text import YamlError, decode_text, parse_yaml, read_text
