"""Runs a program of the package without ROS: python3 -m hero_swarm run e.yaml."""

from hero_node import run_named

if __name__ == "__main__":
    experiments = {name: f"experiments.{name}" for name in ("pack", "report", "reproduce", "verify")}
    run_named(
        "hero_swarm",
        {"describe": "describe", "design": "design.program", "fit": "fit", "run": "run", "show": "show", **experiments},
    )
