"""The package's own names, which come from its modules when they are asked for."""

import json
import subprocess
import sys

import pytest

import lerobot_bimanual


def test_every_public_name_is_there_and_none_besides():
    for name in lerobot_bimanual.__all__:
        assert getattr(lerobot_bimanual, name) is not None
    with pytest.raises(AttributeError, match="Keypoze"):
        _ = lerobot_bimanual.Keypoze


def test_neither_the_package_nor_its_list_of_verbs_loads_numpy():
    program = (
        "import json, sys, lerobot_bimanual, lerobot_bimanual.cli as cli; cli.main(['--help']);"
        "print(json.dumps(sorted({'numpy', 'torch', 'lerobot', 'gymnasium', 'rich'} & set(sys.modules))))"
    )
    child = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert json.loads(child.stdout.splitlines()[-1]) == []
