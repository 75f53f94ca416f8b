import pytest

from lerobot_bimanual.errors import InvalidChoice
from lerobot_bimanual.perturbation_levels import levels_text, parse_levels


@pytest.mark.parametrize(
    ("text", "levels"),
    [
        ("", {}),
        ("mass:2", {"mass": 2}),
        (" mass:2 , camera_moved:1,", {"camera_moved": 1, "mass": 2}),
        ("mass:0", {}),
        ("mass:0,light:3", {"light": 3}),
    ],
)
def test_a_text_says_the_level_of_each_axis_and_leaves_out_level_0(text, levels):
    assert parse_levels(text) == levels
    assert list(parse_levels(text)) == sorted(levels)
    assert parse_levels(levels_text(levels)) == levels


@pytest.mark.parametrize("text", ["mass", "mass:4", "mass:-1", "mass:two", ":1", "mass:1,mass:2", "a b:1", 3])
def test_what_is_no_such_text_is_refused_with_the_form(text):
    with pytest.raises(InvalidChoice, match="AXIS:LEVEL with levels 0 to 3"):
        parse_levels(text)
