"""Label images of a Cityscapes tree: found by the name of the frame, of the kind of ids that was asked for."""

import numpy as np
import pytest
from support.cityscapes_tree import Tree, fault, frames, only, put, sequences

from semgrid_eval.errors import InputError
from semgrid_eval.labels import label_ids_from_train_ids, label_palette
from semgrid_eval.recording.png import decode_ids, encode_gray, with_palette


@pytest.fixture
def tree(tmp_path):
    return Tree(tmp_path / "src")


def test_gt_fine_labels_the_frame_that_has_them(tree):
    tree.gt_fine = True
    names = tree.write(range(30))
    labels = [frame.label_png for frame in frames(only(tree))]
    assert [index for index, label in enumerate(labels) if label is not None] == [19]
    assert labels[19] == tree.gt(names[19]).read_bytes()


@pytest.mark.parametrize("place", ["{frame}_predLabelIds.png", "val/aachen/{frame}.png", "x/y/{frame}-any.thing.png"])
def test_labels_are_found_by_the_name_of_the_frame(tree, tmp_path, place):
    names = tree.write(range(2))
    for name in names:
        put(tmp_path / "labels" / place.format(frame=name), tree.label())
    put(tmp_path / "labels" / f"{names[0]}9_other.png", tree.label())
    for frame, name in zip(frames(only(tree, labels=tmp_path / "labels")), names, strict=True):
        assert frame.label_png == (tmp_path / "labels" / place.format(frame=name)).read_bytes()


def test_label_ids_are_chosen_among_several_pictures_of_a_frame(tree, tmp_path):
    (name,) = tree.write([0])
    for kind in ("gtFine_color", "gtFine_labelIds", "gtFine_instanceIds", "gtFine_labelTrainIds"):
        put(tmp_path / "labels" / f"{name}_{kind}.png", tree.label())
    (frame,) = frames(only(tree, labels=tmp_path / "labels"))
    assert frame.label_png == (tmp_path / "labels" / f"{name}_gtFine_labelIds.png").read_bytes()


def test_train_ids_become_label_ids(tree, tmp_path):
    (name,) = tree.write([0])
    train_ids = np.resize(np.array([*range(19), 255], np.uint8), (32, 64))
    put(tmp_path / "labels" / f"{name}.png", with_palette(encode_gray(train_ids), label_palette()))
    (frame,) = frames(only(tree, labels=tmp_path / "labels", train_ids=True))
    assert np.array_equal(decode_ids(frame.label_png), label_ids_from_train_ids()[train_ids])


def test_label_ids_taken_for_train_ids_are_noticed(tree, tmp_path):
    (name,) = tree.write([0])
    put(tmp_path / "labels" / f"{name}.png", encode_gray(np.full((32, 64), 26, np.uint8)))
    with pytest.raises(InputError, match=rf"{name}\.png: holds 26, which is not a train id; are these label ids\?"):
        frames(only(tree, labels=tmp_path / "labels", train_ids=True))


@pytest.mark.parametrize("others", [(), ("gtFine_color",)])
@pytest.mark.parametrize(
    ("kind", "train_ids", "expected"),
    [
        ("gtFine_labelTrainIds", False, "is named as train ids; add --train-ids"),
        ("predTrainIDs", False, "is named as train ids; add --train-ids"),
        ("predLabelIds", True, "is named as label ids; leave out --train-ids"),
    ],
)
def test_labels_whose_name_says_the_other_kind_are_refused(tree, tmp_path, kind, train_ids, expected, others):
    (name,) = tree.write([0])
    for each in (kind, *others):
        put(tmp_path / "labels" / f"{name}_{each}.png", tree.label(highest=18))
    with pytest.raises(InputError) as caught:
        sequences(tree, labels=tmp_path / "labels", train_ids=train_ids)
    assert str(caught.value) == f"{tmp_path / 'labels' / name}_{kind}.png: {expected}"


def test_labels_of_other_frames_alone_are_noticed(tree, tmp_path):
    tree.write([0])
    put(tmp_path / "labels" / "berlin_000000_000000.png", tree.label())
    with pytest.raises(InputError, match=r"labels: holds no \.png whose name begins with aachen_000000_000000_"):
        only(tree, labels=tmp_path / "labels")


def test_train_ids_of_gt_fine_are_those_of_its_own_file(tree):
    (name,) = tree.write([0])
    put(tree.gt(name).with_name(f"{name}_gtFine_labelTrainIds.png"), encode_gray(np.full((32, 64), 13, np.uint8)))
    (frame,) = frames(only(tree, train_ids=True))
    assert np.unique(decode_ids(frame.label_png)).tolist() == [26]


def test_labels_of_few_bits_are_brought_to_eight(tree, tmp_path):
    from PIL import Image

    (name,) = tree.write([0])
    ids = np.arange(64 * 32).reshape(32, 64) % 16
    picture = Image.fromarray(ids.astype(np.uint8)).convert("P")
    picture.putdata(ids.ravel().tolist())
    picture.putpalette(bytes(48))
    path = tmp_path / "labels" / f"{name}.png"
    path.parent.mkdir()
    picture.save(path, bits=4)
    (frame,) = frames(only(tree, labels=path.parent))
    assert np.array_equal(decode_ids(frame.label_png), ids)


def test_several_label_images_of_a_frame_are_named(tree, tmp_path):
    (name,) = tree.write([0])
    for kind in ("a", "b"):
        put(tmp_path / "labels" / f"{name}_{kind}.png", tree.label())
    message = fault(tree, labels=tmp_path / "labels")
    assert message == f"{tmp_path / 'labels' / name}_a.png: is one of 2 label images of its frame"
