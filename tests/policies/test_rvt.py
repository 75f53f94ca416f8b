"""RVT computes the written-out formulation, faster, and decodes what it was trained towards."""

import itertools
from typing import Any

import pytest
import torch
import torch.nn.functional as F  # noqa: N812
from peract2_written_out import block, leaky

from lerobot_bimanual.codec_torch import KeyposeBins
from lerobot_policy_bimanual import RVTLFConfig
from lerobot_policy_bimanual.keypose.observation import Observation
from lerobot_policy_bimanual.rvt_lf.heatmaps import HeatmapTranslation, ProductTranslation, best_voxel
from lerobot_policy_bimanual.rvt_lf.network import RVTNetwork
from lerobot_policy_bimanual.rvt_lf.scene import Scene
from lerobot_policy_bimanual.rvt_lf.two_stages import JITTER, FineTranslation, StagedRVT, cubic_weights
from lerobot_policy_bimanual.rvt_lf.views import pixels_of_voxels

HEADS = 2


def tiny_config(**options: Any) -> RVTLFConfig:
    grid = {"voxel_size": 9, "patch": 3, "channels": 4, "token_dim": 16, "attention_dim": 12, "depth": 4}
    rest = {"heads": HEADS, "feedforward_multiplier": 2, "attention_dropout": 0.0, "language_dim": 6}
    return RVTLFConfig(device="cpu", **grid | rest | options)


def tiny_network(**options: Any) -> RVTNetwork:
    network = RVTNetwork(tiny_config(**options), proprio_dim=4).double()
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.2)  # biases and norms too, so that none is invisible
    return network


def make_inputs() -> tuple[torch.Tensor, ...]:
    sizes = ((5, 10, 9, 9), (4,), (3, 6))
    return tuple(torch.randn(2, *size, dtype=torch.float64) for size in sizes)


def conv(x, weight, bias):
    return F.conv2d(F.pad(x, (weight.shape[-1] // 2,) * 4, mode="replicate"), weight, bias)


def upsampled_conv(x, weight, bias):
    fine = F.interpolate(x, scale_factor=weight.shape[-1], mode="bilinear", align_corners=False)
    return conv(fine, weight, bias)


def written_out(p, views, proprio, language, *, dilations):
    """Logits (b, 5, 9, 9) and pose (b, outputs), one view after the other, with nothing split or shared.

    With dilations, squared positions and colours are further channels.
    """

    def linear(name, x):
        return F.linear(x, p[f"{name}.weight"], p[f"{name}.bias"])

    def norm(name, x):
        return F.group_norm(x, 4, p[f"{name}.norm.weight"], p[f"{name}.norm.bias"])

    body = leaky(norm("proprio", linear("proprio.linear", proprio)))
    words = [leaky(norm("language", linear("language.linear", word))) for word in language.unbind(1)]
    stems, images = [], []
    for number, view in enumerate(views.unbind(1)):
        view = torch.cat([view, view[:, :6] ** 2], dim=1) if dilations else view
        stem = leaky(conv(view, p["stem.weight"], p["stem.bias"]))
        patches = F.conv2d(stem, p["patchify.conv.weight"], p["patchify.conv.bias"], stride=3)
        patches = leaky(norm("patchify", patches))  # (b, 4, 3, 3)
        joined = torch.cat([patches, body[:, :, None, None].expand_as(patches)], dim=1).flatten(2)
        tokens = joined.transpose(1, 2) + p["positions"][9 * number : 9 * number + 9]
        tokens = linear("widen", tokens)
        for layer in range(2):
            tokens = block(p, f"within_views.{layer}", tokens, HEADS)
        stems.append(stem)
        images.append(tokens)
    tokens = torch.cat([linear("widen", torch.stack(words, dim=1)), *images], dim=1)
    for layer in range(2):
        tokens = block(p, f"over_views.{layer}", tokens, HEADS)
    logits, features = [], []
    for answers, stem in zip(linear("narrow", tokens[:, 3:]).split(9, dim=1), stems, strict=True):
        answers = answers.transpose(1, 2).unflatten(2, (3, 3))
        coarse = leaky(conv(answers, p["coarse.weight"], p["coarse.bias"]))
        up = leaky(upsampled_conv(coarse, p["upsample.conv.weight"], p["upsample.conv.bias"]))
        fine = leaky(conv(torch.cat([up, stem], dim=1), p["join.conv.weight"], p["join.conv.bias"]))
        for layer, dilation in enumerate(dilations):
            surrounded = F.pad(leaky(fine), (dilation,) * 4)
            weight, bias = p[f"reach.{layer}.weight"], p[f"reach.{layer}.bias"]
            fine = fine + F.conv2d(surrounded, weight, bias, dilation=dilation)
        heatmap = conv(fine, p["heatmap.weight"], p["heatmap.bias"])[:, 0]
        weight = heatmap.detach().flatten(1).softmax(1).view_as(heatmap)
        logits.append(heatmap)
        features += [answers.flatten(2).amax(2), (fine * weight[:, None]).sum((2, 3))]
    hidden = linear("pose_head.0", torch.cat(features, dim=1)).relu()
    return torch.stack(logits, dim=1), linear("pose_head.4", linear("pose_head.2", hidden).relu())


def pose_logits(prediction):
    parts = (prediction.rotation.flatten(2), prediction.gripper_open, prediction.ignore_collisions)
    return torch.cat(parts, dim=-1)


def random_logits(arms: int = 2, size: int = 12) -> torch.Tensor:
    return 3 * torch.randn(2, arms, 5, size, size, dtype=torch.float64, requires_grad=True)


@pytest.mark.parametrize("dilations", [(), (1, 3)])
def test_network_and_its_gradients_equal_the_written_out_formulation(dilations):
    network = tiny_network(heatmap_dilations=dilations, quadratic_features=bool(dilations))
    inputs = make_inputs()
    parameters = dict(network.named_parameters())
    expected = written_out(parameters, *inputs, dilations=dilations)
    prediction = network(*inputs)
    actual = (prediction.translation.logits[:, 0], pose_logits(prediction)[:, 0])
    torch.testing.assert_close(actual, expected, atol=1e-6, rtol=1e-6)
    probes = [torch.randn_like(each) for each in expected]
    got, want = (
        dict(zip(parameters, torch.autograd.grad(outputs, list(parameters.values()), probes), strict=True))
        for outputs in (actual, expected)
    )
    assert not [name for name, gradient in want.items() if not gradient.any()]
    # The interpolation weights are kept in float32.
    torch.testing.assert_close(got, want, atol=1e-5, rtol=1e-5)


def test_loss_equals_the_divergence_from_a_target_image_with_gradients():
    logits = random_logits()
    voxel = torch.tensor([[[5, 6, 4], [0, 11, 2]], [[11, 11, 11], [3, 0, 7]]])  # in the middle and at borders
    offset = torch.rand(2, 2, 3, dtype=torch.float64) - 0.5
    rows, columns = (pixel[..., None, None] for pixel in pixels_of_voxels(voxel + offset, 12))
    axis = torch.arange(12)
    squared = (axis[:, None] - rows) ** 2 + (axis - columns) ** 2  # (2, 2, 5, 12, 12)
    target = torch.exp(-squared / (2 * 1.5**2)) * (squared <= (3 * 1.5) ** 2)
    target /= target.sum((3, 4), keepdim=True)
    expected = (target.xlogy(target) - target * logits.flatten(3).log_softmax(3).view_as(logits)).sum((3, 4))
    expected, actual = expected.mean(2), HeatmapTranslation(logits, 1.5).cross_entropy(voxel, offset)
    torch.testing.assert_close(actual, expected)
    torch.testing.assert_close(*(torch.autograd.grad(each.sum(), logits)[0] for each in (actual, expected)))


@pytest.mark.parametrize(("sigma_px", "offset"), [(1.5, 5.0), (0.01, 0.3)])
def test_a_target_whose_gaussian_reaches_no_pixel_is_learned_from_the_nearest_pixel(sigma_px, offset):
    logits, voxel = random_logits(size=6), torch.full((2, 2, 3), 5)
    actual = HeatmapTranslation(logits, sigma_px).cross_entropy(voxel, torch.full((2, 2, 3), offset))
    rows, columns = pixels_of_voxels(torch.tensor([5, 5, 5]), 6)
    log_share = logits.flatten(3).log_softmax(3).view_as(logits)
    torch.testing.assert_close(actual, -log_share[:, :, torch.arange(5), rows, columns].mean(2))


@pytest.mark.parametrize("levels", [2, 1000])
@pytest.mark.parametrize("chunk", [1, 200, 2**18])
def test_best_voxel_is_the_first_maximum_of_the_whole_lattice(monkeypatch, levels, chunk):
    monkeypatch.setattr("lerobot_policy_bimanual.rvt_lf.heatmaps.CHUNK_VOXELS", chunk)
    xy, xz, yz = torch.randint(0, levels, (3, 4, 9, 9)) / 10  # few levels: many voxels are equally good
    scores = xy[:, :, :, None] + (xz[:, :, None, :] + yz[:, None, :, :])
    first = scores.flatten(1).argmax(1)
    expected = torch.stack([first // 81, first // 9 % 9, first % 9], dim=1)
    assert torch.equal(best_voxel(xy, xz, yz), expected)


@pytest.mark.parametrize(
    ("translation", "fuse"), [(HeatmapTranslation, torch.mean), (ProductTranslation.of_views, torch.prod)]
)
def test_candidates_are_the_best_voxel_and_its_neighbours_with_their_probability(translation, fuse):
    logits = random_logits(arms=1, size=7).detach()
    prediction = translation(logits, 1.5)
    candidates, probabilities = prediction.candidates(), prediction.probabilities()[:, 0]
    images = logits[:, 0].flatten(2).softmax(2).view(2, 5, 7, 7)
    rows, columns = pixels_of_voxels(torch.cartesian_prod(*[torch.arange(7)] * 3), 7)
    fused = fuse(images[:, torch.arange(5), rows, columns], dim=2).view(2, 7, 7, 7)
    for sample, scores in enumerate(fused):
        torch.testing.assert_close(probabilities[sample], scores / scores.sum())
        assert scores[tuple(candidates.best()[sample, 0])] == scores.max()
        for voxel, score in zip(candidates.voxel[sample, 0], candidates.score[sample, 0], strict=True):
            if ((voxel >= 0) & (voxel < 7)).all():
                likelier = (score - candidates.score[sample, 0].max()).exp()
                torch.testing.assert_close(likelier, scores[tuple(voxel)] / scores.max())
            else:
                assert torch.isneginf(score)


def test_loss_of_a_product_equals_the_divergence_from_a_gaussian_over_all_voxels_with_gradients():
    logits = random_logits(size=6)
    prediction = ProductTranslation.of_views(logits, 1.5)
    voxel, offset = torch.randint(0, 6, (2, 2, 3)), torch.rand(2, 2, 3, dtype=torch.float64) - 0.5
    voxels = torch.cartesian_prod(*[torch.arange(6.0, dtype=torch.float64)] * 3)  # (216, 3)
    squared = ((voxels - (voxel + offset)[:, :, None]) ** 2).sum(3)
    target = (-squared / (2 * 1.5**2)).softmax(2)
    expected = (target * (target.log() - prediction.probabilities().flatten(2).log())).sum(2)
    actual = prediction.cross_entropy(voxel, offset)
    torch.testing.assert_close(actual, expected)
    torch.testing.assert_close(*(torch.autograd.grad(each.sum(), logits)[0] for each in (actual, expected)))


def test_a_pixel_of_a_product_is_as_probable_as_the_voxels_that_it_shows():
    logits = random_logits(size=6).detach()
    prediction, images = ProductTranslation.of_views(logits, 1.5), torch.zeros_like(logits)
    for voxel in itertools.product(range(6), repeat=3):
        rows, columns = pixels_of_voxels(torch.tensor(voxel), 6)
        images[:, :, torch.arange(5), rows, columns] += prediction.probabilities()[:, :, *voxel, None]
    torch.testing.assert_close(prediction.pixel_probabilities(), images)


def test_language_filters_are_added_to_the_weights_and_biases_of_the_stem():
    network, (views, _, language) = tiny_network(language_filters=True), make_inputs()
    words = network.language_filters(language.mean(dim=1)).unflatten(1, (-1, views.shape[2] + 1))
    weight = network.stem.weight.flatten(1) + words[..., :-1]
    bias = network.stem.bias + words[..., -1]
    pixels = torch.einsum("boi,bvihw->bvohw", weight, views) + bias[:, None, :, None, None]
    torch.testing.assert_close(network.read(views, language), leaky(pixels).flatten(0, 1))


def zoomed_scene() -> Scene:
    config = tiny_config(point_radius=0.01, fine_stage_zoom=3, heatmap_fusion="product")
    points = torch.rand(2, 3, 500) + torch.tensor(config.workspace.lower)[:, None]
    return Scene.of(Observation(points, torch.rand(2, 3, 500), torch.zeros(2, 8), ["", ""]), config)


def test_zoomed_in_views_show_points_and_the_goal_where_they_lie_around_the_middle():
    scene, middle = zoomed_scene(), torch.tensor([[4.3, 3.1, 5.0], [2.1, 6.6, 4.0]])
    goal = torch.tensor([[5, 3, 4], [2, 6, 3]])
    views = scene.with_goal(goal).zoomed_in(middle)
    lower = torch.tensor(scene.config.workspace.lower)
    for sample in range(2):
        points = (scene.cloud.points[sample].T - lower) * 9 - 0.5  # in voxels, the centre of the first at 0
        near = ((points - middle[sample]) * 3 + 4.5).floor().long()
        expected = torch.zeros(5, 9, 9, dtype=torch.bool)
        for voxel in near[((near >= 0) & (near < 9)).all(1)]:
            expected[torch.arange(5), *pixels_of_voxels(voxel, 9)] = True
        assert torch.equal(views[sample, :, :6].any(1), expected)
        rows, columns = pixels_of_voxels(((goal[sample] - middle[sample]) * 3 + 4).round().long(), 9)
        assert torch.equal(views[sample, :, 10].flatten(1).argmax(1), rows * 9 + columns)


def test_the_fine_stage_zooms_in_on_the_coarse_prediction_and_in_training_near_the_label():
    scene = zoomed_scene()
    network = StagedRVT(scene.config, proprio_dim=4)
    rest = torch.randn(2, 4), torch.randn(2, 3, 6)
    voxel, flag = torch.tensor([[[3, 4, 5]], [[8, 0, 4]]]), torch.zeros(2, 1, dtype=torch.long)
    target = KeyposeBins(voxel, torch.zeros_like(voxel), flag, flag, voxel.float())
    network.train()
    middles = torch.stack([network(scene, *rest, target).translation.middle for _ in range(50)])
    distance = (middles[:, 0] - voxel[0]).abs().amax(0)
    assert (distance < JITTER * 4.5 / 3).all()
    assert (distance > 0.8 * JITTER * 4.5 / 3).all()
    assert middles.amin() == 1  # fine views end at the workspace's border, at -0.5 and 8.5
    assert middles.amax() == 7

    prediction = network.eval()(scene, *rest, target)
    coarse = network.coarse(scene.whole, *rest)
    middle = coarse.translation.candidates().local_mean().clamp(1, 7)
    assert network.fine is not None
    fine = network.fine(scene.zoomed_in(middle[:, 0]), *rest)
    staged = FineTranslation.of(coarse.translation, fine.translation, middle, 3)
    place = staged.candidates().local_mean()
    torch.testing.assert_close(prediction.translation.candidates().local_mean(), place)
    assert ((place - middle).abs() <= 4 / 3).all()
    torch.testing.assert_close(pose_logits(prediction), pose_logits(coarse) + pose_logits(fine))


def gaussian(place: torch.Tensor, size: int = 12) -> ProductTranslation:
    """The Gaussian with the deviation 1 around a place (3,) in voxels."""
    x, y, z = -((torch.arange(size) - place[:, None]) ** 2) / 2
    planes = (x[:, None] + y, z.expand(size, size), torch.zeros(size, size).to(z))
    return ProductTranslation(tuple(plane[None, None] for plane in planes), 1)


def test_where_the_fine_stage_sees_nothing_the_coarse_one_decides_between_its_voxels():
    place = torch.tensor([3.7, 8.2, 6.4], dtype=torch.float64)
    blind = ProductTranslation((torch.zeros(1, 1, 12, 12).double(),) * 3, 1)
    middle = torch.tensor([[[4.1, 8.0, 6.6]]], dtype=torch.float64)
    found = FineTranslation.of(gaussian(place), blind, middle, 4).candidates().local_mean()
    torch.testing.assert_close(found[0, 0], place, atol=0.5 / 4, rtol=0)


def test_cubic_weights_find_a_parabola_between_samples_and_never_leave_them():
    place, axis = torch.tensor([1.0, 3.3, 4.9, 7.0]), torch.arange(9.0)
    torch.testing.assert_close(cubic_weights(place, 9) @ (axis - 4) ** 2, (place - 4) ** 2)
    weights = cubic_weights(torch.linspace(-1, 9, 50), 9)
    torch.testing.assert_close(weights.sum(1), torch.ones(50))
    assert torch.equal(weights[[0, -1]].argmax(1), torch.tensor([0, 8]))


def test_both_stages_learn_the_same_position():
    middle, zoom = torch.tensor([[[3.25, 4.5, 5.0]]], dtype=torch.float64), 4
    place = torch.tensor([3.6, 4.1, 5.3], dtype=torch.float64)
    fine = gaussian((place - middle[0, 0]) * zoom + 5.5)
    translation = FineTranslation(gaussian(place), fine, middle, zoom)
    voxel = place.round().long()[None, None]
    torch.testing.assert_close(translation.cross_entropy(voxel, place - voxel), torch.zeros(1, 1).double())
    torch.testing.assert_close(translation.candidates().local_mean()[0, 0], place, atol=0.5 / zoom, rtol=0)
    elsewhere = translation.cross_entropy(torch.tensor([[[0, 11, 0]]]), torch.zeros(1, 1, 3))
    assert elsewhere.isfinite().all()
    assert elsewhere > 10
