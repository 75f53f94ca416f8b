"""Makes datasets: plans which seeds are tried, records shards, and publishes the merged dataset in one move."""
