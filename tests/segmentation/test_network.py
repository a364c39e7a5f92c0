import numpy as np
import pytest

pytest.importorskip("onnxruntime", reason="the extra 'segment' is not installed")
pytest.importorskip("onnx", reason="onnx, which makes the models, is not installed")

from onnx import TensorProto, helper, numpy_helper
from support.onnx_models import FLAT, colour_network, save

from semgrid_eval.errors import InputError
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.segmentation.config import SegmentationConfig
from semgrid_eval.segmentation.network import SegmentationNetwork

ROAD, CAR = LABEL_ID["road"], LABEL_ID["car"]
TRAIN = {0: (1.0, 0.0, 0.0), 13: (0.0, 0.0, 1.0)}  # red is road, blue is car
RED, BLUE = (255, 0, 0), (0, 0, 255)


def open_network(path, **options):
    return SegmentationNetwork(path, SegmentationConfig(**{**FLAT, **options}))


def painted(rows):
    """A picture of letters: r red, b blue."""
    return np.array([[RED if letter == "r" else BLUE for letter in row] for row in rows], np.uint8)


@pytest.fixture
def three(tmp_path):
    """A class map of three classes, which have their indices as label ids."""
    (tmp_path / "three.yaml").write_text("classes: {none: unlabeled, own: ego vehicle, edge: rectification border}")
    return str(tmp_path / "three.yaml")


def named(rows):
    return [[ROAD if letter == "r" else CAR for letter in row] for row in rows]


ASYMMETRIC = ["rrrb", "rbbb", "rrrr"]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "network.onnx"


def tensor(name, shape, kind=TensorProto.FLOAT):
    return helper.make_tensor_value_info(name, kind, shape)


def identity(path, shape, answer_shape=None, kind=TensorProto.FLOAT):
    """A model that gives its input back."""
    node = helper.make_node("Identity", ["image"], ["answer"])
    return save(path, [node], [tensor("image", shape, kind)], [tensor("answer", answer_shape or shape, kind)])


def test_train_ids_become_label_ids_in_place(path):
    network = open_network(colour_network(path, colours=TRAIN))
    found = network.label(painted(ASYMMETRIC))
    assert found.dtype == np.uint8
    assert found.tolist() == named(ASYMMETRIC)


def test_pictures_of_several_sizes_go_through_open_axes(path):
    network = open_network(colour_network(path, colours=TRAIN))
    for rows in (["r"], ["rb", "bb"], ["b" * 40] * 30):
        assert network.label(painted(rows)).tolist() == named(rows)


def test_label_ids_stay_label_ids(path):
    colours = {ROAD: (1.0, 0.0, 0.0), CAR: (0.0, 0.0, 1.0)}
    network = open_network(colour_network(path, classes=34, colours=colours), classes="cityscapes-ids")
    assert network.label(painted(ASYMMETRIC)).tolist() == named(ASYMMETRIC)


@pytest.mark.parametrize("number_type", [np.int64, np.int32, np.uint8])
def test_ids_are_taken_as_they_are(path, number_type):
    network = open_network(colour_network(path, colours=TRAIN, ids=number_type))
    assert network.label(painted(ASYMMETRIC)).tolist() == named(ASYMMETRIC)


def test_void_ids_are_unlabeled(path):
    network = open_network(colour_network(path, classes=256, colours={0: (1, 0, 0), 255: (0, 0, 1)}, ids=np.int64))
    assert network.label(painted(["rb"])).tolist() == [[ROAD, 0]]


def test_channels_may_come_last(path):
    model = colour_network(path, colours=TRAIN, shape=(1, "h", "w", 3), nhwc=True)
    assert open_network(model, layout="nhwc").label(painted(ASYMMETRIC)).tolist() == named(ASYMMETRIC)


@pytest.mark.parametrize("layout", ["nhwc", "auto"])
def test_layout_of_the_axes_is_found(path, layout):
    rows = ["rrrrb", "rbbbb", "rrrrr"]  # neither side is 3
    model = colour_network(path, colours=TRAIN, shape=(1, "h", "w", 3), nhwc=True)
    assert open_network(model, layout=layout).label(painted(rows)).tolist() == named(rows)


def test_ids_may_have_an_axis_of_one_class(path):
    nodes = [
        helper.make_node("ReduceMax", ["image", "axes"], ["high"], keepdims=1),
        helper.make_node("Cast", ["high"], ["answer"], to=TensorProto.INT64),
    ]
    axes = numpy_helper.from_array(np.array([1], np.int64), "axes")
    outputs = [tensor("answer", [1, "one", "h", "w"], TensorProto.INT64)]
    model = save(path, nodes, [tensor("image", [1, 3, "h", "w"])], outputs, [axes], opset=18)
    picture = np.array([[[0, 0, 0], [0, 255, 0]]], np.uint8)
    assert open_network(model).label(picture).tolist() == [[ROAD, LABEL_ID["sidewalk"]]]


@pytest.mark.parametrize("upsample", ["bilinear", "nearest"])
def test_smaller_scores_are_brought_to_the_size_of_the_picture(path, upsample):
    rows = ["rrrrbbbb"] * 4 + ["bbbbrrrr"] * 4
    network = open_network(colour_network(path, colours=TRAIN, stride=4), upsample=upsample)
    assert network.label(painted(rows)).tolist() == named(rows)


def test_picture_is_brought_to_the_fixed_size_of_the_model(path):
    network = open_network(colour_network(path, colours=TRAIN, shape=(1, 3, 8, 4)))
    rows = ["rrbb", "rrbb"]
    assert network.label(painted(rows)).tolist() == named(rows)


def test_size_for_open_axes_can_be_chosen(path):
    """Stripes of one pixel vanish at half the width: the network saw their mean."""
    network = open_network(colour_network(path, colours=TRAIN), size=(1, 1))
    assert network.label(painted(["rrrb"])).tolist() != named(["rrrb"])


def test_normalisation_reaches_the_network(path):
    """Red less its mean of 1 is no longer red."""
    shifted = {0: (0.0, 0.0, 0.0), 13: (-1.0, 0.0, 1.0)}
    network = open_network(colour_network(path, colours=shifted), mean=(1.0, 0.0, 0.0))
    assert network.label(painted(["rb"])).tolist() == named(["rb"])


def test_one_of_several_outputs_is_chosen_by_name(path, three):
    rank_4 = ["n", 3, "h", "w"]
    nodes = [helper.make_node("Identity", ["image"], [name]) for name in ("out", "aux")]
    model = save(path, nodes, [tensor("image", [1, 3, "h", "w"])], [tensor("out", rank_4), tensor("aux", rank_4)])
    with pytest.raises(InputError, match=r"network\.onnx: output: none is chosen; there are: out, aux"):
        open_network(model, classes=three)
    with pytest.raises(InputError, match=r"network\.onnx: output: there is no main; there are: out, aux"):
        open_network(model, classes=three, output="main")
    found = open_network(model, classes=three, output="aux").label(painted(["rb"]))
    assert found.tolist() == [[0, 2]]  # the brightest channel


# What is refused when the model is opened:


def test_file_that_is_no_model_is_one_line(path):
    path.write_bytes(b"no\nmodel")
    with pytest.raises(InputError, match=r"network\.onnx: is not a model that can be used: .*Protobuf") as caught:
        open_network(path)
    assert "\n" not in str(caught.value)


def test_missing_file_is_named(path):
    with pytest.raises(InputError, match=r"network\.onnx: model: is not a file"):
        open_network(path)


def test_model_of_two_inputs_is_refused(path):
    node = helper.make_node("Add", ["left", "right"], ["answer"])
    shape = [1, 19, "h", "w"]
    model = save(path, [node], [tensor("left", shape), tensor("right", shape)], [tensor("answer", shape)])
    with pytest.raises(InputError, match=r"network\.onnx: inputs: there are 2 \(left, right\); one image is needed"):
        open_network(model)


@pytest.mark.parametrize(
    ("shape", "kind"),
    [
        ((1, 1, "h", "w"), TensorProto.FLOAT),
        ((2, 3, 8, 8), TensorProto.FLOAT),
        ((3, 8, 8), TensorProto.FLOAT),
        ((1, 3, 8, 8), TensorProto.FLOAT16),
        ((1, 3, 8, 8), TensorProto.UINT8),
    ],
)
def test_input_that_is_no_image_is_refused(path, shape, kind):
    model = identity(path, shape, kind=kind)
    with pytest.raises(InputError, match=r"network\.onnx: image: is tensor\(.*\); float \(1, 3, H, W\) is needed"):
        open_network(model)


def test_wrong_layout_is_refused(path):
    model = colour_network(path, colours=TRAIN, shape=(1, 8, 8, 3), nhwc=True)
    with pytest.raises(InputError, match=r"image: is tensor\(float\) of shape \(1, 8, 8, 3\); float \(1, 3, H, W\)"):
        open_network(model, layout="nchw")


def test_size_other_than_the_fixed_one_is_refused(path):
    model = colour_network(path, colours=TRAIN, shape=(1, 3, 8, 4))
    with pytest.raises(InputError, match=r"network\.onnx: image: its height is fixed to 8; 16 was expected"):
        open_network(model, size=(4, 16))
    open_network(model, size=(4, 8))


@pytest.mark.parametrize(
    ("count", "classes", "told"),
    [
        (3, "cityscapes", "scores 3 classes; cityscapes has 19"),
        (20, "cityscapes", "scores 20 classes; cityscapes has 19"),
        (150, "cityscapes", "scores 150 classes; cityscapes has 19; --classes ade20k has so many"),
        (34, "cityscapes", "scores 34 classes; cityscapes has 19; --classes cityscapes-ids has so many"),
        (33, "cityscapes-ids", "scores 33 classes; cityscapes-ids has 34"),
        (64, "mapillary", "scores 64 classes; mapillary has 66"),
        (149, "ade20k", "scores 149 classes; ade20k has 150"),
    ],
)
def test_number_of_classes_must_fit(path, count, classes, told):
    model = scores_of(path, count)
    with pytest.raises(InputError) as caught:
        open_network(model, classes=classes)
    assert str(caught.value) == f"{path}: answer: {told}"


@pytest.mark.parametrize(
    ("count", "classes"), [(19, "cityscapes"), (34, "cityscapes-ids"), (65, "mapillary"), (66, "mapillary")]
)
def test_numbers_of_classes_that_fit(path, count, classes):
    assert open_network(scores_of(path, count), classes=classes).class_map.name == classes


def scores_of(path, count):
    """A model that scores so many classes."""
    weight = numpy_helper.from_array(np.zeros((count, 3, 1, 1), np.float32), "weight")
    node = helper.make_node("Conv", ["image", "weight"], ["answer"])
    return save(path, [node], [tensor("image", [1, 3, "h", "w"])], [tensor("answer", [1, count, "h", "w"])], [weight])


def test_answer_of_other_rank_or_type_is_refused(path):
    node = helper.make_node("Cast", ["image"], ["answer"], to=TensorProto.INT64)
    outputs = [tensor("answer", [1, 3, "h", "w"], TensorProto.INT64)]
    model = save(path, [node], [tensor("image", [1, 3, "h", "w"])], outputs)
    with pytest.raises(InputError, match=r"answer: is integer of shape \(1, 3, h, w\); float scores with 4 axes"):
        open_network(model)


# What only shows when the network runs:


def test_open_number_of_classes_is_checked_when_it_is_known(path):
    shape = helper.make_tensor("shape", TensorProto.INT64, [4], [1, -1, 1, 1])
    node = helper.make_node("Reshape", ["image", "shape"], ["answer"])
    outputs = [tensor("answer", [1, "classes", 1, 1])]
    network = open_network(save(path, [node], [tensor("image", [1, 3, "h", "w"])], outputs, [shape]))
    with pytest.raises(InputError, match=r"network\.onnx: answer: scores 6 classes; cityscapes has 19"):
        network.label(painted(["rb"]))


def test_ids_outside_of_the_set_are_refused(path):
    network = open_network(colour_network(path, classes=34, colours={7: (1, 0, 0), 26: (0, 0, 1)}, ids=np.int64))
    with pytest.raises(
        InputError, match=r"network\.onnx: answer: gives the id 26, which is not one of the 19 classes of cityscapes"
    ):
        network.label(painted(["rb"]))


def test_scores_that_are_not_a_number_are_refused(path, three):
    nodes = [helper.make_node("Log", ["image"], ["answer"])]
    model = save(path, nodes, [tensor("image", [1, 3, "h", "w"])], [tensor("answer", [1, 3, "h", "w"])])
    network = open_network(model, classes=three, mean=(0.5, 0.5, 0.5))
    with pytest.raises(InputError, match="answer: gives scores that are not a number"):
        network.label(painted(["rb"]))


def test_failure_of_the_network_is_one_line(path, three):
    """A model that says it takes any size, but does not."""
    shape = helper.make_tensor("shape", TensorProto.INT64, [4], [1, 3, 2, 2])
    node = helper.make_node("Reshape", ["image", "shape"], ["answer"])
    model = save(path, [node], [tensor("image", [1, 3, "h", "w"])], [tensor("answer", [1, 3, 2, 2])], [shape])
    network = open_network(model, classes=three)
    with pytest.raises(InputError, match=r"network\.onnx: image: the network failed: .*Reshape") as caught:
        network.label(painted(["rrrb"] * 4))
    assert "\n" not in str(caught.value)


def test_picture_too_large_for_any_network_is_refused(path):
    network = open_network(colour_network(path, colours=TRAIN), size=(8192, 8193))
    with pytest.raises(InputError, match="image: an image of 8192 x 8193 has more than 67108864 pixels"):
        network.label(painted(["rb"]))
