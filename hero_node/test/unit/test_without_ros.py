"""Parts without ROS are imported where there is no ROS."""

import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "src" / "hero_node"
WITHOUT_ROS = sorted(path.stem for path in FOLDER.glob("*.py") if path.stem != "__init__")
ROS_IS_MISSING = "import sys; sys.modules.update(dict.fromkeys(('rospy', 'rosgraph', 'genpy', 'roslib')))\n"


@pytest.mark.parametrize("module", WITHOUT_ROS)
def test_a_module_outside_of_ros_is_imported_without_it(module):
    code = ROS_IS_MISSING + "sys.path.insert(0, %r)\nimport hero_node.%s" % (str(FOLDER.parent), module)
    subprocess.run([sys.executable, "-c", code], check=True)
