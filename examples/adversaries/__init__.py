"""How one arm alone would try tasks, a module of ways each; `python -m adversaries` plays them (run it in `examples/`)."""
