"""Results of played episodes: one record of an episode, and the files that hold tables of them."""
