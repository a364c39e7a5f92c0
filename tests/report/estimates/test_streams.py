"""Streams in a report: curves, what a prediction wins in time, the best lead and the warm-up, each by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.fake_run import counted_row
from support.scoring import score_rows
from support.streams import stream

from semgrid_eval.report.estimates.leads import best_leads, lead_series
from semgrid_eval.report.estimates.streams import plain_strategy, strategies, warm_up, won_ms
from semgrid_eval.report.figures.streams import stream_frame, stream_plots
from semgrid_eval.report.rows.pairing import headline, reference_of, way_of
from semgrid_eval.report.tables.streams import stream_sentence, stream_table, wins_table
from semgrid_eval.scores.metrics.table import IOU


def rows():
    plain = [
        stream(f"BL-newest +{at}", hits, delay=float(at)) for at, hits in ((0, 100), (100, 80), (200, 60), (400, 40))
    ]
    return [
        *plain,
        stream("BL-newest", 60, delay=200.0, measured=True),
        stream("BL-still", 50, delay=200.0, measured=True, moved=False),
        stream("RN", 70, delay=220.0, measured=True, asked="adaptive"),
    ]


def scored(found):
    return score_rows(found, np.random.default_rng(0))


def test_rows_that_differ_in_their_latency_alone_are_one_strategy_with_the_measured_one_for_it():
    found = {each.name: each for each in strategies(scored(rows()))}
    assert list(found) == ["BL-newest", "BL-still", "RN"]
    assert found["BL-newest"].measured.row.name == "BL-newest"
    assert found["BL-newest"].delays_ms == [0, 100, 200, 200, 400]
    assert plain_strategy(list(found.values())) is found["BL-newest"], "moved along rather than not"


def test_chains_whose_latency_was_measured_are_strategies_of_their_own():
    measured = [
        stream(name, 60, delay=delay, measured=True, profile="latency.json", scale=scale)
        for name, delay, scale in (("RN", 50.0, 1.0), ("RN +100", 150.0, 1.0), ("RN half as fast", 100.0, 2.0))
    ]
    simulated = stream("RN at 300", 30, delay=300.0)
    both = strategies(scored([*measured, simulated]))
    assert [[entry.row.name for entry in each.entries] for each in both] == [
        ["RN", "RN +100"],
        ["RN half as fast"],
        ["RN at 300"],
    ]
    (one,) = strategies(scored([*measured[:2], simulated]))
    assert one.delays_ms == [50, 150, 300], "with one chain, simulated latencies are on its curve"


def test_what_is_won_in_time_is_read_from_the_curve_of_the_newest_grid():
    found = {each.name: each for each in strategies(scored(rows()))}
    plain, network = found["BL-newest"], found["RN"]
    assert plain.delay_with(0.65, "mean_known") == pytest.approx(175)
    assert math.isnan(plain.delay_with(0.9, "mean_known")), "between no delay and the first one is no straight line"
    assert plain.delay_with(0.4, "mean_known") == pytest.approx(400)
    assert math.isnan(plain.delay_with(0.3, "mean_known"))
    # .70 is what the newest grid has after 150 ms, and the network answers after 220.
    won = won_ms(network.measured, plain, "mean_known")
    assert (won.value, won.low, won.high) == (pytest.approx(70), pytest.approx(70), pytest.approx(70))
    sentence = stream_sentence(list(found.values()))
    assert sentence.startswith(
        "RN, whose chain takes 220 ms, has a mean streaming IoU of 0.700; BL-newest, with 200 ms"
    )
    assert sentence.endswith("BL-newest would be as good with 150 ms.")


def test_tables_and_figure_show_each_strategy_once_and_each_row_is_in_the_frame():
    found = strategies(scored(rows()))
    table = stream_table(found, {}, {})
    assert [body[0].header for body in table.bodies] == ["BL-newest", "BL-still", "RN"]
    assert [body[0].header for body in wins_table(found).bodies] == ["BL-still", "RN"]
    frame = stream_frame(found)
    assert len(frame) == len(rows())
    assert frame[frame.strategy == "BL-newest"].delay_ms.tolist() == [0, 100, 200, 200, 400]
    assert len(stream_plots(found, {})) == 1
    assert stream_plots(strategies(scored(rows()[-1:])), {}) == []


def test_without_a_stream_there_is_nothing_to_show():
    found = strategies(scored([counted_row("BL-DC", {"road": [1] * 12})]))
    assert (found, stream_table(found, {}, {}), wins_table(found), stream_sentence(found)) == ([], None, None, "")


def test_the_best_lead_is_by_category_and_its_interval_is_that_of_the_best_by_draw():
    """One lead is better in half of the recordings by as much as it is worse in the others: either may win a draw."""
    even = [60] * 6 + [40] * 6
    leads = [
        stream("RN for 100", even, delay=200.0, asked="fixed", measured=True, lead_ms=100.0),
        stream(
            "RN for 200", [each + 1 for each in even[::-1]], delay=200.0, asked="fixed", measured=True, lead_ms=200.0
        ),
        stream("RN for 300", 10, delay=200.0, asked="fixed", measured=True, lead_ms=300.0),
    ]
    (series,) = lead_series(scored(leads[::-1]))
    entry, lead = series.best("mean_known")
    assert entry.row.name == "RN for 200"
    assert (lead.value, lead.low, lead.high) == (200.0, 100.0, 200.0)
    assert best_leads([series])["mean_known"] == 200.0
    assert lead_series(scored(leads[:1])) == []


def test_the_warm_up_ends_with_the_first_answer_of_the_slowest_strategy():
    def blocks(row):
        """Let its windows be blocks of half a second of two recordings."""
        windows = tuple(
            window.model_copy(
                update={
                    "recording": f"town_{i // 6}",
                    "input_stamps_ns": (i % 6 * 500_000_000 + i // 6,),
                    "target_stamp_ns": (i % 6 + 1) * 500_000_000 + i // 6,
                }
            )
            for i, window in enumerate(row.results[0].record.windows)
        )
        result = replace(row.results[0], record=row.results[0].record.model_copy(update={"windows": windows}))
        return replace(row, results=(result,))

    class Run:
        rows = (blocks(stream("a", 50, delay=1.0, first=100.0)), blocks(stream("b", 50, delay=2.0, first=700.0)))

    division = warm_up([Run])
    for row in Run.rows:
        sums = division.sums(row, row.results[0], IOU)[:, 0].sum(axis=(1, 2))
        assert (sums > 0).tolist() == [False, False, True, True, True, True] * 2
    plain = counted_row("BL-DC", {"road": [1] * 12})
    assert division.sums(plain, plain.results[0], IOU) is None


def test_a_stream_is_measured_against_the_newest_grid_that_moves_along_and_no_oracle_is_best():
    still = stream("BL-still", 40, delay=200.0, measured=True, moved=False)
    found = [
        still,
        stream("BL-newest", 60, delay=200.0, measured=True),
        stream("RN", 70, delay=220.0, measured=True, asked="adaptive"),
        stream("RN-known", 80, delay=220.0, measured=True, asked="known"),
        stream("RN-free", 90, delay=200.0, measured=True, asked="adaptive", free=True),
        stream("RN-fixed", 65, delay=220.0, measured=True, asked="fixed", lead_ms=100.0),
    ]
    assert {row.name: reference_of(row, found).name for row in found[2:]} == dict.fromkeys(
        ("RN", "RN-known", "RN-free", "RN-fixed"), "BL-newest"
    )
    assert headline(scored(found)).best.name == "RN"
    assert all(way_of(row, found) is None for row in found)
    assert "RN, whose" in stream_sentence(strategies(scored(found)))


def test_who_never_answers_ends_no_warm_up():
    class Run:
        rows = (stream("a", 50, delay=1.0), silent(stream("b", 0, delay=1.0, first=9e9)))

    division = warm_up([Run])
    assert division.sums(Run.rows[0], Run.rows[0].results[0], IOU) is not None


def silent(row):
    went = row.results[0].record.stream
    record = row.results[0].record.model_copy(update={"stream": went.model_copy(update={"misses": went.evaluations})})
    return replace(row, results=(replace(row.results[0], record=record),))
