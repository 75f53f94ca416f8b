"""Vocabulary shared by the bimanual environment and the keypose policies.

Importing this package loads nothing, so that the command line answers before NumPy is loaded. Torch twins live in modules
ending in `_torch`.
"""

__version__ = "0.1.0"
