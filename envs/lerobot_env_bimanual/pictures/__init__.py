"""Pictures and films of the experts at work."""
