import pytest
import torch

from lerobot_policy_bimanual.peract.factorised_head import ProjectionConv2d


@pytest.mark.parametrize(("dilations", "reach"), [((), 1), ((3,), 4), ((3, 9), 13)])
def test_a_place_sees_as_far_as_its_dilations_add_up_to_and_every_place_between(dilations, reach):
    layer = ProjectionConv2d(1, 8, dilations).double()
    plane = torch.randn(1, 1, 31, 31, dtype=torch.float64, requires_grad=True)
    layer(plane)[0, :, 15, 15].sum().backward()
    away = (torch.arange(31) - 15).abs()
    seen = torch.maximum(away[:, None], away[None]) <= reach
    assert (plane.grad[0, 0] != 0).equal(seen)
