"""RVT-LF: a leader and a follower, each a Robotic View Transformer: point clouds rendered to views, keyposes out."""
