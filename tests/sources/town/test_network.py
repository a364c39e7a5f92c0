import math

import numpy as np
import pytest

from semgrid_eval.errors import InputError
from semgrid_eval.sources.town.kinds import KINDS
from semgrid_eval.sources.town.network import LaneUse, Polyline, read_network
from semgrid_eval.sources.town.streets import SIDEWALK_WIDTH_M, lay_out_streets

NET = """<net>
  <edge id=":b_c0" function="crossing"><lane id=":b_c0_0" index="0" width="4.0" shape="9,-5 9,5"/></edge>
  <edge id=":b_w0" function="walkingarea"><lane id=":b_w0_0" index="0" shape="0,0 1,0 1,1"/></edge>
  <edge id=":b_0" function="internal"><lane id=":b_0_0" index="0" shape="0,0 1,0"/></edge>
  <edge id="ab" from="a" to="b">
    <lane id="ab_0" index="0" allow="pedestrian" width="4.6" shape="0,-8,0.5 30,-8,0.5"/>
    <lane id="ab_1" index="1" disallow="all" width="2.2" shape="0,-5 30,-5"/>
    <lane id="ab_2" index="2" allow="bicycle" width="1.7" shape="0,-3 30,-3"/>
    <lane id="ab_3" index="3" disallow="pedestrian" shape="0,-1.6 30,-1.6"/>
  </edge>
  <junction id="a" type="priority" shape="-1,-1 1,-1 1,1"/>
  <junction id="b" type="traffic_light" shape="30,-9 40,-9 40,9 30,9"/>
</net>"""
CORNER = Polyline.through(np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 0.0), (10.0, 5.0)]))


def test_lanes_are_told_apart_by_whom_they_are_for(tmp_path):
    path = tmp_path / "town.net.xml"
    path.write_text(NET)
    network = read_network(path)
    assert [lane.use for lane in network.lanes] == [LaneUse.SIDEWALK, LaneUse.PARKING, LaneUse.BICYCLE, LaneUse.CAR]
    assert [lane.width_m for lane in network.lanes] == [4.6, 2.2, 1.7, 3.2]
    assert all(lane.ends_at_light for lane in network.lanes)
    np.testing.assert_array_equal(network.lanes[0].line_m, [(0, -8), (30, -8)])
    assert len(network.junctions_m) == 2
    assert len(network.walking_areas_m) == 1
    assert network.crossings[0][1] == 4.0
    assert network.bounds_m() == (-1.0, -9.0, 40.0, 9.0)
    assert network.street_km() == pytest.approx(0.015)


def test_a_network_without_streets_is_an_empty_town(tmp_path):
    path = tmp_path / "town.net.xml"
    path.write_text("<net/>")
    with pytest.raises(InputError, match=r"town\.net\.xml: the town is empty"):
        read_network(path)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_every_kind_of_town_has_streets_for_everybody(kind, tmp_path):
    network = read_network(lay_out_streets(kind, 400.0, np.random.default_rng(1), tmp_path))
    uses = {lane.use for lane in network.lanes}
    assert uses == set(LaneUse)
    sidewalks = {lane.edge: lane.width_m for lane in network.lanes if lane.use is LaneUse.SIDEWALK}
    assert set(sidewalks) == {lane.edge for lane in network.lanes}
    assert set(sidewalks.values()) == {SIDEWALK_WIDTH_M}
    assert network.crossings
    assert any(lane.ends_at_light for lane in network.lanes)
    west_m, south_m, east_m, north_m = network.bounds_m()
    assert 300 < east_m - west_m < 600
    assert 300 < north_m - south_m < 600


def test_places_lie_along_the_line_and_to_its_left():
    assert CORNER.length_m == pytest.approx(15.0)
    assert CORNER.at(4.0, 2.0) == pytest.approx((4.0, 2.0, 0.0))
    assert CORNER.at(12.0, 2.0) == pytest.approx((8.0, 2.0, math.pi / 2))


def test_beyond_its_ends_a_line_goes_straight_on():
    assert CORNER.at(-3.0) == pytest.approx((-3.0, 0.0, 0.0))
    assert CORNER.at(17.0) == pytest.approx((10.0, 7.0, math.pi / 2))


def test_a_piece_keeps_the_corners_inside_it():
    np.testing.assert_allclose(CORNER.piece(8.0, 12.0), [(8, 0), (10, 0), (10, 2)])
