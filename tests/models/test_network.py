"""The encoder-decoder: the paper's size, its parts by hand, constants of the presets, and its file."""

import pytest
import torch
from safetensors.torch import save_file
from support.recordings import random_recording
from torch import nn
from torch.nn import functional as F
from torch.utils.flop_counter import FlopCounterMode

from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError, InputError
from semgrid_eval.models.network import (
    EncoderDecoder,
    NetworkConfig,
    NetworkPredictor,
    check_grid_size,
    load_network,
    one_hot_planes,
    save_network,
    seeded_network,
)
from semgrid_eval.windows.data import select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import Window

SMALL = NetworkConfig(depth=3, features=4)


def past(seed=0, *, batch=2, sensors=1, inputs=2, size=16):
    generator = torch.Generator().manual_seed(seed)
    shape = (batch, sensors, inputs, size, size)
    return torch.randint(0, CLASS_COUNT, shape, generator=generator, dtype=torch.uint8)


def network(config=SMALL, *, grids=2, preset="keras", seed=0):
    return seeded_network(config, grids=grids, preset=preset, seed=seed)


def test_default_network_has_the_papers_size():
    default = network(NetworkConfig()).eval()
    assert default.parameter_count == pytest.approx(1.9e6, rel=0.02)
    with FlopCounterMode(display=False) as counter, torch.inference_mode():
        default(past(batch=1, size=32))
    multiply_adds = counter.get_total_flops() / 2 * (128 * 128) / (32 * 32)
    assert multiply_adds == pytest.approx(7.5e9, rel=0.02)


@pytest.mark.parametrize(("depth", "bottleneck"), [(2, (8, 8, 8)), (3, (16, 4, 4)), (4, (32, 2, 2))])
def test_depth_counts_encoder_blocks_with_pooling_between_them(depth, bottleneck):
    net = network(NetworkConfig(depth=depth, features=4)).eval()
    seen = []
    net.encoder[-1].register_forward_hook(lambda module, inputs, output: seen.append(tuple(output.shape[1:])))
    assert net(past()).shape == (2, CLASS_COUNT, 16, 16)
    assert seen == [bottleneck]
    assert len(net.decoder) == depth - 1


def test_network_equals_its_description_written_down_step_by_step():
    net = network(NetworkConfig(depth=2, features=4)).eval()
    for value in net.state_dict().values():  # so that normalisation and biases do something
        if value.is_floating_point():
            value += 0.1 * torch.rand(value.shape, generator=torch.Generator().manual_seed(value.numel()))
    w = net.state_dict()

    def block(x, name, step, activate):
        for i in (0, step):
            x = F.conv2d(x, w[f"{name}.{i}.weight"], padding=1)
            n = f"{name}.{i + 1}"
            mean, variance = w[f"{n}.running_mean"][:, None, None], w[f"{n}.running_var"][:, None, None]
            x = (x - mean) / (variance + 1e-3).sqrt() * w[f"{n}.weight"][:, None, None] + w[f"{n}.bias"][:, None, None]
            x = activate(x)
        return x

    grids = past()
    x = F.one_hot(grids.long(), CLASS_COUNT).permute(0, 1, 2, 5, 3, 4).flatten(1, 3).float()
    skip = block(x, "encoder.0", 3, torch.relu)
    x = block(F.max_pool2d(skip, 2), "encoder.1", 3, torch.relu)
    x = x.repeat_interleave(2, dim=2).repeat_interleave(2, dim=3)
    kernel, y = w["up.0.convolution.weight"], torch.zeros(2, 4, 17, 17)
    x = F.pad(x, (0, 1, 0, 1))  # Keras pads an even kernel below and on the right
    y = sum(
        torch.einsum("oi,bihw->bohw", kernel[:, :, r, c], x[:, :, r : r + 16, c : c + 16])
        for r in range(2)
        for c in range(2)
    )
    x = torch.cat([skip, y + w["up.0.convolution.bias"][:, None, None]], dim=1)
    x = block(x, "decoder.0", 2, lambda value: value)
    x = F.conv2d(x, w["narrow.weight"], w["narrow.bias"], padding=1)
    x = F.conv2d(x, w["classify.weight"], w["classify.bias"])
    torch.testing.assert_close(net(grids), x, rtol=1e-4, atol=1e-4)


def test_dropout_acts_in_training_alone_and_halves_the_bottleneck():
    net = network()
    seen = []
    net.dropout.register_forward_hook(lambda module, inputs, output: seen.append((inputs[0] != 0, output != 0)))
    net.train()(past())
    before, after = seen[0]
    assert 0.35 < (after.sum() / before.sum()).item() < 0.65
    net.eval()
    assert torch.equal(net(past()), net(past()))


def test_decoder_activation_is_a_switch():
    linear, relu = (network(NetworkConfig(depth=2, features=4, decoder_activation=name)) for name in ("linear", "relu"))
    assert not any(isinstance(layer, nn.ReLU) for layer in linear.decoder.modules())
    assert sum(isinstance(layer, nn.ReLU) for layer in relu.decoder.modules()) == 2
    assert sum(isinstance(layer, nn.ReLU) for layer in linear.encoder.modules()) == 4


def test_presets_differ_in_normalisation_and_initial_weights():
    keras, torches = network(preset="keras"), network(preset="torch")
    constants = [
        {(layer.eps, layer.momentum) for layer in net.modules() if isinstance(layer, nn.BatchNorm2d)}
        for net in (keras, torches)
    ]
    assert constants == [{(1e-3, 0.01)}, {(1e-5, 0.1)}]
    limit = (6 / (16 * 9 + 16 * 9)) ** 0.5  # Glorot's uniform distribution of encoder.2's second convolution
    weight = keras.encoder[2][3].weight
    assert limit * 0.95 < weight.abs().max() <= limit
    assert keras.classify.bias.abs().max() == 0
    assert torches.classify.bias.abs().max() > 0


def test_same_seed_gives_same_weights_and_leaves_the_global_generator_alone():
    state = torch.get_rng_state()
    first, second, other = network(seed=1), network(seed=1), network(seed=2)
    assert torch.equal(torch.get_rng_state(), state)
    assert torch.equal(first.narrow.weight, second.narrow.weight)
    assert not torch.equal(first.narrow.weight, other.narrow.weight)


def test_one_hot_planes_put_each_grids_classes_side_by_side():
    grids = past()[:, 0]
    planes = one_hot_planes(grids, torch.bfloat16)
    expected = F.one_hot(grids.long(), CLASS_COUNT).permute(0, 1, 4, 2, 3).flatten(1, 2)
    assert planes.dtype == torch.bfloat16
    assert planes.is_contiguous(memory_format=torch.channels_last)
    assert torch.equal(planes.long(), expected)


def test_predictor_gives_probabilities():
    data = stack_recordings([random_recording(0)], cell_m=0.5)
    batch = select_windows(data, [Window(0, (0, 5), 10)], sensors=["full"]).batch(slice(0, 1))
    for dtype in (torch.float32, torch.bfloat16):
        scores = NetworkPredictor(network(), dtype)(batch)
        assert scores.dtype == torch.float32
        torch.testing.assert_close(scores.sum(dim=1), torch.ones(1, 16, 16))


@pytest.mark.parametrize("preset", ["keras", "torch"])
def test_file_gives_the_same_network_back(tmp_path, preset):
    config = NetworkConfig(depth=2, features=4, decoder_activation="relu")
    net = network(config, grids=4, preset=preset).eval()
    save_network(net, tmp_path / "a.safetensors")
    save_network(net, tmp_path / "b.safetensors")
    back = load_network(tmp_path / "a.safetensors")
    assert (back.config, back.grids, back.preset) == (config, 4, preset)
    assert torch.equal(back(past(inputs=4)), net(past(inputs=4)))
    assert (tmp_path / "a.safetensors").read_bytes() == (tmp_path / "b.safetensors").read_bytes()


def test_damaged_missing_or_foreign_files_are_named(tmp_path):
    good, cut, foreign = (tmp_path / f"{name}.safetensors" for name in ("good", "cut", "foreign"))
    save_network(network(), good)
    cut.write_bytes(good.read_bytes()[:-100])
    save_file({"a": torch.zeros(1)}, foreign)
    with pytest.raises(InputError, match=r"cut\.safetensors: cannot be read"):
        load_network(cut)
    with pytest.raises(InputError, match=r"foreign\.safetensors: holds no network"):
        load_network(foreign)
    with pytest.raises(InputError, match=r"none\.safetensors: cannot be read"):
        load_network(tmp_path / "none.safetensors")


def test_impossible_configurations_are_refused():
    with pytest.raises(ConfigError, match="features must be even"):
        parse_config(NetworkConfig, {"features": 7})
    with pytest.raises(ConfigError, match="depth 4 needs grids of a multiple of 8 cells, not 100 x 128"):
        check_grid_size(NetworkConfig(depth=4), 100, 128)
    check_grid_size(NetworkConfig(depth=4), 104, 128)


def test_one_network_takes_only_its_number_of_grids():
    with pytest.raises(RuntimeError):
        EncoderDecoder(SMALL, grids=3)(past())
