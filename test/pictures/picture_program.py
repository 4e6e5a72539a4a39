"""Names of pictures on a command line -> the pictures, each made in its own process."""

import argparse
import subprocess
import sys
from pathlib import Path


def make_pictures(pictures, folder, description):
    """Make the pictures that are named, or all. pictures: functions by name, each of which takes the file's path."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("names", nargs="*", choices=[[], *pictures], help="which; without a name: all")
    parser.add_argument("--folder", default=str(folder), help="where the pictures go (default: %(default)s)")
    options = parser.parse_args()
    names = options.names or list(pictures)
    if len(names) == 1:
        pictures[names[0]](Path(options.folder) / (names[0] + ".png"))
        print(f"{options.folder}/{names[0]}.png", flush=True)
        return
    for name in names:
        subprocess.run([sys.executable, sys.argv[0], name, "--folder", options.folder], check=True)
