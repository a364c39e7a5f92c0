import numpy as np

from semgrid_eval.sources.town.ground import MARGIN_M, Ground, GroundPainter, Surface, paint_streets
from semgrid_eval.sources.town.network import Lane, LaneUse, Network

BOUNDS_M = (0.0, 0.0, 40.0, 20.0)


def at(ground: Ground, *points: tuple[float, float]) -> list[int]:
    x_m, y_m = np.array(points).T
    return ground.at(x_m, y_m).tolist()


def test_a_polygon_covers_what_is_inside_and_nothing_else():
    painter = GroundPainter(BOUNDS_M)
    painter.polygon(np.array([(2.0, 3.0), (6.0, 3.0), (6.0, 5.0), (2.0, 5.0)]), Surface.ROAD)
    ground = painter.finished()
    area_m2 = (ground.surface == Surface.ROAD).sum() * 0.04
    assert 7.0 < area_m2 < 9.6
    assert at(ground, (2.3, 3.3), (5.7, 4.7)) == [Surface.ROAD] * 2
    assert at(ground, (1.7, 4.0), (6.3, 4.0), (4.0, 2.7), (4.0, 5.3)) == [Surface.TERRAIN] * 4


def test_a_line_has_its_width():
    painter = GroundPainter(BOUNDS_M)
    painter.line(np.array([(0.0, 10.0), (20.0, 10.0), (40.0, 20.0)]), 4.0, Surface.SIDEWALK)
    ground = painter.finished()
    assert at(ground, (10.0, 8.3), (10.0, 11.7), (20.0, 10.0), (30.0, 15.0)) == [Surface.SIDEWALK] * 4
    assert at(ground, (10.0, 7.7), (10.0, 12.3), (30.0, 12.0)) == [Surface.TERRAIN] * 3


def test_a_street_is_painted_with_its_lanes_markings_and_crossing():
    def lane(use: LaneUse, y_m: float, width_m: float) -> Lane:
        return Lane(use, "ab", np.array([(0.0, y_m), (30.0, y_m)]), width_m, ends_at_light=True)

    lanes = (
        lane(LaneUse.SIDEWALK, 2.3, 4.6),
        lane(LaneUse.PARKING, 5.7, 2.2),
        lane(LaneUse.BICYCLE, 7.65, 1.7),
        lane(LaneUse.CAR, 10.15, 3.3),
    )
    crossing = (np.array([(34.0, 4.6), (34.0, 12.0)]), 4.0)
    junction = np.array([(30.0, 0.0), (40.0, 0.0), (40.0, 20.0), (30.0, 20.0)])
    painter = GroundPainter(BOUNDS_M)
    paint_streets(Network(lanes, (junction,), (), (crossing,)), painter)
    ground = painter.finished()
    along = [(6.0, y_m) for y_m in (2.3, 5.7, 7.65, 10.15)]
    assert at(ground, *along) == [Surface.SIDEWALK, Surface.PARKING, Surface.BICYCLE_LANE, Surface.ROAD]
    assert at(ground, (2.5, 11.8), (29.6, 10.0)) == [Surface.MARKING] * 2
    stripes = ground.at(np.full(70, 34.0), np.linspace(4.8, 11.8, 70))
    assert 0.3 < (stripes == Surface.CROSSING).mean() < 0.7
    assert at(ground, (-MARGIN_M + 1.0, 0.0)) == [Surface.TERRAIN]


def test_the_ground_survives_saving(tmp_path):
    painter = GroundPainter(BOUNDS_M)
    painter.polygon(np.array([(2.0, 3.0), (6.0, 3.0), (6.0, 5.0)]), Surface.ROAD)
    painter.finished().save(tmp_path)
    again = Ground.load(tmp_path)
    np.testing.assert_array_equal(again.surface, painter.finished().surface)
    assert (again.west_m, again.south_m) == (-MARGIN_M, -MARGIN_M)
