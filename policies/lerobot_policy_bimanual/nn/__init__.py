"""Network parts that the keypose policies share. Plain modules: they know tensors, not LeRobot keys."""
