"""Whatever an observation holds: the policy answers with a finite keypose, or one line says what is wrong."""

from typing import Any

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from lerobot.configs import PreTrainedConfig
from lerobot.policies.factory import get_policy_class

from lerobot_bimanual.dataset.schema import NEXT_KEYPOSE
from lerobot_policy_bimanual.errors import BadObservation

pytestmark = pytest.mark.fuzz

SCALES = [0.0, -1.0, 1e-30, 1e-3, 0.5, 3.0, 255.0, 1e5, 1e30, float("nan"), float("inf"), -float("inf")]
DTYPES = [
    *(torch.uint8, torch.uint16, torch.int8, torch.int16, torch.int64, torch.bool),
    *(torch.float16, torch.bfloat16, torch.float64, torch.complex64, torch.float8_e4m3fn),
]
OTHERS = [None, 1.0, "front", b"", [], {}, [0.5], ["", ""], ["lift", 5], ("push it", "push it"), ["push it"]]


@st.composite
def changed(draw: st.DrawFn, value: Any) -> Any:
    """Another value in a batch's place."""
    if not isinstance(value, torch.Tensor) or draw(st.integers(0, 5)) == 0:
        return draw(st.sampled_from(OTHERS))
    kind = draw(st.sampled_from(["scale", "add", "one", "cast", "slice", "axes"]))
    if kind == "scale":
        return value * draw(st.sampled_from(SCALES))
    if kind == "add":
        return value + draw(st.sampled_from(SCALES))
    if kind == "one":
        value = value.clone()
        value.view(-1)[draw(st.integers(0, value.numel() - 1))] = draw(st.sampled_from(SCALES))
        return value
    if kind == "cast":
        return value.to(draw(st.sampled_from(DTYPES)))
    if kind == "slice":
        axis = draw(st.integers(0, value.ndim - 1))
        return value.narrow(axis, 0, draw(st.integers(0, value.shape[axis])))
    return draw(
        st.sampled_from([value.flatten(1), value[None], value[..., None], value.mT, value.sum(), value[0]])
    )


@pytest.fixture
def policy(policy_type, specimens):
    options = next(iter(specimens[policy_type].tiny.values()))
    return get_policy_class(policy_type)(PreTrainedConfig.get_choice_class(policy_type)(**options))


@given(data=st.data())
def test_any_observation_is_answered_with_a_finite_keypose_or_one_line(data, policy, make_batch):
    batch = make_batch(samples=2, size=8)
    for key in data.draw(st.lists(st.sampled_from(sorted(batch)), min_size=1, max_size=3, unique=True)):
        if key == NEXT_KEYPOSE or data.draw(st.integers(0, 9)) > 0:
            batch[key] = data.draw(changed(batch[key]))
        else:
            del batch[key]
    try:
        action = policy.select_action(batch)
    except BadObservation as error:
        said = str(error)
        action = None
    if action is None:
        assert said
        assert len(said) < 5000
        assert "\n" not in said
    else:
        assert action.shape == (2, 18)
        assert torch.isfinite(action).all()
