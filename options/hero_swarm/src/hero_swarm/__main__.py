"""Runs a program of the package without ROS: python3 -m hero_swarm run e.yaml."""

from hero_node import run_named

if __name__ == "__main__":
    own = {name: f"experiments.{name}" for name in ("pack", "phantoms", "report", "reproduce", "verify")}
    own.update({name: name for name in ("describe", "fit", "run", "show")}, design="design.program")
    run_named("hero_swarm", own)
