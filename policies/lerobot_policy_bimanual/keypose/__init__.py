"""What all keypose policies share: their config, their observation, their losses, and LeRobot's contract."""
