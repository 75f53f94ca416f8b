"""Demonstrations as LeRobotDataset v3: schema, writer and reader."""
