"""Parts of an episode: reset, actions, observations, progress."""
