"""Weights on disk: what is read back is what was written, and other files are named."""

import pytest
import torch
from safetensors.torch import save_file
from support.models import given, network

from semgrid_eval.errors import InputError
from semgrid_eval.models.checkpoint import load_weights, read_header, save_weights
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
