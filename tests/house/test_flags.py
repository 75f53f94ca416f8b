"""Flags of a dataclass: values arrive as they were typed, and every mistake names what would be valid."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest

from lerobot_bimanual.cli.flag_help import describe_flags, field_comments
from lerobot_bimanual.cli.flags import BadCommandLine, parse_flags


@dataclass
class Planner:
    speed: float = 1.3  # rad/s


@dataclass
class Base:
    seeds: str = "0:10"  # half-open range


@dataclass
class Config(Base):
    view: Literal["frames", "keyframes"] = "frames"  # 100 % of the frames, or some
    # Several lines above
    # count as one text.
    output: Path | None = None
    cameras: tuple[str, ...] = ("front",)
    """A string below."""
    fractions: tuple[float, ...] = ()
    workers: int = 1
    force: bool = False
    planner: Planner = field(default_factory=Planner)


@pytest.mark.parametrize("seeds", ["1:20", "010", "1e3", "true", "null", "2024-01-01", "a, b: c", '"'])
def test_texts_arrive_as_they_were_typed(seeds: str) -> None:
    assert parse_flags(Config, [f"--seeds={seeds}"]).seeds == seeds
    assert parse_flags(Config, ["--seeds", seeds]).seeds == seeds


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], Config()),
        (["--view=keyframes"], Config(view="keyframes")),
        (["--output=7"], Config(output=Path("7"))),
        (["--output=null"], Config(output=None)),
        (["--cameras=front, left_wrist"], Config(cameras=("front", "left_wrist"))),
        (["--cameras=[front]"], Config(cameras=("front",))),
        (["--cameras="], Config(cameras=())),
        (["--fractions=0.35, 1"], Config(fractions=(0.35, 1.0))),
        (["--workers", "-3"], Config(workers=-3)),
        (["--force"], Config(force=True)),
        (["--force", "--workers=2"], Config(force=True, workers=2)),
        (["--force", "false"], Config(force=False)),
        (["--planner.speed=2"], Config(planner=Planner(speed=2.0))),
    ],
)
def test_flags_fill_the_dataclass(words: list[str], expected: Config) -> None:
    assert parse_flags(Config, words) == expected


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--seed=1"], "unknown flag --seed. Did you mean '--seeds'? Valid flags: --seeds, --view,"),
        (["frames"], "'frames' is no flag"),
        (["--workers"], "flag --workers needs a value"),
        (["--view=keyframe"], "one of: frames, keyframes. Did you mean 'keyframes'?"),
        (["--workers=two"], "--workers is 'two', but must be an integer"),
        (["--view=film"], "--view is 'film', but must be one of: frames, keyframes"),
        (["--config_path=absent.yaml"], "absent.yaml"),
        (["--config_path=1"], "--config_path '1' cannot be read"),
        (["--config_path=/"], "--config_path '/' cannot be read"),
        (["--workers=[1"], "--workers is '[1', but must be an integer"),
        (["--no\nflag=1"], "unknown flag '--no\\nflag'"),
        (["--workers="], "--workers is '', but must be an integer"),
        (["--workers=null"], "--workers is 'null', but must be an integer"),
        (["--force", ""], "--force is empty or null, but must be true|false"),
        (["--planner.speed=~"], "--planner.speed is '~', but must be a number"),
        (["--fractions=1,null"], "--fractions has an item that is empty or null"),
    ],
)
def test_mistakes_name_what_is_wrong_and_what_is_valid(words: list[str], message: str) -> None:
    with pytest.raises(BadCommandLine) as error:
        parse_flags(Config, words)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_a_field_without_default_is_a_required_flag() -> None:
    @dataclass
    class Needy:
        output: Path  # where to

    with pytest.raises(BadCommandLine, match=r"missing: --output=path\. `--help` explains every flag"):
        parse_flags(Needy, [])
    assert parse_flags(Needy, ["--output=here"]).output == Path("here")


def test_flags_override_values_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text("workers: 4\nview: keyframes\n")
    config = parse_flags(Config, [f"--config_path={path}", "--workers=2"])
    assert (config.workers, config.view) == (2, "keyframes")


def test_what_a_file_leaves_empty_is_refused_unless_it_may_be_absent(tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text("output:\n")
    assert parse_flags(Config, [f"--config_path={path}"]).output is None
    for content, name in (("workers:\n", "workers"), ("planner:\n  speed: null\n", r"planner\.speed")):
        path.write_text(content)
        with pytest.raises(BadCommandLine, match=f"--{name} is empty or null"):
            parse_flags(Config, [f"--config_path={path}"])


def test_help_texts_come_from_comments_beside_above_and_strings_below() -> None:
    assert field_comments(Config) == {
        "seeds": "half-open range",
        "view": "100 % of the frames, or some",
        "output": "Several lines above count as one text.",
        "cameras": "A string below.",
    }


@pytest.mark.parametrize("text", ["include", "include here", "includes/folder"])
def test_a_text_is_never_taken_for_a_file_to_read(text: str) -> None:
    config = parse_flags(Config, [f"--seeds={text}", f"--output={text}"])
    assert (config.seeds, config.output) == (text, Path(text))


def test_what_a_file_says_must_be_lines_of_names_and_values(tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    for content in ("- 1", "text", "", "a: [", "\x00"):
        path.write_text(content)
        with pytest.raises(BadCommandLine, match="config_path"):
            parse_flags(Config, [f"--config_path={path}"])


def test_help_says_a_default_once() -> None:
    @dataclass
    class Relative:
        demos: int | None = None  # by default 100
        axes: tuple[str, ...] = ()  # of the ladder; by default all
        taught_on: str = ""  # Other tasks. By default none but this one.
        output: Path | None = None  # where to

    text = describe_flags(Relative)
    assert "by default 100\n" in text
    assert "by default all\n" in text
    assert "By default none but this one.\n" in text
    assert "where to (default: none)" in text


def test_help_shows_kinds_of_values_and_defaults() -> None:
    text = describe_flags(Config)
    assert "--seeds=text              half-open range (default: 0:10)" in text
    assert "--view=frames|keyframes   100 % of the frames, or some (default: frames)" in text
    assert "--cameras=a,b,...         A string below. (default: front)" in text
    assert "--force=true|false        (default: false)" in text
    assert "--planner.speed=float     rad/s (default: 1.3)" in text
