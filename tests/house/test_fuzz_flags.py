"""Arbitrary words after a command give a config or one line with exit code 2; no file is read that was not named."""

import dataclasses

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from mutations import check_clear

from lerobot_bimanual import cli
from lerobot_bimanual.cli.flags import CONFIG_FLAG, BadCommandLine, flags_of, parse_flags

pytestmark = pytest.mark.fuzz

CONFIGS = {name: cli.config_type_of(entry.load()) for name, entry in cli.find_commands().items()}
ODD = [
    "", "null", "~", "[", "[1", "[1,2]", "{a: 1}", '"', "1e400", ".nan", "-5", "9" * 5000, "1_000", "0x10", "true",
    "!!python/object/apply:os.system [true]", "*a", "a: b: c", "\x00", "\udc80", "a\nb", "%", "--", "=", "2024-01-01",
    "include /dev/zero", "[" * 3000, "!!binary x", "|", "\t", "/",
]  # fmt: skip


@pytest.mark.parametrize("command", CONFIGS)
@given(data=st.data())
def test_odd_values_give_a_config_or_one_line(command, data):
    config_type, values = CONFIGS[command], st.sampled_from(ODD) | st.text(max_size=20)
    flags = list(flags_of(config_type))
    words = [f"--{flag.name}=x" for flag in flags if flag.default is dataclasses.MISSING]
    names = st.sampled_from([*(flag.name for flag in flags), CONFIG_FLAG, "", "nested.name"])
    for _ in range(data.draw(st.integers(1, 3))):
        name, value = data.draw(names), data.draw(values)
        forms = [[f"--{name}={value}"], [f"--{name}", value], [value], [f"-{name}"]]
        words += data.draw(st.sampled_from(forms))
    try:
        assert isinstance(parse_flags(config_type, words), config_type)
    except BadCommandLine as error:
        check_clear(error)


@given(word=st.sampled_from([*ODD, "--version"]) | st.text(max_size=10))
def test_odd_commands_are_answered_with_a_code(word):
    assume(word not in {name.split()[0] for name in CONFIGS})
    assert cli.main([word]) == (0 if word in ("--version", "-h", "--help", "help") else 2)
