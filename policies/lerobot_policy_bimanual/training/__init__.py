"""LeRobot's training on a dataset that is held in memory."""
