"""Ray records the same dataset on several machines."""

import sys

import pytest

from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.commands.dataset_generate import dataset_generate


@pytest.mark.slow
@pytest.mark.sim
@pytest.mark.timeout(900)
def test_two_machines_give_the_dataset_of_one_process(
    generated, small_generation, tree_hashes, tmp_path, monkeypatch
) -> None:
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("RAY_worker_niceness", "0")  # by default everything else on the machine goes first
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        cluster.add_node(num_cpus=1)
        root = tmp_path / generated.name
        dataset_generate(small_generation(root, executor="ray", ray_address=cluster.address, workers=0))
    finally:
        cluster.shutdown()
    assert tree_hashes(root) == tree_hashes(generated)
    assert [path.name for path in tmp_path.iterdir()] == [root.name]


def test_without_ray_the_error_names_the_extra(small_generation, tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    monkeypatch.delitem(sys.modules, "lerobot_env_bimanual.generation.ray_cluster", raising=False)
    with pytest.raises(DatasetError, match=r"pip install 'lerobot_bimanual\[ray\]'"):
        dataset_generate(small_generation(tmp_path / "never", executor="ray"))


def test_a_cluster_that_is_not_there_is_one_clear_error(small_generation, tmp_path, monkeypatch) -> None:
    def init(address: str, **_) -> None:
        raise ConnectionError("no answer")  # what ray says after minutes

    monkeypatch.setattr("ray.init", init)
    with pytest.raises(DatasetError, match=r"cannot reach a ray cluster at 127\.0\.0\.1:1: no answer"):
        dataset_generate(small_generation(tmp_path / "never", executor="ray", ray_address="127.0.0.1:1"))
