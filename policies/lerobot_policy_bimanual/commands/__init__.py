"""Commands of `lerobot-bimanual` that need the policies."""
