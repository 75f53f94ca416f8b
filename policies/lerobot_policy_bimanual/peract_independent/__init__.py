"""Independent PerAct: one network per arm."""
