"""Players of episodes: the scripted expert, the baselines, their recordings, load metrics and reports."""
