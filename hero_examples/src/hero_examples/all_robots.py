"""Lets all robots turn on the spot, each in a color of its own."""

import colorsys
import time

from hero_client import Swarm


def main() -> None:
    with Swarm.discover() as swarm:  # all robots that the drivers report
        swarm.wait_until_ready()
        for number, robot in enumerate(swarm):
            robot.led(colorsys.hsv_to_rgb(number / len(swarm), 1.0, 1.0))
            robot.drive(0.0, 1.0)  # obeyed for about 2 s
        time.sleep(1.5)
        swarm.led("off")


if __name__ == "__main__":
    main()
