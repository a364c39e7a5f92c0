"""Weights on disk: what is read back is what was written, and other files are named."""

import pytest
import torch
from safetensors.torch import save_file
from support.models import given, network

from semgrid_eval.errors import InputError, ResultError
from semgrid_eval.models.checkpoint import (
    CHECKPOINT_FILE,
    HISTORY_FILE,
    WEIGHTS_FILE,
    EpochRecord,
    TrainingFolder,
    find_finished,
    load_weights,
    read_header,
    save_weights,
)
from semgrid_eval.models.encoder_decoder import EncoderDecoder


def small(seed=0, **settings):
    return network(EncoderDecoder, given(inputs=4), seed, depth=2, features=4, **settings).eval()


@pytest.mark.parametrize("constants", ["keras", "torch"])
def test_file_gives_the_same_weights_back(tmp_path, constants):
    first, second = small(0, constants=constants), small(1, constants=constants)
    save_weights(first, tmp_path / "a.safetensors", note="x")
    save_weights(first, tmp_path / "b.safetensors", note="x")
    assert (tmp_path / "a.safetensors").read_bytes() == (tmp_path / "b.safetensors").read_bytes()
    load_weights(second, tmp_path / "a.safetensors")
    state = second.state_dict()
    assert all(torch.equal(value, state[name]) for name, value in first.state_dict().items())
    header = read_header(tmp_path / "a.safetensors")
    assert (header["model"], header["note"]) == ("EncoderDecoder", "x")
    assert header["settings"] == first.settings.model_dump(mode="json")
    assert header["given"]["inputs"] == 4


def test_layers_may_share_their_weights(tmp_path):
    net = small()
    net.encoder[1][3] = net.decoder[0][0] = torch.nn.Conv2d(8, 8, 3)
    save_weights(net, tmp_path / "a.safetensors")
    load_weights(net, tmp_path / "a.safetensors")
    assert net.encoder[1][3] is net.decoder[0][0]


def test_damaged_missing_or_foreign_files_are_named(tmp_path):
    good, cut, foreign = (tmp_path / f"{name}.safetensors" for name in ("good", "cut", "foreign"))
    save_weights(small(), good)
    cut.write_bytes(good.read_bytes()[:-100])
    save_file({"a": torch.zeros(1)}, foreign)
    with pytest.raises(InputError, match=r"cut\.safetensors: is damaged: its content does not match its seal"):
        load_weights(small(), cut)
    with pytest.raises(InputError, match=r"foreign\.safetensors: is damaged, or of another version: it has no seal"):
        load_weights(small(), foreign)
    with pytest.raises(InputError, match=r"good\.safetensors: belongs to another id \(-, not me\)"):
        load_weights(small(), good, owner="me")
    with pytest.raises(InputError, match=r"none\.safetensors: cannot be read"):
        load_weights(small(), tmp_path / "none.safetensors")
    wider = network(EncoderDecoder, given(inputs=4), depth=2, features=8)
    with pytest.raises(InputError, match=r"good\.safetensors: has no weights of this network"):
        load_weights(wider, good)


def finished(folder, key):
    folder.mkdir(parents=True)
    TrainingFolder(folder, key).finish(small(), [EpochRecord(1, 2, 0.1, 0.5, None, 1.0)])


def test_a_finished_training_is_found_by_its_key_under_any_name(tmp_path):
    assert find_finished(tmp_path / "none", "mine") is None
    finished(tmp_path / "a", "other")
    finished(tmp_path / "b", "mine")
    assert find_finished(tmp_path, "mine") == tmp_path / "b"
    assert find_finished(tmp_path, "third") is None


@pytest.mark.parametrize("file", [WEIGHTS_FILE, HISTORY_FILE])
def test_a_training_that_is_damaged_or_not_finished_is_not_found(tmp_path, file):
    finished(tmp_path / "a", "mine")
    whole = (tmp_path / "a" / file).read_bytes()
    (tmp_path / "a" / file).write_bytes(whole[:-3])
    assert find_finished(tmp_path, "mine") is None
    (tmp_path / "a" / file).unlink()
    (tmp_path / "a" / CHECKPOINT_FILE).touch()
    assert find_finished(tmp_path, "mine") is None


def test_of_another_training_the_weights_are_not_read(tmp_path):
    finished(tmp_path / "a", "other")
    (tmp_path / "a" / WEIGHTS_FILE).write_bytes(b"damaged")
    with pytest.raises(ResultError, match=r"history\.csv: belongs to another id \(other, not mine\)"):
        TrainingFolder(tmp_path / "a", "mine").is_complete()
