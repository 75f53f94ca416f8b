"""How one arm alone would try tasks; `python -m adversaries` plays them (run it in `tests/`).

Three tasks can be done with one arm: `single_arm` plays them by keyposes, and `results.json` holds what it solved. The other
ten have conditions of which no way with one arm is known; `joint` tries them by joint actions, as fast as the arm allows.
"""
