"""From a recipe to a result: the protocol of a benchmark, its commands, its rows and their tables."""
