"""Makes the pictures of recordings as their page says, by the programs themselves: script/pictures.

recording_paths (with speeds, errors): ten robots in a hotspot's network, of which one loses its
power and one its connection.
"""

import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import rospy
from picture_program import make_pictures
from PIL import Image

from hero_sim.srv import InjectFault

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "test" / "bench"))
from running_suite import RunningSuite  # noqa: E402

PICTURES_FOLDER = ROOT / "docs" / "pictures"
RECORDED_S = 60


def record(stage, folder):
    """Record random walks of ten robots, the second from rest, on topics that are recorded by then; return the bag."""
    recorder = stage.start(
        ["rosrun", "hero_recording", "record", "--folder", folder, "--seconds", str(RECORDED_S)],
        stdout=subprocess.DEVNULL,
    )
    stage.wait_for(lambda: list(Path(folder).glob("*.active")), "a recording")
    inject = rospy.ServiceProxy("/hero_sim/fault", InjectFault)

    def walk():
        return stage.start_example("random_walk", "_robots:=all", stdout=subprocess.DEVNULL)

    first_walk = walk()
    start_s = time.monotonic()
    for after_s, act in (
        (15.0, lambda: inject("vanish:robot=1,for=8")),
        (24.0, lambda: inject("leave:robot=2,for=3")),
        (30.0, lambda: first_walk.send_signal(signal.SIGINT)),
        (33.0, walk),
    ):
        time.sleep(max(0.0, start_s + after_s - time.monotonic()))
        act()
    recorder.wait(3 * RECORDED_S)
    (bag,) = Path(folder).glob("*.bag")
    return bag


def plot(bag, prefix, *arguments):
    """Plot a bag to files whose names begin with prefix."""
    subprocess.run(["rosrun", "hero_recording", "plot", str(bag), "--out", str(prefix), *arguments], check=True)


def shrink(path):
    """Reduce a picture to 64 colors: a quarter of its bytes, and no difference to the eye."""
    Image.open(path).convert("RGB").quantize(64).save(path, optimize=True)


def record_ten(picture):
    """Paths, speeds and errors."""
    with RunningSuite(10, "arena:=obstacles", "wifi:=hotspot") as stage, tempfile.TemporaryDirectory() as folder:
        bag = record(stage, folder).rename(Path(folder) / "ten.bag")
        prefix = picture.with_name("recording")
        plot(bag, prefix)
        few = Path(folder) / "few"
        plot(bag, few, "--robots", "1 2 3 6")
        for name in ("paths", "speeds"):
            shutil.move(f"{few}_{name}.png", f"{prefix}_{name}.png")
    for path in prefix.parent.glob("recording_*.png"):
        shrink(path)


if __name__ == "__main__":
    pictures = {"recording_paths": record_ten}
    make_pictures(pictures, PICTURES_FOLDER, __doc__)
