"""Ray records the same dataset on several machines."""

import runpy
from pathlib import Path

import pytest

from lerobot_env_bimanual.commands.dataset_generate import make_dataset, settings_of

EXAMPLE = Path(__file__).parents[2] / "examples/11_ray_cluster.py"


@pytest.mark.weekly
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
        monkeypatch.setenv("RAY_ADDRESS", cluster.address)
        config = small_generation(root)
        make_dataset(settings_of(config), root, runpy.run_path(str(EXAMPLE))["ray_executor"](0))
    finally:
        cluster.shutdown()
    assert tree_hashes(root) == tree_hashes(generated)
    assert [path.name for path in tmp_path.iterdir()] == [root.name]
