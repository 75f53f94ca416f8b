"""Looking at single predictions of a trained policy."""
