"""PerAct2: one network for both arms."""
