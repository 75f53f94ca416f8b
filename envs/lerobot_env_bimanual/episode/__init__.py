"""What an episode is made of: reset, actions, observations, progress."""
