"""The network computes the written-out formulation, faster."""

from dataclasses import replace

import peract2_written_out as reference
import pytest
import torch

from lerobot_bimanual.codec_torch import KeyposeBins
from lerobot_policy_bimanual import PerAct2Config
from lerobot_policy_bimanual.keypose.losses import keypose_losses
from lerobot_policy_bimanual.peract.convolutions import PatchConv3d, PointwiseConv3d, pad_replicate
from lerobot_policy_bimanual.peract.dense_head import DenseTranslation
from lerobot_policy_bimanual.peract.factorised_head import FactorisedTranslationHead
from lerobot_policy_bimanual.peract.network import PerActNetwork
from lerobot_policy_bimanual.peract.pooling import pool
from lerobot_policy_bimanual.peract.upsample import UpsampledConv3d


@pytest.fixture
def make_network(tiny):
    """Networks of the tiny size in double precision, for one arm or two."""

    def make(arms: int = 2, **changes) -> PerActNetwork:
        config = PerAct2Config(**tiny | changes)
        return PerActNetwork(config, arms=arms, proprio_dim=4 * arms).double()

    return make


def make_inputs(arms: int = 2) -> tuple[torch.Tensor, ...]:
    sizes = ((10, 10, 10, 10), (4 * arms,), (4, 16))
    return tuple(torch.randn(2, *size, dtype=torch.float64) for size in sizes)


def labels(voxel: torch.Tensor) -> KeyposeBins:
    """Labels with these voxels; the network reads no other part of them."""
    rest = torch.zeros(voxel.shape[:-1], dtype=torch.long)
    return KeyposeBins(voxel, voxel, rest, rest, voxel)


@pytest.mark.parametrize(
    ("arms", "checkpointing", "chunk"),
    [(1, False, 2**21), (2, False, 2**21), (2, True, 2**21), (2, False, 900)],
)
def test_dense_network_equals_the_written_out_one(make_network, monkeypatch, arms, checkpointing, chunk):
    for module in ("pooling", "upsample"):
        monkeypatch.setattr(f"lerobot_policy_bimanual.peract.{module}.CHUNK_CPU", chunk)
    network = make_network(arms, activation_checkpointing=checkpointing)
    inputs = make_inputs(arms)
    voxel = torch.randint(0, 10, (2, arms, 3))
    classes = torch.cat([torch.randint(0, 72, (2, arms, 3)), torch.randint(0, 2, (2, arms, 2))], dim=-1)

    parameters = dict(network.named_parameters())
    translation, pose = reference.network(parameters, *inputs, arms=arms, heads=2)
    loss = reference.one_hot_loss(translation, pose, voxel, classes)
    expected = torch.autograd.grad(loss, list(parameters.values()))

    prediction = network(*inputs, labels(voxel))
    torch.testing.assert_close(prediction.translation.logits, translation)
    parts = (prediction.rotation.flatten(2), prediction.gripper_open, prediction.ignore_collisions)
    torch.testing.assert_close(torch.cat(parts, dim=-1), pose)
    angles, flags = classes.split((3, 2), dim=-1)
    losses = keypose_losses(prediction, KeyposeBins(voxel, angles, *flags.unbind(-1), voxel))
    actual = torch.autograd.grad(sum(losses.values()).mean(), list(parameters.values()))
    by_name = (dict(zip(parameters, each, strict=True)) for each in (actual, expected))
    torch.testing.assert_close(*by_name)


@pytest.mark.parametrize("size", [1, 2, 4])
def test_upsampled_convolution_equals_interpolation_then_convolution(size):
    layer = UpsampledConv3d(3, 2).double()
    torch.nn.init.normal_(layer.conv.bias)
    x = torch.randn(2, 3, size, size + 1, size + 2, dtype=torch.float64, requires_grad=True)
    weights = (x, layer.conv.weight, layer.conv.bias)
    expected = pad_replicate(reference.upsampled_conv(*weights), 1, 1)
    actual = layer(x, layer.kernel())
    torch.testing.assert_close(actual, expected)
    probe = torch.randn_like(actual)
    gradients = (torch.autograd.grad(each, weights, probe) for each in (actual, expected))
    torch.testing.assert_close(*gradients)


def test_pooling_keeps_the_ranking_of_bfloat16_features():
    x = torch.zeros(1, 1, 4, 4, 4, dtype=torch.bfloat16)
    x[0, 0, 3, 0, 1] = 8
    assert pool(x).dtype == torch.float32
    torch.testing.assert_close(pool(x)[0], torch.tensor([1.0, -1.0, -1 / 3, 8.0]))


def test_factorised_head_is_one_distribution_over_all_voxels_and_its_loss_the_likelihood(make_network):
    network, inputs = make_network(translation_head="factorised").eval(), make_inputs()
    candidates = network(*inputs).translation.candidates()  # 8 patches, all within the beam
    assert len(torch.unique(candidates.voxel[0, 0], dim=0)) == candidates.voxel.shape[2] == 1000
    torch.testing.assert_close(candidates.score.exp().sum(-1), torch.ones(2, 2, dtype=torch.float64))
    voxel = torch.randint(0, 10, (2, 2, 3))
    hit = (candidates.voxel == voxel[:, :, None]).all(-1)
    loss = network(*inputs, labels(voxel)).translation.cross_entropy(voxel, torch.zeros(2, 2, 3))
    torch.testing.assert_close(loss, -candidates.score[hit].view(2, 2))


def test_a_voxels_score_depends_on_what_lies_in_line_with_it_however_far():
    config = PerAct2Config(device="cpu", translation_head="factorised", channels=4, token_dim=8)
    head = FactorisedTranslationHead(config, arms=1)
    layers = PointwiseConv3d(4, 4), PatchConv3d(4, 4, centred=False)
    torch.nn.init.dirac_(layers[0].conv.weight)  # gives a stem that is positive as it is
    stem, patches = torch.rand(1, 4, 20, 20, 20), torch.rand(1, 4, 4, 4, 4)
    inputs = patches, torch.rand(1, 1, 8, 4, 4, 4), torch.tensor([[[2, 2, 2]]])
    before = head(head.read(stem, *layers, None)[0], *inputs)[0].target_voxel_logits
    stem[0, :, 2, 1, 17] = 10  # three patches above
    after = head(head.read(stem, *layers, None)[0], *inputs)[0].target_voxel_logits
    x, y, _ = torch.cartesian_prod(*[torch.arange(5)] * 3).unbind(1)
    below = ((x - 2).abs() <= 1) & ((y - 1).abs() <= 1)
    assert (before != after)[0, 0].equal(below)


def test_cells_add_the_likelihood_of_the_place_within_the_voxel(make_network):
    network = make_network(translation_head="factorised", voxel_cells=4).eval()
    inputs = make_inputs()
    voxel = torch.randint(0, 10, (2, 2, 3))
    translation = network(*inputs, labels(voxel)).translation
    # The middles of all 64 cells of a voxel.
    middle = torch.arange(4) / 4 - 0.375
    offsets = torch.cartesian_prod(middle, middle, middle)
    losses = torch.stack([translation.cross_entropy(voxel, o.expand(2, 2, 3)) for o in offsets])
    cells = translation.cell_logits, translation.target_cell_logits
    whole = replace(translation, cell_logits=cells[0][..., :0], target_cell_logits=cells[1][..., :0])
    torch.testing.assert_close((-losses).exp().sum(0), (-whole.cross_entropy(voxel, offsets[0])).exp())


def test_local_mean_is_the_expectation_over_the_window_round_the_best_voxel(make_network):
    network = make_network(translation_head="factorised").eval()
    candidates = network(*make_inputs()).translation.candidates()  # of all voxels
    for sample, arm in ((0, 0), (0, 1), (1, 0), (1, 1)):
        voxel, weight = candidates.voxel[sample, arm], candidates.score[sample, arm].exp()
        best = voxel[weight.argmax()]
        assert torch.equal(candidates.best()[sample, arm], best)
        window = ((voxel - best).abs() <= 1).all(-1)
        expected = (weight[window, None] * voxel[window]).sum(0) / weight[window].sum()
        torch.testing.assert_close(candidates.local_mean()[sample, arm], expected)


def test_dense_candidates_have_their_logits_and_leave_out_neighbours_beyond_the_border():
    logits = torch.randn(2, 2, 10, 10, 10)
    logits[:, :, 0, 9, 5] = 1e3
    candidates = DenseTranslation(logits).candidates()
    assert candidates.best().tolist() == [[[0, 9, 5]] * 2] * 2
    assert torch.isneginf(candidates.score).sum(-1).unique().tolist() == [27 - 2 * 2 * 3]
    voxel, score = candidates.voxel[0, 1], candidates.score[0, 1]
    inside = torch.isfinite(score)
    assert torch.equal(score[inside], logits[0, 1, *voxel[inside].T])
