import numpy as np

from semgrid_eval.classes import CLASS_NAMES, UNKNOWN, category_members
from semgrid_eval.report.estimates.bootstrap import CATEGORY_COLUMNS, MERGED_COLUMNS, score_rows
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.tables.long import category_table, class_table, members, target_cells


def _scores(run):
    return list(score_rows(load_runs([run])[0].rows, np.random.default_rng(0), draws=2).values())


def test_there_is_a_line_for_each_row_seed_and_class(run):
    table = class_table(_scores(run))
    assert list(table.columns) == ["row", "family", "model", "class", "iou", "windows", "cells", "seed"]
    assert len(table) == (4 + 3 + 2) * len(CLASS_NAMES)
    assert sorted(table[table.row == "ED-DC"].seed.unique()) == [0, 1, 2]
    assert table[table.family == "BL"].seed.isna().all()
    assert not table.duplicated(["row", "class", "seed"]).any()


def test_there_is_a_line_for_each_row_seed_and_category(run):
    table = category_table(_scores(run))
    assert list(table.columns) == ["row", "family", "model", "category", "iou", "windows", "cells", "seed"]
    assert list(table.category.unique()) == [*CATEGORY_COLUMNS, *MERGED_COLUMNS]
    assert (table.windows == 16).all()


def test_cells_are_those_of_the_target_outside_the_mask(run):
    row = load_runs([run])[0].rows[0]
    with np.load(run / "windows" / f"{row.results[0].record.windows_id}.npz") as arrays:
        target, mask = arrays["target"], arrays["mask"]
    got = target_cells(row.results[0].counts)
    for index, name in enumerate(CLASS_NAMES):
        assert got[name] == np.sum((target == index) & ~mask)
    assert got["vehicles"] == got["car"] + got["large_vehicle"]
    assert got["mean_known"] == np.sum(~mask) - got["unknown"]


def test_members_agree_with_the_categories():
    assert members()["static"] == category_members()["static"]
    assert UNKNOWN not in members()["static_known"] + members()["mean_known"]
    assert members()["merged_vehicles"] == members()["vehicles"]
