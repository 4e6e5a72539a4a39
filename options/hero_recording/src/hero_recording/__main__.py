"""Runs a program of the package without ROS: python3 -m hero_recording export FILE.bag."""

from hero_node import run_named

if __name__ == "__main__":
    run_named("hero_recording", {"export": "export", "plot": "plot"})
