"""Meshes made by our code are closed, face outwards and have the size they were asked for."""

from collections import Counter

import numpy as np
import pytest

from lerobot_env_bimanual.props.meshes import lathe, slab

CYLINDER = [(0, -0.1), (0.2, -0.1), (0.2, 0.1), (0, 0.1)]
RING_FOOT = [(0, 0.01), (0.1, 0.01), (0.1, 0), (0.2, 0), (0.2, 0.1), (0, 0.1)]


def volume(vertices, faces):
    """Signed volume, positive if the faces look outwards."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return np.einsum("ni,ni->", a, np.cross(b, c)) / 6


MESHES = [lathe(CYLINDER), lathe(RING_FOOT), slab((0.3, 0.2, 0.01), 0.02), slab((0.3, 0.2, 0.01), 0.2)]


@pytest.mark.parametrize(("vertices", "faces"), MESHES)
def test_each_edge_borders_two_faces_in_opposite_directions(vertices, faces):
    edges = Counter((a, b) for face in faces.tolist() for a, b in zip(face, face[1:] + face[:1], strict=True))
    edges = Counter({edge: n for edge, n in edges.items() if not np.allclose(*vertices[list(edge)])})
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)


def test_meshes_have_the_volume_of_their_profile_or_of_their_box_but_for_the_corners():
    assert volume(*lathe(CYLINDER, segments=400)) == pytest.approx(np.pi * 0.2**2 * 0.2, rel=1e-3)
    hollow = np.pi * 0.2**2 * 0.1 - np.pi * 0.1**2 * 0.01
    assert volume(*lathe(RING_FOOT, segments=400)) == pytest.approx(hollow, rel=1e-3)
    for radius in (0.02, 0.2):
        vertices, faces = slab((0.3, 0.2, 0.01), radius)
        assert np.abs(vertices).max(axis=0) == pytest.approx((0.3, 0.2, 0.01))
        missing = (4 - np.pi) * radius**2
        assert volume(vertices, faces) == pytest.approx((0.6 * 0.4 - missing) * 0.02, rel=5e-3)
