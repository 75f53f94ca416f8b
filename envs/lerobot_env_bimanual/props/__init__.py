"""Props: the things that tasks put on the table."""
