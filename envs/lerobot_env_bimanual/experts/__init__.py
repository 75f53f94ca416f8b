"""Playing episodes: the scripted experts, and the controls that give their success a meaning."""
