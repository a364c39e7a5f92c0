"""What stands along a street: parked cars, street lamps, traffic lights, signs, bollards and rows of trees."""

import numpy as np

from semgrid_eval.labels import LABEL_ID
from semgrid_eval.sources.town.kinds import TownKind
from semgrid_eval.sources.town.network import Lane, LaneUse, Network, Polyline
from semgrid_eval.sources.town.solids import BoxRow, Texture, Tree, box, draw_tree
from semgrid_eval.sources.town.traffic import CAR_TYPES, ROAD_USERS

ParkedCar = tuple[int, float, float, float]  # type index, x, y, yaw
_POLE, _SIGN, _LIGHT = LABEL_ID["pole"], LABEL_ID["traffic sign"], LABEL_ID["traffic light"]
_BICYCLE = LABEL_ID["bicycle"]
_GREY, _WHITE, _BLACK = (112, 114, 116), (210, 210, 206), (30, 32, 34)
_METAL = (_POLE, Texture.PLAIN, _GREY)
_SIGN_COLOURS = ((196, 38, 34), (36, 74, 158), (228, 196, 60), (210, 210, 206))
_CURB_M = 0.55  # from the curb to the middle of what stands on the sidewalk
_CLEAR_OF_JUNCTION_M = 7.0


def park_cars(network: Network, kind: TownKind, rng: np.random.Generator) -> list[ParkedCar]:
    """Fill the parking strips: rows with gaps, a few centimetres and degrees off."""
    cars: list[ParkedCar] = []
    for lane in network.lanes:
        if lane.use is not LaneUse.PARKING:
            continue
        line = Polyline.through(lane.line_m)
        taken = float(np.clip(rng.normal(kind.parked, 0.2), 0.05, 1.0))
        s_m = _CLEAR_OF_JUNCTION_M + float(rng.uniform(0.0, 2.0))
        while s_m < line.length_m - _CLEAR_OF_JUNCTION_M:
            type_index = int(rng.choice(CAR_TYPES))
            length_m = ROAD_USERS[type_index].length_m
            if rng.random() < taken:
                x_m, y_m, yaw_rad = line.at(s_m + length_m / 2.0, float(rng.normal(0.0, 0.06)))
                turned = np.pi if rng.random() < 0.06 else 0.0
                cars.append((type_index, x_m, y_m, yaw_rad + turned + float(rng.normal(0.0, 0.015))))
            s_m += length_m + float(rng.uniform(0.5, 1.3))
    return cars


def furnish_streets(network: Network, kind: TownKind, rng: np.random.Generator) -> tuple[list[BoxRow], list[Tree]]:
    """Set up poles, signs and lights along all sidewalks, and the trees of streets that have a row."""
    boxes: list[BoxRow] = []
    trees: list[Tree] = []
    for lane in network.lanes:
        if lane.use is LaneUse.SIDEWALK:
            boxes += _lamps(lane, rng) + _signs(lane, rng) + _bollards(lane, rng) + _parked_bicycles(lane, rng)
            if lane.ends_at_light:
                boxes += _traffic_light(lane)
            if rng.random() < kind.tree_rows:
                trees += _tree_row(lane, rng)
    return boxes, trees


def _curb(lane: Lane) -> float:
    """Return the offset to the left of a sidewalk's middle at which things stand along its curb."""
    return lane.width_m / 2.0 - _CURB_M


def _lamps(lane: Lane, rng: np.random.Generator) -> list[BoxRow]:
    line = Polyline.through(lane.line_m)
    boxes: list[BoxRow] = []
    height_m = float(rng.uniform(5.0, 8.5))
    for s_m in np.arange(float(rng.uniform(5.0, 14.0)), line.length_m - 3.0, float(rng.uniform(22.0, 32.0))):
        place = line.at(float(s_m), _curb(lane))
        boxes.append(box(place, (0.0, height_m), (0.2, 0.2), _METAL, top_size_m=(0.1, 0.1)))
        arm = (*line.at(float(s_m), _curb(lane) + 0.7)[:2], place[2])
        boxes.append(box(arm, (height_m - 0.1, height_m + 0.1), (0.3, 1.5), _METAL))
    return boxes


def _signs(lane: Lane, rng: np.random.Generator) -> list[BoxRow]:
    line = Polyline.through(lane.line_m)
    boxes: list[BoxRow] = []
    s_m = float(rng.uniform(2.0, 14.0))
    while s_m < line.length_m - 2.0:
        place = line.at(s_m, _curb(lane) - float(rng.uniform(0.0, 0.3)))
        height_m = float(rng.uniform(2.2, 2.8))
        side_m = float(rng.uniform(0.5, 0.8))
        colour = _SIGN_COLOURS[int(rng.integers(len(_SIGN_COLOURS)))]
        boxes.append(box(place, (0.0, height_m), (0.09, 0.09), _METAL))
        boxes.append(box(place, (height_m - side_m, height_m + 0.05), (0.12, side_m), (_SIGN, Texture.PLAIN, colour)))
        s_m += float(rng.uniform(10.0, 34.0))
    return boxes


def _bollards(lane: Lane, rng: np.random.Generator) -> list[BoxRow]:
    if rng.random() > 0.25:
        return []
    line = Polyline.through(lane.line_m)
    places = [line.at(float(s_m), lane.width_m / 2.0 - 0.35) for s_m in np.arange(1.0, min(12.0, line.length_m), 1.8)]
    return [box(place, (0.0, 0.95), (0.16, 0.16), (_POLE, Texture.PLAIN, _WHITE)) for place in places]


def _parked_bicycles(lane: Lane, rng: np.random.Generator) -> list[BoxRow]:
    """Return rows of bicycles that lean across the curb, one to six in a row."""
    line = Polyline.through(lane.line_m)
    boxes: list[BoxRow] = []
    s_m = float(rng.uniform(4.0, 40.0))
    while s_m < line.length_m - 4.0:
        for _ in range(int(rng.integers(1, 7))):
            x_m, y_m, yaw_rad = line.at(s_m, _curb(lane) - 0.4)
            boxes += _bicycle((x_m, y_m, yaw_rad + float(rng.normal(1.2, 0.2))), rng)
            s_m += float(rng.uniform(0.55, 0.9))
        s_m += float(rng.uniform(12.0, 45.0))
    return boxes


def _bicycle(place: tuple[float, float, float], rng: np.random.Generator) -> list[BoxRow]:
    x_m, y_m, yaw_rad = place
    frame = (_BICYCLE, Texture.PLAIN, _SIGN_COLOURS[int(rng.integers(len(_SIGN_COLOURS)))])
    dark = (_BICYCLE, Texture.PLAIN, _BLACK)
    wheel = ((0.0, 0.66), (0.62, 0.06), dark)
    parts = [(0.52, *wheel), (-0.52, *wheel), (0.0, (0.4, 0.7), (0.95, 0.08), frame)]
    parts.append((0.42, (0.9, 1.02), (0.08, 0.5), dark))
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return [
        box((x_m + cos * along, y_m + sin * along, yaw_rad), heights, size, look)
        for along, heights, size, look in parts
    ]


def _traffic_light(lane: Lane) -> list[BoxRow]:
    """Return the light at a sidewalk's end: a pole at the curb, and a head that faces those who come."""
    line = Polyline.through(lane.line_m)
    x_m, y_m, yaw_rad = line.at(line.length_m - 0.5, _curb(lane) + 0.15)
    head_x, head_y = x_m - 0.2 * np.cos(yaw_rad), y_m - 0.2 * np.sin(yaw_rad)
    return [
        box((x_m, y_m, yaw_rad), (0.0, 3.4), (0.15, 0.15), _METAL),
        box((head_x, head_y, yaw_rad), (2.4, 3.4), (0.25, 0.36), (_LIGHT, Texture.PLAIN, _BLACK)),
        box((x_m, y_m, yaw_rad), (0.95, 1.15), (0.2, 0.2), (_POLE, Texture.PLAIN, (190, 160, 40))),
    ]


def _tree_row(lane: Lane, rng: np.random.Generator) -> list[Tree]:
    line = Polyline.through(lane.line_m)
    spacing_m, size = float(rng.uniform(7.0, 14.0)), float(rng.uniform(0.75, 1.25))
    trees = []
    for s_m in np.arange(float(rng.uniform(3.0, 8.0)), line.length_m - 3.0, spacing_m):
        x_m, y_m, _ = line.at(float(s_m) + float(rng.normal(0.0, 0.4)), _curb(lane) - 0.2)
        if rng.random() < 0.85:
            trees.append(draw_tree(x_m, y_m, size, rng))
    return trees
