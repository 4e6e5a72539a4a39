"""Experiments compute their batches in this process: a worker process costs two seconds of CPU to start."""

import pickle
from concurrent.futures import Executor, Future

import pytest

AHEAD = """\
from hero_swarm.behavior import Behavior

class Ahead(Behavior):
    metric = "dispersion"

    def step(self, sensed, memory, random):
        return 0.1, 0.0, memory
"""


class InProcess(Executor):
    """Takes tasks as a worker process does, as copies."""

    def submit(self, function, *arguments):
        future = Future()
        try:
            future.set_result(function(*pickle.loads(pickle.dumps(arguments))))
        except Exception as error:  # noqa: BLE001 - as an executor does
            future.set_exception(error)
        return future


@pytest.fixture(autouse=True)
def compute_in_this_process(request, monkeypatch):
    if "workers" not in request.fixturenames:
        # By its name: a package that cannot be imported fails tests, not their collection.
        monkeypatch.setattr("hero_swarm.experiments.computing.engines.open_pool", lambda jobs: InProcess())


@pytest.fixture(name="ahead")
def give_ahead():
    """Return the file of a behavior that drives ahead."""
    return AHEAD


@pytest.fixture(name="workers")
def use_worker_processes():
    """For tests of what only processes show."""
