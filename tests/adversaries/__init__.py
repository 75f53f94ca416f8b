"""How one arm alone would try each task, one module per task; `python -m adversaries` plays them (run it in `tests/`)."""
