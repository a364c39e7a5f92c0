"""The encoder-decoder: the paper's size, its parts by hand, constants of the presets, and its file."""

import pytest
import torch
from support.models import given
from support.models import network as untrained
from torch import nn
from torch.nn import functional as F
from torch.utils.flop_counter import FlopCounterMode

from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.models.encoder_decoder import EncoderDecoder, EncoderDecoderSettings
from semgrid_eval.models.model import parameter_count
from semgrid_eval.models.network import input_planes


def past(seed=0, *, batch=2, sensors=1, inputs=2, size=16):
    generator = torch.Generator().manual_seed(seed)
    shape = (batch, sensors, inputs, size, size)
    return torch.randint(0, CLASS_COUNT, shape, generator=generator, dtype=torch.uint8)


def network(*, inputs=2, seed=0, depth=3, features=4, **settings):
    return untrained(EncoderDecoder, given(inputs=inputs), seed, depth=depth, features=features, **settings)


def logits(net, grids):
    return net.from_planes(input_planes(grids))


def test_default_network_has_the_papers_size():
    default = untrained(EncoderDecoder).eval()
    assert parameter_count(default) == pytest.approx(1.9e6, rel=0.02)
    with FlopCounterMode(display=False) as counter, torch.inference_mode():
        logits(default, past(batch=1, size=32))
    multiply_adds = counter.get_total_flops() / 2 * (128 * 128) / (32 * 32)
    assert multiply_adds == pytest.approx(7.5e9, rel=0.02)


@pytest.mark.parametrize(("depth", "bottleneck"), [(2, (8, 8, 8)), (3, (16, 4, 4)), (4, (32, 2, 2))])
def test_depth_counts_encoder_blocks_with_pooling_between_them(depth, bottleneck):
    net = network(depth=depth, features=4).eval()
    seen = []
    net.encoder[-1].register_forward_hook(lambda module, inputs, output: seen.append(tuple(output.shape[1:])))
    assert logits(net, past()).shape == (2, CLASS_COUNT, 16, 16)
    assert seen == [bottleneck]
    assert len(net.decoder) == depth - 1


def test_network_equals_its_description_written_down_step_by_step():
    net = network(depth=2, features=4).eval()
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
    torch.testing.assert_close(logits(net, grids), x, rtol=1e-4, atol=1e-4)


def test_dropout_acts_in_training_alone_and_halves_the_bottleneck():
    net = network()
    seen = []
    net.dropout.register_forward_hook(lambda module, inputs, output: seen.append((inputs[0] != 0, output != 0)))
    logits(net.train(), past())
    before, after = seen[0]
    assert 0.35 < (after.sum() / before.sum()).item() < 0.65
    net.eval()
    assert torch.equal(logits(net, past()), logits(net, past()))


def test_decoder_activation_is_a_switch():
    linear, relu = (network(depth=2, features=4, decoder_activation=name) for name in ("linear", "relu"))
    assert not any(isinstance(layer, nn.ReLU) for layer in linear.decoder.modules())
    assert sum(isinstance(layer, nn.ReLU) for layer in relu.decoder.modules()) == 2
    assert sum(isinstance(layer, nn.ReLU) for layer in linear.encoder.modules()) == 4


def test_constants_differ_in_normalisation_and_initial_weights():
    keras, torches = network(constants="keras"), network(constants="torch")
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


def test_label_says_its_depth_and_features():
    assert EncoderDecoder.in_words(EncoderDecoderSettings(features=8)) == "encoder-decoder of depth 3, 8 features"


def test_impossible_configurations_are_refused():
    with pytest.raises(ConfigError, match="features: 7 is odd"):
        parse_config(EncoderDecoderSettings, {"features": 7})
    with pytest.raises(ConfigError, match="settings: depth 4 needs grids of a multiple of 8 cells, not 100 x 100"):
        EncoderDecoder.check(EncoderDecoderSettings(depth=4), given(size=100))
    EncoderDecoder.check(EncoderDecoderSettings(depth=4), given(size=104))


def test_one_network_takes_only_its_number_of_grids():
    with pytest.raises(RuntimeError):
        logits(network(inputs=3), past())
