"""What can be made different about a world, one dial at a time: axes, each with three levels."""
