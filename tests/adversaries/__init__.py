"""How one arm alone would try tasks, one module per task; `python -m adversaries` plays them (run it in `tests/`).

`results.json` holds what the adversaries of all thirteen tasks solved. Kept are the scripts of the three tasks that one arm
can do; those of the ten others, which solved nothing, are in the repository's history.
"""
