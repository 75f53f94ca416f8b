"""The policy learns a batch, and acts."""

import torch

from lerobot_bimanual.dataset.schema import ACTION, EE_POSE, KEYPOSE_STEP


def test_the_policy_learns_a_batch_and_acts() -> None:
    """Random rows, as many as a batch has."""
    from lerobot_policy_blind_mlp.configuration_blind_mlp import BlindMlpConfig
    from lerobot_policy_blind_mlp.modeling_blind_mlp import BlindMlpPolicy

    policy = BlindMlpPolicy(BlindMlpConfig(device="cpu"))
    batch = {EE_POSE: torch.randn(8, 14), KEYPOSE_STEP: torch.zeros(8, 1), ACTION: torch.randn(8, 18)}
    optimizer = policy.config.get_optimizer_preset().build(policy.get_optim_params())
    first = policy.forward(batch)[0].item()
    for _ in range(50):
        optimizer.zero_grad()
        policy.forward(batch)[0].backward()
        optimizer.step()
    assert policy.forward(batch)[0].item() < first / 2
    assert policy.select_action(batch).shape == batch[ACTION].shape
