"""One file per axis, found by walking this folder."""
