"""What a training needs at least, worked out without memory."""

import pytest
import torch
from support.models import given, network

from semgrid_eval.config import parse_config
from semgrid_eval.errors import InputError
from semgrid_eval.models.encoder_decoder import EncoderDecoder, EncoderDecoderSettings
from semgrid_eval.models.memory import least_bytes, memory_bytes, require_room
from semgrid_eval.models.network import Network, NetworkSettings

CPU = torch.device("cpu")


def settings_of(kind, batch, **settings):
    return parse_config(kind, {**settings, "training": {"batch": batch, "updates_per_epoch": 1}})


def test_weights_and_activations_are_those_of_the_network():
    settings = settings_of(EncoderDecoderSettings, 1, depth=2, features=4)
    made = network(EncoderDecoder, given(size=16), depth=2, features=4)
    weights = sum(each.numel() for each in made.parameters())
    one, two = (
        least_bytes(
            EncoderDecoder, settings_of(EncoderDecoderSettings, batch, depth=2, features=4), given(size=16), config
        )
        for batch, config in ((1, settings.training), (2, settings_of(EncoderDecoderSettings, 2).training))
    )
    # By hand, 16 x 16 cells: two convolutions and normalisations of 4 channels above and two below, as many of 8 with
    # a quarter of the cells, their dropout, the way up of one more line and column, and the narrow end.
    cells = 8 * 4 * 256 + 4 * 8 * 64 + 8 * 64 + 4 * 256 + 2 * 256 + 10 * 256
    assert two - one == 2 * cells + 8
    assert one == 3 * 4 * weights + 2 * cells + 8


@pytest.mark.parametrize(("batch", "depth", "features"), [(1 << 16, 3, 512), (1, 6, 512)])
def test_what_is_beyond_all_memory_is_refused_and_not_allocated(batch, depth, features):
    settings = settings_of(EncoderDecoderSettings, batch, depth=depth, features=features)
    with pytest.raises(InputError, match=r"its training needs \d+ GiB at least, and cpu has \d+ GiB: batch"):
        require_room(EncoderDecoder, settings, given(size=128), CPU)


def test_the_papers_network_fits():
    require_room(EncoderDecoder, settings_of(EncoderDecoderSettings, 4), given(size=128), CPU)


def test_a_network_that_needs_real_memory_is_not_looked_at_and_draws_nothing():
    class Real(Network):
        def __init__(self, settings, given):
            super().__init__(settings, given)
            self.value = torch.rand(1).item()

    state = torch.random.get_rng_state()
    require_room(Real, settings_of(NetworkSettings, 4), given(), CPU)
    assert torch.equal(torch.random.get_rng_state(), state)


def test_memory_is_that_of_this_machine():
    assert 1 << 28 < memory_bytes(CPU) < 1 << 50
