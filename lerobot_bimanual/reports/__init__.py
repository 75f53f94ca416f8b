"""Pages and charts of results."""
