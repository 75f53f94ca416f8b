import pytest
import torch

from lerobot_policy_bimanual.peract.projections import ProjectionConv2d, project


def test_projections_are_the_maxima_along_each_axis():
    features = torch.randn(2, 3, 4, 4, 4)
    for axis, plane in enumerate(project(features)):
        torch.testing.assert_close(
            plane, features.movedim(2 + axis, -1).flatten(0, -2).amax(-1).view(2, 3, 4, 4)
        )


def test_gradients_of_projections_go_to_the_maxima_of_each_axis():
    features = torch.randn(2, 3, 4, 4, 4, requires_grad=True)
    weights = [torch.randn(2, 3, 4, 4) for _ in range(3)]
    torch.autograd.backward(project(features), weights)
    ours = features.grad
    features.grad = None
    torch.autograd.backward([features.max(dim=axis).values for axis in (2, 3, 4)], weights)
    torch.testing.assert_close(ours, features.grad)


@pytest.mark.parametrize(("dilations", "reach"), [((), 1), ((3,), 4), ((3, 9), 13)])
def test_a_place_sees_as_far_as_its_dilations_add_up_to_and_every_place_between(dilations, reach):
    layer = ProjectionConv2d(1, 8, dilations).double()
    plane = torch.randn(1, 1, 31, 31, dtype=torch.float64, requires_grad=True)
    layer(plane)[0, :, 15, 15].sum().backward()
    away = (torch.arange(31) - 15).abs()
    seen = torch.maximum(away[:, None], away[None]) <= reach
    assert (plane.grad[0, 0] != 0).equal(seen)
