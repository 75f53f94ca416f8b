"""How one arm alone would try each task, one module per task; a task without one is tried by nobody."""
