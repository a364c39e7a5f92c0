import numpy as np
import pytest

from semgrid_eval.sources.town.solids import BOX, Soup, Texture, box, soup_of_boxes, soup_of_crowns

LOOK = (11, int(Texture.FACADE), (10, 20, 30))


def signed_volume(triangles) -> float:
    first, second, third = triangles.astype(np.float64).transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", first, np.cross(second, third)) / 6.0)


def test_a_box_has_its_size_and_its_faces_turn_outward():
    rows = np.array([box((3.0, -2.0, 0.7), (1.0, 4.0), (5.0, 2.0), LOOK, instance=7)], BOX)
    soup = soup_of_boxes(rows)
    assert len(soup) == 12
    assert signed_volume(soup.triangles_m) == pytest.approx(5.0 * 2.0 * 3.0, rel=1e-5)
    assert (soup.label == 11).all()
    assert (soup.instance == 7).all()
    assert (soup.colour == (10, 20, 30)).all()
    corners = soup.triangles_m.reshape(-1, 3) - (3.0, -2.0, 0.0)
    ahead = corners[:, :2] @ (np.cos(0.7), np.sin(0.7))
    assert np.abs(ahead).max() == pytest.approx(2.5, abs=1e-5)


def test_a_tapered_box_has_the_volume_of_a_frustum():
    rows = np.array([box((0.0, 0.0, 0.0), (0.0, 3.0), (4.0, 4.0), LOOK, top_size_m=(2.0, 2.0))], BOX)
    assert signed_volume(soup_of_boxes(rows).triangles_m) == pytest.approx(3.0 / 3.0 * (16 + 4 + 8), rel=1e-5)


def test_every_crown_is_a_closed_surface_within_its_radii():
    rng = np.random.default_rng(0)
    centres = np.array([(0.0, 0.0, 5.0), (30.0, 0.0, 6.0)])
    soup = soup_of_crowns(centres, np.array([(2.0, 3.0), (1.0, 1.0)]), 21, np.zeros((2, 3), np.uint8), rng)
    assert len(soup) == 160
    first = soup.triangles_m[:80]
    edges = {tuple(np.round(np.concatenate(pair), 4)) for t in first for pair in zip(t, np.roll(t, -1, 0), strict=True)}
    assert {(*edge[3:], *edge[:3]) for edge in edges} == edges, "each edge is walked once in each direction"
    assert 0.4 * 50.3 < signed_volume(first) < 1.2 * 50.3  # 4/3 pi 2 2 3
    assert np.abs(first[..., 0]).max() < 2.0 * 1.13


def test_triangles_survive_saving_choosing_and_joining(tmp_path):
    rows = np.array([box((x, 0.0, 0.0), (0.0, 1.0), (1.0, 1.0), LOOK) for x in (0.0, 5.0)], BOX)
    soup = soup_of_boxes(rows)
    soup.save(tmp_path)
    again = Soup.load(tmp_path)
    right = again.where(again.triangles_m[:, 0, 0] > 2.0)
    assert len(right) == 12
    joined = Soup.joined([right, soup])
    np.testing.assert_array_equal(joined.triangles_m[12:], soup.triangles_m)
    np.testing.assert_allclose(soup.moved(1.0, 2.0).triangles_m, soup.triangles_m + np.float32([1.0, 2.0, 0.0]))
