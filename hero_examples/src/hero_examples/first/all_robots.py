"""Lets all robots turn on the spot, each in a color of its own."""

import colorsys

from hero_client import BaseSwarm, Swarm


def turn_all(swarm: BaseSwarm) -> None:
    swarm.wait_until_ready()
    for number, robot in enumerate(swarm):
        robot.led(colorsys.hsv_to_rgb(number / len(swarm), 1.0, 1.0))
    swarm.drive(0.0, 1.0, duration_s=1.5)
    swarm.led("off")


def main() -> None:
    with Swarm.discover() as swarm:  # all robots that the drivers report
        turn_all(swarm)


if __name__ == "__main__":
    main()
