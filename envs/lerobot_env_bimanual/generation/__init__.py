"""Makes datasets: which seeds are tried, who records them, and how shards become a dataset that is never half."""
