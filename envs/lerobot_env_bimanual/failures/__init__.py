"""Why episodes failed: an episode monitor, classes of failure, and the arm that is responsible."""
