"""What stands where in a small town of each kind."""

import numpy as np
import pytest

from semgrid_eval.labels import LABEL_ID
from semgrid_eval.sources.town.ground import Surface
from semgrid_eval.sources.town.kinds import KINDS
from semgrid_eval.sources.town.network import read_network
from semgrid_eval.sources.town.streets import lay_out_streets
from semgrid_eval.sources.town.town import FIRST_PARKED_ID, Scene, build_scene

STREET = (Surface.ROAD, Surface.MARKING, Surface.CROSSING, Surface.BICYCLE_LANE)


@pytest.fixture(scope="module", params=KINDS, ids=lambda kind: kind.name)
def town(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param.name)
    network = read_network(lay_out_streets(request.param, 300.0, np.random.default_rng(2), folder))
    return network, build_scene(network, request.param, np.random.default_rng(3))


def low_points(scene: Scene, label: str, below_m: float):
    """Middles of the triangles of a class that lie wholly below some height."""
    chosen = (scene.soup.label == LABEL_ID[label]) & (scene.soup.triangles_m[..., 2].max(axis=1) < below_m)
    return scene.soup.triangles_m[chosen].mean(axis=1)


def test_everything_that_a_town_needs_is_there(town):
    _, scene = town
    for name in ("building", "vegetation", "pole", "traffic sign", "traffic light", "car", "bicycle"):
        assert (scene.soup.label == LABEL_ID[name]).sum() >= 12, name
    assert {Surface.ROAD, Surface.SIDEWALK, Surface.CROSSING, Surface.PARKING} <= set(np.unique(scene.ground.surface))


def test_nothing_but_crowns_and_lamps_reaches_over_the_road(town):
    _, scene = town
    for name, below_m in (("building", 1e3), ("wall", 1e3), ("fence", 1e3), ("pole", 4.0), ("vegetation", 0.5)):
        points = low_points(scene, name, below_m)
        surface = scene.ground.at(points[:, 0], points[:, 1])
        assert np.isin(surface, STREET).mean() < 0.005, name


def test_parked_cars_stand_on_parking_strips_and_have_instances(town):
    _, scene = town
    x_m, y_m = scene.parked.centre_m.T
    assert (scene.ground.at(x_m, y_m) == Surface.PARKING).mean() > 0.97
    instances = scene.soup.instance[scene.soup.label == LABEL_ID["car"]]
    assert set(np.unique(instances)) == set(range(FIRST_PARKED_ID, FIRST_PARKED_ID + len(scene.parked)))
    assert set(np.unique(scene.soup.instance[scene.soup.label != LABEL_ID["car"]])) == {0}


def test_parked_cars_do_not_overlap(town):
    _, scene = town
    centres = scene.parked.centre_m
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    assert apart[~np.eye(len(centres), dtype=bool)].min() > 2.0


def test_nothing_is_under_the_ground(town):
    _, scene = town
    lowest = scene.soup.triangles_m[..., 2].min()
    assert -0.5 < lowest <= 0.0


def test_a_scene_survives_saving_and_is_the_same_again(town, tmp_path, request):
    network, scene = town
    kind = KINDS[[kind.name for kind in KINDS].index(request.node.callspec.params["town"].name)]
    again = build_scene(network, kind, np.random.default_rng(3))
    again.save(tmp_path)
    loaded = Scene.load(tmp_path)
    np.testing.assert_array_equal(loaded.soup.triangles_m, scene.soup.triangles_m)
    np.testing.assert_array_equal(loaded.soup.colour, scene.soup.colour)
    np.testing.assert_array_equal(loaded.ground.surface, scene.ground.surface)
    np.testing.assert_array_equal(loaded.parked.centre_m, scene.parked.centre_m)
