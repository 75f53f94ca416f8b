"""RVT: rendered views of the scene in, keyposes out."""
