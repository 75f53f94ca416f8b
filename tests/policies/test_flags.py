"""LeRobot's command lines explain every flag of our policies, and LeRobot's tools find what they ask a policy for."""

import re
from dataclasses import fields

from draccus.wrappers.docstring import get_attribute_docstring, get_preferred_help_text
from lerobot.configs import PreTrainedConfig


def test_every_flag_of_a_policy_has_a_help_text(policy_type):
    config_class = PreTrainedConfig.get_choice_class(policy_type)
    lerobots = {field.name for field in fields(PreTrainedConfig)}
    for field in fields(config_class):
        if field.name not in lerobots:
            text = get_preferred_help_text(get_attribute_docstring(config_class, field.name))
            assert text, field.name
            assert not re.search(r"""^#|field\(|def |class |"{3}""", text), (field.name, text)
