"""Flags of a dataclass: values arrive as they were typed, and every mistake names what would be valid."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest

from lerobot_bimanual.cli.flag_help import describe_flags, field_comments
from lerobot_bimanual.cli.flags import BadCommandLine, parse_flags


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
    fractions: tuple[float, ...] = ()  # by default all
    workers: int = 1
    size: int | str = 256  # side in pixels, or HEIGHTxWIDTH
    force: bool = False


@dataclass
class Needy:
    output: Path = field(kw_only=True)  # where to


TEXTS = ["1:20", "010", "1e3", "true", "null", "2024-01-01", "a, b: c", '"', "include", "include /dev/zero"]


@pytest.mark.parametrize("text", TEXTS)
def test_texts_arrive_as_they_were_typed(text: str) -> None:
    assert parse_flags(Config, [f"--seeds={text}"]).seeds == text
    assert parse_flags(Config, ["--seeds", text]).seeds == text


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
        (["--size=64"], Config(size=64)),
        (["--size=480x640"], Config(size="480x640")),
        (["--force"], Config(force=True)),
        (["--force", "--workers=2"], Config(force=True, workers=2)),
        (["--force", "false"], Config(force=False)),
    ],
)
def test_flags_fill_the_dataclass(words: list[str], expected: Config) -> None:
    assert parse_flags(Config, words) == expected


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--seed=1"], "unknown flag --seed. Did you mean '--seeds'? Valid flags: --seeds, --view,"),
        (["frames"], "'frames' is not a flag"),
        (["--workers"], "flag --workers needs a value"),
        (["--workers=two"], "--workers is 'two', but must be an integer"),
        (["--workers="], "--workers is '', but must be an integer"),
        (["--workers=null"], "--workers is 'null', but must be an integer"),
        (["--fractions=1,null"], "--fractions is ['1', 'null'], but must be a number"),
        (["--force", ""], "--force is '', but must be true or false"),
        (["--view=keyframe"], "--view is 'keyframe', but must be one of: frames, keyframes. Did you mean"),
        (["--no\nflag=1"], "unknown flag '--no\\nflag'"),
        (["--config_path=absent.yaml"], "--config_path: 'absent.yaml' cannot be read: No such file"),
        (["--config_path=/"], "--config_path: '/' cannot be read: Is a directory"),
    ],
)
def test_mistakes_name_what_is_wrong_and_what_is_valid(words: list[str], message: str) -> None:
    with pytest.raises(BadCommandLine) as error:
        parse_flags(Config, words)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_a_field_without_default_is_a_required_flag() -> None:
    with pytest.raises(BadCommandLine, match=r"missing: --output=path\. `--help` explains every flag"):
        parse_flags(Needy, [])
    assert parse_flags(Needy, ["--output=here"]).output == Path("here")


def test_flags_override_values_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text("workers: 4\nview: keyframes\nseeds: 10:30\noutput:\ncameras: [front, top]\n")
    config = parse_flags(Config, [f"--config_path={path}", "--workers=2"])
    assert config == Config("10:30", "keyframes", None, ("front", "top"), workers=2)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("workers:\n", "--workers is '', but must be an integer"),
        ("worker: 3\n", "unknown flag --worker. Did you mean '--workers'?"),
        ("workers: [1]\n", "--workers is ['1'], but must be a single value"),
        *((content, "config_path") for content in ("- 1", "text", "", "a: [", "\x00")),
    ],
)
def test_mistakes_in_a_file_are_named_too(content: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(content)
    with pytest.raises(BadCommandLine) as error:
        parse_flags(Config, [f"--config_path={path}"])
    assert message in str(error.value)


def test_help_comes_from_comments_beside_and_above_the_fields() -> None:
    assert field_comments(Config) == {
        "seeds": "half-open range",
        "view": "100 % of the frames, or some",
        "output": "Several lines above count as one text.",
        "fractions": "by default all",
        "size": "side in pixels, or HEIGHTxWIDTH",
    }
    text = describe_flags(Config)
    for line in (
        "--seeds=text              half-open range (default: 0:10)",
        "--view=frames|keyframes   100 % of the frames, or some (default: frames)",
        "--cameras=a,b,...         (default: front)",
        "--fractions=a,b,...       by default all",
        "--force=true|false        (default: false)",
    ):
        assert f"{line}\n" in text
    assert "--output=path             where to (required)" in describe_flags(Needy)
