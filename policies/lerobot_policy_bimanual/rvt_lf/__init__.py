"""RVT-LF: a leader and a follower, each a Robotic View Transformer."""
