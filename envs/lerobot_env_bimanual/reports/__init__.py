"""Tables for the documentation, written from expert reports."""
