"""A Ray cluster of two nodes on this machine, one of which is killed half-way."""

import functools
import threading
import time

import pytest

from agents.functions import evaluate
from agents.interface.parallel import Workers

# Those of Ray are not ours.
pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture
def nodes(monkeypatch):
    ray = pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    second = cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    monkeypatch.setenv("RAY_ADDRESS", cluster.address)
    yield cluster, second
    ray.shutdown()
    cluster.shutdown()


def node_after(seconds, number):
    import ray

    time.sleep(seconds)
    return number, ray.get_runtime_context().get_node_id()


@pytest.mark.study
def test_a_killed_node_changes_no_byte(nodes):
    cluster, second = nodes
    workers = Workers(jobs=2, engine="ray")
    study = {
        R: functools.partial(evaluate, "msprt", episodes=200, measurement_variance=R)
        for R in (0.01, 0.1, 1.0)
    }
    expected = list(Workers(jobs=1).results(study))
    slow = {number: functools.partial(node_after, 4.0, number) for number in range(4)}
    killer = threading.Timer(2.0, lambda: cluster.remove_node(second, allow_graceful=False))
    killer.start()
    # Two were running, one on the killed node.
    survived = [result for _, result in workers.results(slow)]
    killer.join()
    assert [number for number, _ in survived] == list(range(4))
    assert len({node for _, node in survived}) == 1
    assert repr(list(workers.results(study))) == repr(expected)
