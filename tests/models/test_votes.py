"""The likeliest class of draws, by hand."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from support.models import given as given_by
from support.models import made

from semgrid_eval.errors import ConfigError
from semgrid_eval.models.ceiling import Ceiling
from semgrid_eval.models.fresh import FreshErrors
from semgrid_eval.models.true_motion import FuseTrueMotion
from semgrid_eval.models.votes import likeliest
from semgrid_eval.windows.data import WindowBatch

CLASSES, DRAWS = 10, 9


def votes_of(*cells: dict[int, int]) -> torch.Tensor:
    """Votes (1, C, 1, N) of N cells, each given by how many draws have which class."""
    votes = torch.zeros(1, CLASSES, 1, len(cells), dtype=torch.uint8)
    for at, cell in enumerate(cells):
        for class_id, count in cell.items():
            votes[0, class_id, 0, at] = count
    return votes


def batch(past, votes, shift=(0, 0)) -> WindowBatch:
    past = torch.tensor(past, dtype=torch.uint8)
    target = torch.zeros(past[:, 0, 0].shape, dtype=torch.uint8)
    cells = torch.tensor(shift).expand(1, past.shape[2], 2)
    return WindowBatch(past, ("full",), cells, cells[..., 0].float(), target, target.bool(), votes)


CELLS = ({0: 5, 1: 4}, {0: 4, 1: 3, 2: 2}, {0: 4, 7: 5}, {0: 9}, {1: 3, 2: 6})


def test_a_cell_is_known_where_most_draws_know_it_and_has_the_class_of_most_of_them():
    scores = likeliest(votes_of(*CELLS))
    assert scores.argmax(dim=1).flatten().tolist() == [0, 1, 7, 0, 2]
    shares = torch.tensor([5, 3, 5, 9, 6]) / DRAWS
    torch.testing.assert_close(scores.amax(dim=1).flatten(), shares)


def test_where_an_input_saw_something_the_answer_is_known_if_any_draw_knows():
    model = made(Ceiling)
    seen = [[[[[1, 0, 0, 1, 0]]]]]
    assert model.predict(batch(seen, votes_of(*CELLS))).argmax(dim=1).flatten().tolist() == [1, 1, 7, 0, 2]
    blind = made(Ceiling, seen_is_known=False)
    assert blind.predict(batch(seen, votes_of(*CELLS))).argmax(dim=1).flatten().tolist() == [0, 1, 7, 0, 2]
    for model in (Ceiling, FreshErrors):
        answers = [made(model, seen_is_known=known).predict(batch(seen, votes_of(*CELLS))) for known in (True, False)]
        assert [each.argmax(dim=1).flatten().tolist()[0] for each in answers] == [1, 0]


def test_inputs_that_are_not_moved_are_seen_where_they_come_to_lie():
    model = Ceiling(Ceiling.parse_settings({}), given_by(inputs=1, translate=False))
    seen = [[[[[0, 1, 0, 0, 0]]]]]  # a column to the left of where the ego motion moves it
    assert model.predict(batch(seen, votes_of(*CELLS), (0, -1))).argmax(dim=1).flatten().tolist()[0] == 1


@given(seed=st.integers(0, 2**32 - 1))
def test_the_answer_is_as_a_slow_twin_says(seed):
    generator = torch.Generator().manual_seed(seed)
    drawn = torch.randint(0, 4, (DRAWS, 2, 3), generator=generator)
    votes = torch.stack([(drawn == i).sum(dim=0) for i in range(CLASSES)])[None].to(torch.uint8)
    found = likeliest(votes).argmax(dim=1)[0]
    for row in range(2):
        for column in range(3):
            classes = drawn[:, row, column].tolist()
            known = [c for c in classes if c != 0]
            most = max(sorted(set(known)), key=known.count) if 2 * len(known) > DRAWS else 0
            assert found[row, column] == most


def test_true_motion_draws_who_moves_where_he_comes_to_lie_and_clears_where_he_was():
    model = made(FuseTrueMotion)
    older, newer = [[6, 1, 1, 1, 0]], [[0, 6, 1, 0, 3]]
    truth = torch.zeros(1, 1, 2, 2, 1, 5, dtype=torch.uint8)
    truth[0, 0, 0, 0, 0, 0], truth[0, 0, 0, 1, 0, 2] = 1, 6  # of the older input, from cell 0 to 2
    truth[0, 0, 1, 0, 0, 1], truth[0, 0, 1, 1, 0, 3] = 1, 6  # of the newer one, from cell 1 to 3
    found = model.predict(batch([[[older, newer]]], truth)).argmax(dim=1)
    assert found.flatten().tolist() == [0, 1, 1, 6, 3]


def test_what_is_left_moves_with_the_input():
    truth = torch.zeros(1, 1, 1, 2, 1, 5, dtype=torch.uint8)
    truth[0, 0, 0, 0, 0, 1] = 1
    seen = [[[[[6, 6, 1, 1, 1]]]]]  # one column to the left of where the input had it
    found = made(FuseTrueMotion).predict(batch(seen, truth, (0, -1))).argmax(dim=1)
    assert found.flatten().tolist() == [0, 6, 1, 1, 1]


def test_true_motion_needs_inputs_in_the_targets_place():
    with pytest.raises(ConfigError, match="translate"):
        FuseTrueMotion.check(FuseTrueMotion.parse_settings({}), given_by(translate=False))
