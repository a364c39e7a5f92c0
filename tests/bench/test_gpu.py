"""Rates of a GPU, measured with the least of everything on the CPU."""

import time
from dataclasses import replace

import pytest
import torch

from semgrid_eval.bench import gpu
from semgrid_eval.bench.measurement import Measurement
from semgrid_eval.executors import InProcess

CPU = torch.device("cpu")


@pytest.mark.slow
def test_what_fails_is_told_and_the_rest_is_measured(monkeypatch):
    def fail(*_args, **_kwargs):
        raise RuntimeError("no compiler\nand more")

    monkeypatch.setattr(gpu, "_answers", fail)
    found = list(gpu.measure_gpu(gpu.SMOKE, CPU))
    told = [each for each in found if isinstance(each, str)]
    assert told == [f"answer, {name}: RuntimeError: no compiler" for name in ("float32", "tf32", "bf16")]
    rates = {each.what: each for each in found if isinstance(each, Measurement)}
    assert all(each.value > 0 for each in rates.values())
    assert {"trained by the package", "trained, eager", "trained, channels first", "trained, float32"} <= rates.keys()
    share = rates["trained, eager, of the product of matrices"]
    flops = gpu.flops_of_an_update(gpu.encoder_decoder(gpu.SMOKE.features), 1)
    best = rates["product of bf16 matrices, 64 rows"].value * 1e12 / flops
    assert share.value == pytest.approx(100 * rates["trained, eager"].value / best)


@pytest.mark.parametrize("way", [gpu.Way("eager", dtype=torch.float32), gpu.Way("first", channels_last=False)])
def test_a_way_trains(way, monkeypatch):
    networks = []
    made = gpu._network
    monkeypatch.setattr(gpu, "_network", lambda *given: networks.append(made(*given)) or networks[0])
    update = gpu.update_in(way, gpu.SMOKE, CPU)
    before = [value.clone() for value in networks[0].parameters()]
    update()
    assert any(not torch.equal(value, old) for value, old in zip(networks[0].parameters(), before, strict=True))


def test_settings_of_convolutions_are_put_back():
    cudnn = torch.backends.cudnn
    before = cudnn.deterministic, cudnn.benchmark, cudnn.allow_tf32
    with gpu._algorithms(gpu.Way("fast", any_algorithm=True, tf32=True)):
        assert (cudnn.deterministic, cudnn.benchmark, cudnn.allow_tf32) == (False, True, True)
    assert (cudnn.deterministic, cudnn.benchmark, cudnn.allow_tf32) == before


def test_who_begins_late_counts_nothing(monkeypatch):
    now_s = time.time()
    assert gpu.train_between((gpu.SMOKE, "cpu", now_s - 1, now_s + 1)) == 0.0
    late = replace(gpu.SMOKE, starting_s=0.0, together_s=0.1)
    monkeypatch.setattr(gpu, "Processes", lambda *_args, **_kwargs: InProcess())
    with pytest.raises(RuntimeError, match="did not train at the same time"):
        list(gpu._sharing(2, late, CPU))


def test_windows_of_all_processes_are_added(monkeypatch):
    monkeypatch.setattr(gpu, "Processes", lambda *_args, **_kwargs: InProcess())
    monkeypatch.setattr(gpu, "train_between", lambda item: 30.0)
    assert [each.value for each in gpu._sharing(2, gpu.SMOKE, CPU)] == [60.0]
