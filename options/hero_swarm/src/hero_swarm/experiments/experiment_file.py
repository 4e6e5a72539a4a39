"""The file of an experiment: which behavior, what varies, how long, which seeds and metrics. Pure.

Each combination of the values that vary is a cell; each cell runs with every seed. Paths of files (of a behavior, an
arena, errors, start places, metrics) are relative to the file's folder.
"""

import itertools
import json
import math
import os
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from hero_node import suggest
from hero_node.files import Entry, EntryError, YamlError, read_entries, read_text
from hero_sim.errors import OptionError
from hero_sim.link import parse_wifi
from hero_sim.world import KINDS, SHIPPED

from ..metrics import FALLING
from ..metrics.own import is_own, list_names
from ..sources import Sources
from .errors import ExperimentError
from .worlds import NOMINAL, OF_PAPERS, WORLDS

MAX_ROBOTS = 1000
MAX_TIME_S = 86_400.0
MAX_SEED = 2**31 - 1
MAX_RUNS = 1_000_000

START_KEYS: Dict[str, Tuple[Tuple[str, ...], Tuple[str, ...]]] = {
    # of each kind of start: what it needs, and what it may have
    "uniform": (("cover",), ("gap_m",)),
    "grid": ((), ("gap_m",)),
    "circle": ((), ("gap_m",)),
    "file": (("file",), ()),
    "arena": ((), ()),
}
SETTINGS = ("robots", "body", "errors", "delay_s", "arena", "objects", "wifi")
ERRORS = {"perfect": 0.0, "default": 1.0}
"""Differences between robots, as an option of the simulator: shares of the usual ones."""
MAX_ERRORS = 10.0
ERROR_KEYS = tuple("errors." + key for key in KINDS)
"""Differences that are the same for all robots, as hero_sim --error takes them."""
OBJECTS = ("arena", "scattered")
"""Places of the objects at the start: as in the arena, or drawn from each seed."""
ROBOT, POINT = BODIES = ("robot", "point")
"""Bodies: those of robots, or points (points.py)."""
TESTS = ("wilcoxon",)
NOT_PARAMETERS = ("behavior", "start", "world", *SETTINGS, *ERROR_KEYS)
"""Names that may vary besides numbers of the behavior and its sensors."""
_REQUIRED = ("time_s", "seeds", "metrics")
_KEYS = (
    "behavior", "vary", "world", *SETTINGS, "parameters", "start", "time_s", "until", "seeds", "metrics", "record",
    "compare",
)  # fmt: skip
_PARAMETERS_REMEDY = (
    "numbers of the behavior or its sensors, such as near.range_m, stand below parameters, or as lists below vary"
)


class Bound(NamedTuple):
    """A condition: that a metric has come down to a value, or up to it."""

    metric: str
    value: float
    falls: bool

    def holds(self, value: Any) -> Any:
        """Return whether it holds for a value of the metric, or for each of an array."""
        return value <= self.value if self.falls else value >= self.value


class Metric(NamedTuple):
    """A column of the results.

    Attributes:
        source: the metric that is computed.
        last_s: its mean over the last seconds of a run; 0: its value at the end.
        bound: the column is the time (s) until this holds, inf if it never does.
    """

    name: str
    source: str
    last_s: float = 0.0
    bound: Optional[Bound] = None

    @property
    def falls(self) -> bool:
        """True if less is better."""
        return self.bound is not None or self.source in FALLING


class Start(NamedTuple):
    """Placement of robots; lengths in m.

    Attributes:
        kind: uniform in a square of which the bodies cover a share; grid or circle with gaps between bodies; file: the
            poses of a file; arena: starts of the arena.
        cover: share of the square that bodies cover.
        gap_m: least distance between bodies.
        file: path of a CSV file with a line x m, y m, yaw rad for each robot.
    """

    kind: str
    cover: float
    gap_m: float
    file: Optional[str]


NO_START = Start("arena", 0.0, 0.0, None)


class Cell(NamedTuple):
    """One combination of the values that vary.

    Attributes:
        varied: name -> value, in the order of the file: the columns of the results.
        settings: robots, body, errors, delay_s (age of the poses that robots sense each other by), arena, objects,
            wifi, and differences of all robots by ERROR_KEYS.
        parameters: name -> value, of the behavior; of a sensor, SENSOR.FIELD.
        own: names of parameters that are given with the behavior, which must have them.
    """

    varied: Dict[str, Any]
    settings: Dict[str, Any]
    parameters: Dict[str, float]
    behavior: str
    start: Start
    own: Tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """The values that vary, for users."""
        return ", ".join("%s %s" % item for item in self.varied.items()) or "all"


class _Value(NamedTuple):
    """A value of the file: its text or number in tables, and the fields of a cell that it sets."""

    label: Any
    fields: Dict[str, Any]


class Comparing(NamedTuple):
    """Which metric is compared between which cells: those that differ in one name only."""

    metric: str
    between: str
    test: str


class Experiment(NamedTuple):
    """A file that has been checked.

    Attributes:
        seeds: of each cell.
        metrics: columns of the results.
        until: a run ends when this holds.
        record_hz: of trajectories; 0: none.
        places: name of a key, parameter or varied value -> file and line, for errors.
        folder: base of relative paths.
        sources: contents of the files that runs read.
    """

    cells: Tuple[Cell, ...]
    time_s: float
    until: Optional[Bound]
    seeds: range
    metrics: Tuple[Metric, ...]
    record_hz: float
    compare: Optional[Comparing]
    places: Mapping[str, str]
    folder: str
    sources: Sources

    @property
    def behavior(self) -> str:
        """All behaviors, for users."""
        return ", ".join(self.list_behaviors())

    def list_behaviors(self) -> List[str]:
        """Return the behaviors of all cells."""
        return list(dict.fromkeys(cell.behavior for cell in self.cells))

    def locate(self, name: str) -> str:
        """Return a built-in name, or that of a file with what follows, as it is found from any folder."""
        is_file = name.partition(":")[0].endswith((".py", ".npz", ".controller"))
        return os.path.join(self.folder, name) if is_file else name

    def list_code(self) -> Dict[str, bytes]:
        """Return the contents of all files that runs read besides those of list_files(), by paths relative to folder.

        They are known once all cells were built: the behavior, the modules that it imports, and pictures of maps.
        """
        others = {os.path.abspath(path) for cell in self.cells for path in self.list_files(cell).values()}
        return self.sources.list_contents(os.path.abspath(self.folder), others)

    def list_files(self, cell: Cell) -> Dict[str, str]:
        """Return the files that a run of cell reads, without that of the behavior: name in places -> path."""
        named = {"file": cell.start.file, **{name: cell.settings.get(name) for name in ("arena", "errors")}}
        built_in = (*SHIPPED, *ERRORS)
        return {
            name: os.path.join(self.folder, path)
            for name, path in named.items()
            if isinstance(path, str) and path not in built_in
        }

    def describe_cell(self, cell: Cell) -> str:
        """Return all that a run of cell depends on besides its seed and the code, as JSON."""
        of_all = {name: getattr(self, name) for name in ("time_s", "until", "metrics", "record_hz")}
        return json.dumps({"cell": cell._asdict(), **of_all}, sort_keys=True)


def read_experiment(path: str, folder: Optional[str] = None) -> Tuple[str, Experiment]:
    """Return the text of an experiment's file, and what it describes; folder: as of parse_experiment().

    Raises: ExperimentError.
    """
    try:
        text = read_text(path)
    except (OSError, YamlError) as error:
        raise ExperimentError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from error
    return text, parse_experiment(text, path, folder)


def parse_experiment(text: str, file: str, folder: Optional[str] = None) -> Experiment:
    """Return the experiment in text, the contents of file.

    folder: base of relative paths; None: that of file. Files that runs read are read when they are needed first;
    behavior and parameters are checked when they are loaded.
    Raises: ExperimentError with file and line for whatever is unknown, missing, or of a wrong type or unit.
    """
    try:
        entry = read_entries(text, file, "behavior: aggregation")
        return check_experiment(entry, os.path.dirname(file) if folder is None else folder, Sources())
    except EntryError as error:
        raise ExperimentError(str(error)) from None


def check_experiment(entry: Entry, folder: str, sources: Sources) -> Experiment:
    """Return what the entries of a file describe; arguments and errors as of parse_experiment(), EntryError too."""
    allowed = (*_KEYS, *(name for name in entry.mapping() if name in ERROR_KEYS))
    root = entry.mapping(allowed, _REQUIRED, _PARAMETERS_REMEDY)
    given = root["seeds"].mapping(("from", "count"), ("count",))
    first = given["from"].whole(0, MAX_SEED) if "from" in given else 1
    seeds = range(first, first + given["count"].whole(1, MAX_RUNS))
    cells = _parse_cells(root, entry.place, len(seeds))
    metrics = tuple(_parse_metric(entry) for entry in root["metrics"].entries())
    names = [metric.name for metric in metrics]
    _check_different(root["metrics"], names)
    time_s = root["time_s"].number(0.1, MAX_TIME_S, "s")
    until = _parse_bound(root["until"]) if "until" in root else None
    record_hz = 0.0
    if "record" in root:
        record_hz = root["record"].mapping(("hz",), ("hz",))["hz"].number(0.01, 20.0, "Hz")
    compare = _parse_comparing(root["compare"], names, cells) if "compare" in root else None
    places = dict(_list_places(entry))
    places["behavior"] = places.get("behavior", entry.place)
    return Experiment(cells, time_s, until, seeds, metrics, record_hz, compare, places, folder, sources)


def _list_places(entry: Entry) -> Iterator[Tuple[str, str]]:
    """Yield the names of all mappings and where they stand, inner ones first."""
    named: Dict[str, Entry] = entry.value if isinstance(entry.value, dict) else {}
    for value in named.values() or (entry.value if isinstance(entry.value, list) else ()):
        yield from _list_places(value)
    for name, value in named.items():
        yield name, value.place


def _parse_start(entry: Entry) -> Start:
    given = entry.mapping(("kind", "cover", "gap_m", "file"), ("kind",))
    kind = given["kind"].choice(START_KEYS)
    required, optional = START_KEYS[kind]
    for name, value in given.items():
        if name not in ("kind", *required, *optional):
            raise ExperimentError(f"{value.place}: start.{name} does not go with kind: {kind}; leave it out")
    entry.mapping(None, required)
    cover = given["cover"].number(1e-4, 0.5, "(share of the area)") if "cover" in given else 0.0
    gap_m = given["gap_m"].number(0.0, 10.0, "m") if "gap_m" in given else 0.0
    return Start(kind, cover, gap_m, given["file"].text() if "file" in given else None)


def _parse_value(name: str, entry: Entry) -> _Value:
    """Return what the value of a setting, or of a parameter of the behavior, sets."""
    if name == "behavior":
        return _parse_behavior(entry)
    if name == "world":
        known = {**WORLDS, **OF_PAPERS}
        world = entry.choice(known)
        return _Value(world, {"settings": known[world]})
    if name == "start":
        start = _parse_start(entry)
        given = {key: value.value for key, value in entry.mapping().items() if key != "kind"}
        return _Value(_label(start.kind, given), {"start": start})
    if name in SETTINGS or name in ERROR_KEYS:
        value = _parse_setting(name, entry)
        return _Value(value, {"settings": {name: value}})
    value = entry.number(-1e6, 1e6, f"as of a parameter{suggest(name, NOT_PARAMETERS)}")
    return _Value(value, {"parameters": {name: value}})


def _parse_behavior(entry: Entry) -> _Value:
    """Return a behavior by its name, or by {NAME: {parameter: number}}."""
    if not isinstance(entry.value, dict):
        return _Value(entry.text(), {"behavior": entry.text()})
    name, inner = entry.single((*entry.value,))
    given = {key: value.number(-1e6, 1e6, "") for key, value in inner.mapping().items()}
    return _Value(_label(name, given), {"behavior": name, "parameters": given, "own": tuple(given)})


def _label(name: str, given: Mapping[str, Any]) -> str:
    return " ".join([name, *("%s %s" % item for item in given.items())])


def _parse_setting(name: str, entry: Entry) -> Any:
    if name in ERROR_KEYS:
        kind = KINDS[name.partition(".")[2]]
        return entry.number(kind.least, kind.most, "")
    if name == "errors" and not isinstance(entry.value, str):
        return entry.number(0.0, MAX_ERRORS, "times the usual differences, or perfect, default or a file")
    if name == "wifi":
        try:
            parse_wifi(entry.text())
        except OptionError as error:
            raise ExperimentError(f"{entry.place}: {error}") from None
    if name == "robots":
        return entry.whole(1, MAX_ROBOTS)
    if name == "delay_s":
        return entry.number(0.0, 10.0, "s")
    if name == "body":
        return entry.choice(BODIES)
    if name == "objects":
        return entry.choice(OBJECTS)
    return entry.text()


def _check_different(entry: Entry, values: Sequence[Any]) -> None:
    """Check that values, those of the items of a list, differ. Raises: ExperimentError."""
    seen = set()
    for item, value in zip(entry.entries(), values):
        if value in seen:
            raise ExperimentError(f"{item.place}: {entry.name} holds {value!r} more than once")
        seen.add(value)


def _parse_cells(root: Dict[str, Entry], place: str, seeds: int) -> Tuple[Cell, ...]:
    given = root["parameters"].mapping() if "parameters" in root else {}
    settings = {name: entry for name, entry in root.items() if name in NOT_PARAMETERS}
    fixed = {name: _parse_value(name, entry) for name, entry in {**settings, **given}.items()}
    varied: List[Tuple[str, List[_Value]]] = []
    for name, entry in (root["vary"].mapping() if "vary" in root else {}).items():
        if name in fixed:
            raise ExperimentError(f"{entry.place}: {name} is given twice: once as what varies")
        values = [_parse_value(name, item) for item in entry.entries()]
        _check_different(entry, [value.label for value in values])
        varied.append((name, values))
    names = [name for name, _ in varied]
    for name in {*fixed, *names} if "world" in {*fixed, *names} else ():
        if name in ERROR_KEYS or name in WORLDS[NOMINAL]:
            raise ExperimentError(f"{place}: {name} does not go with world, which gives it; leave one out")
    for name, example in (("behavior", "behavior: milling"), ("robots", "robots: 20")):
        if name not in fixed and name not in names:
            where = root["behavior"].place if "behavior" in root else place
            raise ExperimentError(f"{where}: {name} is missing: give {example}, or vary it")
    runs = math.prod(len(values) for _, values in varied) * seeds
    if runs > MAX_RUNS:
        root["seeds"].refuse("such that there are at most %d runs, not %d" % (MAX_RUNS, runs))
    combinations = itertools.product(*(values for _, values in varied))
    return tuple(_make_cell(list(fixed.values()), dict(zip(names, chosen))) for chosen in combinations)


def _make_cell(fixed: List[_Value], chosen: Dict[str, _Value]) -> Cell:
    """Return the cell that all these values set."""
    varied = {name: value.label for name, value in chosen.items()}
    fields: Dict[str, Any] = {"settings": {}, "parameters": {}, "start": NO_START}
    for value in [*fixed, *chosen.values()]:
        for name, new in value.fields.items():
            fields[name] = {**fields[name], **new} if isinstance(new, dict) else new
    return Cell(varied, **fields)


def _parse_bound(entry: Entry) -> Bound:
    """Return the bound of a mapping such as {dispersion_ratio: 1.15} or {order: ">= 0.9"}."""
    name, value = entry.single(list_names(entry.value))
    if is_own(name) and not isinstance(value.value, str):
        value.refuse('a text such as "<= 1.15" or ">= 0.95", as the metric is your own')
    if not isinstance(value.value, str):
        return Bound(name, value.number(-math.inf, math.inf, ""), name in FALLING)
    sign, _, text = value.value.partition(" ")
    try:
        limit = float(text)
    except ValueError:
        limit = math.nan
    if sign not in ("<=", ">=") or not math.isfinite(limit):
        value.refuse('a number, or a text such as "<= 1.15" or ">= 0.95"')
    return Bound(name, limit, sign == "<=")


def _parse_metric(entry: Entry) -> Metric:
    if not isinstance(entry.value, dict):
        name = entry.choice(list_names(entry.value))
        return Metric(_name_column(name), name)
    kind, inner = entry.single(("time_until", "mean_of_last_s"))
    if kind == "time_until":
        bound = _parse_bound(inner)
        return Metric(f"time_until_{_name_column(bound.metric)}_{bound.value:g}_s", bound.metric, bound=bound)
    name, value = inner.single(list_names(inner.value))
    last_s = value.number(1.0, MAX_TIME_S, "s")
    return Metric(f"{_name_column(name)}_mean_of_last_{last_s:g}_s", name, last_s)


def _name_column(metric: str) -> str:
    """Return the name of a metric; of FILE.py:FUNCTION the function's."""
    return metric.rpartition(":")[2]


def _parse_comparing(entry: Entry, metrics: List[str], cells: Tuple[Cell, ...]) -> Comparing:
    given = entry.mapping(("metric", "between", "test"), ("metric", "between"))
    if not cells[0].varied:
        raise ExperimentError("%s: compare needs something that varies, such as vary: {robots: [10, 20]}" % entry.place)
    test = given["test"].choice(TESTS) if "test" in given else TESTS[0]
    return Comparing(given["metric"].choice(metrics), given["between"].choice(list(cells[0].varied)), test)
