"""Ids of Cityscapes' labels, as their authors publish them."""

from semgrid_eval.labels import LABEL_ID, LAST_LABEL_ID, LAST_TRAIN_ID, label_ids_from_train_ids


def test_ids_end_where_those_of_cityscapes_do():
    assert (LAST_LABEL_ID, LAST_TRAIN_ID) == (33, 18)


def test_train_ids_become_label_ids_and_others_are_unlabeled():
    table = label_ids_from_train_ids()
    assert table[[0, LAST_TRAIN_ID]].tolist() == [LABEL_ID["road"], LABEL_ID["bicycle"]]
    assert not table[LAST_TRAIN_ID + 1 :].any()
