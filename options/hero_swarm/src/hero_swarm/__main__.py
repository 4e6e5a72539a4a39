"""Runs a program of the package without ROS: python3 -m hero_swarm run e.yaml."""

from hero_node import run_named

if __name__ == "__main__":
    run_named("hero_swarm", {"fit": "fit", "run": "run", "report": "experiments.report", "show": "show"})
