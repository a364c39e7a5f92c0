"""Pieces of work on several nodes of a cluster, noted as they begin; one node can be made to die in the middle."""

import os
import threading
import time
from contextlib import contextmanager
from functools import partial
from pathlib import Path

LIMIT_S = 120.0


class Noted:
    """An executor that notes in a folder, by an empty file each, which node begins a piece of work.

    No node goes on before so many have begun; on the doomed one, nothing that is written gets its final name.
    """

    def __init__(self, inner, notes, *, nodes, doomed):
        self.parallel, self.threads = inner.parallel, inner.threads
        self._inner, self._work = inner, partial(note, notes, nodes, doomed)

    def run(self, function, items):
        return self._inner.run(partial(self._work, function), items)


def note(notes, nodes, doomed, function, item):
    """Work on an item where the executor has sent it."""
    import ray

    node = ray.get_runtime_context().get_node_id()
    (notes / f"{node}-{time.time_ns()}-{os.getpid()}").touch()
    wait_until(lambda: len(begun(notes)) >= nodes)
    if node == doomed:
        os.fsync = partial(never_ending, notes)
    return function(item)


def never_ending(notes, _descriptor):
    (notes / "writing").touch()
    time.sleep(LIMIT_S)


def begun(notes):
    """Count the pieces that each node has begun."""
    names = [path.name.partition("-")[0] for path in notes.iterdir() if "-" in path.name]
    return {name: names.count(name) for name in names}


def wait_until(true):
    end_s = time.monotonic() + LIMIT_S
    while not true():
        assert time.monotonic() < end_s
        time.sleep(0.02)


@contextmanager
def losing_a_node(cluster, executor, notes):
    """Return an executor of the cluster one of whose nodes is killed while it writes; another takes its place later."""
    notes.mkdir()
    lost = min(cluster.worker_nodes, key=lambda node: node.node_id)

    def kill():
        wait_until((notes / "writing").exists)
        cluster.remove_node(lost, allow_graceful=False)

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    nodes = len(cluster.list_all_nodes())
    yield Noted(executor, notes, nodes=nodes, doomed=lost.node_id)
    killer.join()
    assert len(begun(notes)) == nodes
    cluster.add_node(num_cpus=1)


def contents(folder, *, without=()):
    """Return the files of a folder and below, by their paths; what a lost node was writing is left out."""
    found = (path for path in sorted(Path(folder).rglob("*")) if path.suffix != ".part")
    files = (path for path in found if path.is_file() and path.name not in without)
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}
