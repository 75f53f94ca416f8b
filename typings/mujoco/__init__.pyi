# MuJoCo ships no type stubs for its compiled modules; without this every name of it is an error.
from typing import Any

def __getattr__(name: str) -> Any: ...
