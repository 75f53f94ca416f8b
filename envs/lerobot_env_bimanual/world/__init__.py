"""The simulated world: room, cameras, physics, images."""
