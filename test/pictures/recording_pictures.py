"""Makes the pictures of recordings and calibrations as their pages say, by the programs themselves: script/pictures.

recording_paths (with speeds, connections, errors): ten robots in a hotspot's network, of which one loses its
power and one its connection. calibration_motors (with infrared): robots whose servos and sensors are off.
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
CALIBRATION_ARENA = ROOT / "options" / "hero_calibration" / "test" / "rostest" / "calibration_arena.yaml"
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
    """Paths, speeds, connections and errors."""
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


def calibrate(picture):
    """Servos and wheels of hero_1, which has room, and infrared sensors of hero_0, which faces a wall."""
    arena = ["--arena", str(CALIBRATION_ARENA), "--motors", "factory", "--ir", "factory"]
    errors = ["--error", "robot=0,alpha_counts_m2=0.36,alpha6_counts_m2=0.46"]
    errors += ["--error", "robot=1,left_center_us=1533,right_center_us=1478"]
    with RunningSuite(0) as stage, tempfile.TemporaryDirectory() as folder:
        stage.start(
            ["rosrun", "hero_sim", "hero_sim", "--count", "2", "--port", str(stage.port), "--quiet", *arena, *errors]
        )
        program = ["rosrun", "hero_calibration", "calibrate", "--folder", folder, "--yes"]
        subprocess.run([*program, "infrared", "--robots", "0"], check=True)
        shutil.move(folder + "/hero_0.png", str(picture.with_name("calibration_infrared.png")))
        subprocess.run([*program, "motors", "velocity", "--robots", "1"], check=True)
        shutil.move(folder + "/hero_1.png", str(picture))
    for path in picture.parent.glob("calibration_*.png"):
        shrink(path)


if __name__ == "__main__":
    pictures = {"recording_paths": record_ten, "calibration_motors": calibrate}
    make_pictures(pictures, PICTURES_FOLDER, __doc__)
