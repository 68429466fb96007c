"""How tasks are shared out to the workers of Dask, and what becomes of those that end their process."""

import importlib
import time
from collections import deque
from pathlib import Path
from types import SimpleNamespace

import pytest

from cosim import InputError, SimulationError
from cosim.dispatch.job import Job, RunRow, own_version

dask_workers = pytest.importorskip("cosim.dispatch.dask_workers")


class Client:
    """As of Dask, whose workers do a task at once and die of some runs."""

    def __init__(self, deadly=(), fails=None, threads=2):
        self.deadly, self.fails, self.threads, self.asked = deadly, fails, threads, []

    def nthreads(self):
        return {"a": self.threads - 1, "b": 1} if self.threads else {}

    def submit(self, run, request, pure):
        names = [content["name"] for content, _ in request.runs]
        self.asked.append(names)

        def result():
            if self.fails:
                raise self.fails
            if set(names) & set(self.deadly):
                raise dask_workers.KilledWorker("task", None, 1)
            return [RunRow("done", name, 0.04) for name in names]

        future = SimpleNamespace(key=len(self.asked), result=result)
        future.add_done_callback = lambda then: then(future)
        return future


def workers(client):
    made = object.__new__(dask_workers.DaskWorkers)
    made._client, made._files = client, SimpleNamespace(resettable=())
    made._running, made._walls, made._sent = {}, deque(maxlen=20), set()
    made._cluster, made._notes = None, Path("none")
    return made


def jobs(count):
    return [Job({"name": str(k), "fmus": {}}, [], len) for k in range(count)]


@pytest.mark.parametrize("deadly", [(), ("3",), ("0", "17", "39")])
def test_each_run_has_one_row_and_only_those_that_end_their_process_are_lost(deadly):
    client = Client(deadly)
    rows = {job.content["name"]: row for job, row in workers(client).rows(jobs(40))}
    assert sorted(rows, key=int) == [str(k) for k in range(40)]
    assert [name for name in rows if rows[name].status == "lost"] == [n for n in rows if n in deadly]
    assert all(rows[name].message == name for name in rows if name not in deadly)
    assert all([name] in client.asked for name in deadly), "the last time alone"


def test_tasks_last_about_as_long_as_they_should():
    """Runs of 0.04 s, of which seven take 0.3 s; the first task is one run, as nothing is known."""
    client = Client()
    assert len([*workers(client).rows(jobs(100))]) == 100
    sizes = [len(names) for names in client.asked]
    assert sizes[0] == 1
    assert set(sizes[10:-1]) == {7}
    for wall, size in ((1e-9, dask_workers.MOST_IN_TASK), (0.09, 3), (9.0, 1)):
        made = workers(client)
        made._walls.extend([wall, wall, 1e3 * wall])
        assert made._in_task() == size


@pytest.mark.parametrize(
    ("fails", "raised", "said"),
    [
        (InputError("not so"), InputError, "^not so$"),
        (OSError("gone"), SimulationError, r"the workers were lost: .*gone.*finished runs are kept"),
        (ValueError("odd"), SimulationError, r"the workers were lost: .*odd.*finished runs are kept"),
    ],
)
def test_what_a_task_raises_is_told(fails, raised, said):
    with pytest.raises(raised, match=said):
        list(workers(Client(fails=fails)).rows(jobs(3)))


def test_without_workers_nobody_waits_for_ever(monkeypatch):
    monkeypatch.setattr(dask_workers, "GLANCE", 0.001)
    monkeypatch.setattr(dask_workers, "WITHOUT_WORKERS", 0.01)
    began = time.monotonic()
    with pytest.raises(SimulationError, match=r"there was no worker for 0\.01 s"):
        workers(Client(threads=0))._next(dask_workers.Queue())
    assert time.monotonic() - began >= 0.01


def test_a_worker_of_another_version_runs_nothing(monkeypatch, tmp_path):
    task = importlib.import_module("cosim.dispatch.dask_task")
    monkeypatch.setattr(task, "parent_process", lambda: None)
    monkeypatch.setattr(task, "_folder", lambda worker: tmp_path)
    monkeypatch.setattr(task, "get_worker", lambda: None)
    assert task.run_on_worker(task.Request([], (), frozenset(), own_version())) == []
    with pytest.raises(InputError, match=r"a worker has cybership .*, and this computer has 0\.0$"):
        task.run_on_worker(task.Request([], (), frozenset(), "0.0"))
