"""Tables for the documentation, written from certificates."""
