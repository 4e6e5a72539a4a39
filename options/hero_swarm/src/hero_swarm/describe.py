"""Prints the behaviors that pages may start as JSON: python3 -m hero_swarm describe [FOLDER ...].

Those that come with the suite, and those of files in the folders.
"""

import argparse
import glob
import inspect
import json
import os
from typing import Any, Dict, List, Sequence, Type

from hero_node import HeroError, print_error
from hero_sim.world import load_arena

from .behavior import Behavior
from .behaviors import POLICY_ENDING, find_behavior, list_classes, list_names
from .machines.machine_file import ENDING
from .sources import Sources


def main() -> None:
    """Run the program."""
    parser = argparse.ArgumentParser(prog="python3 -m hero_swarm describe", description=__doc__.partition("\n")[0])
    parser.add_argument("folders", nargs="*", help="folders of Python files with behaviors")
    print(json.dumps(describe_behaviors(parser.parse_args().folders)))


def describe_behaviors(folders: Sequence[str] = ()) -> List[Dict[str, Any]]:
    """Return what pages need of each behavior; a file that cannot be loaded is told of and left out."""
    found = [_describe(name, name, find_behavior(name)) for name in list_names()]
    endings = ".py", ENDING, POLICY_ENDING
    patterns = [os.path.join(folder, "*" + ending) for folder in folders for ending in endings]
    for path in (path for pattern in patterns for path in sorted(glob.glob(pattern))):
        try:
            classes = list_classes(path, Sources()) if path.endswith(".py") else {"": find_behavior(path)}
            for arena in {kind.arena for kind in classes.values()} - {""}:
                load_arena(arena)
        except (HeroError, ValueError) as error:
            print_error(str(error) if path in str(error) else f"{path}: {error}")
            continue
        for class_name, kind in classes.items():
            name = os.path.splitext(os.path.basename(path))[0]
            found.append(_describe(name if len(classes) == 1 else class_name, f"{path}:{class_name}".rstrip(":"), kind))
    return found


def _describe(name: str, behavior: str, kind: Type[Behavior]) -> Dict[str, Any]:
    """Return a behavior; behavior: as the program of this name takes it."""
    fields = [
        {"name": key, "default": getattr(kind, key), "limits": setting.limits, "unit": setting.unit}
        for key, setting in kind.settings.items()
    ]
    sentence = (inspect.getdoc(kind) or "").partition("\n")[0]
    return {"behavior": behavior, "title": name.replace("_", " "), "sentence": sentence, "fields": fields}
