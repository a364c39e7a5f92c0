"""Device and precision by name, and seeds that leave no trace."""

import pytest
import torch

from semgrid_eval.errors import ConfigError
from semgrid_eval.models import device as device_module
from semgrid_eval.models.device import (
    choose_device,
    choose_precision,
    cpu_facts,
    cpu_has_bf16,
    is_out_of_memory,
    seeded,
    settle_process,
    visible_gpus,
)

CPU = torch.device("cpu")


def test_auto_takes_cuda_where_there_is_one():
    assert choose_device("auto").type == ("cuda" if torch.cuda.is_available() else "cpu")
    assert choose_device("cpu") == CPU


@pytest.mark.parametrize("name", ["gpu", "cuda:99", "hpu", "meta"])
def test_device_that_is_not_there_is_a_config_error(name):
    with pytest.raises(
        ConfigError, match=f"device: there is no device '{name}' on this machine; use auto, cpu or cuda"
    ):
        choose_device(name)


def test_asked_precision_is_taken_and_auto_follows_the_cpu():
    assert choose_precision("float32", CPU) == torch.float32
    assert choose_precision("bf16", CPU) == torch.bfloat16
    assert choose_precision("auto", CPU) == (torch.bfloat16 if cpu_has_bf16() else torch.float32)


@pytest.mark.parametrize(("capability", "expected"), [((7, 5), torch.float32), ((8, 0), torch.bfloat16)])
def test_auto_follows_what_a_gpu_multiplies_natively(monkeypatch, capability, expected):
    monkeypatch.setattr(torch.cuda, "get_device_capability", lambda device: capability)
    assert choose_precision("auto", torch.device("cuda:1")) == expected
    assert choose_precision("bf16", torch.device("cuda:1")) == torch.bfloat16


@pytest.mark.parametrize(("listed", "expected"), [(None, ["0", "1"]), ("3,GPU-7", ["3", "GPU-7"]), ("", ["0", "1"])])
def test_gpus_are_named_as_this_process_sees_them(monkeypatch, listed, expected):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    if listed is not None:
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", listed)
    assert visible_gpus() == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("flags\t\t: fpu avx512_bf16 x\n", True),
        ("flags : fpu amx_bf16\n", True),
        ("flags : avx512f\n", False),
        ("", False),
    ],
)
def test_bf16_is_read_from_the_cpus_flags(tmp_path, monkeypatch, text, expected):
    (tmp_path / "cpuinfo").write_text(text)
    monkeypatch.setattr(device_module, "_CPU_FILE", tmp_path / "cpuinfo")
    monkeypatch.setattr(device_module, "cpu_facts", cpu_facts.__wrapped__)
    assert cpu_has_bf16() is expected


def test_system_without_cpu_flags_has_no_bf16(tmp_path, monkeypatch):
    monkeypatch.setattr(device_module, "_CPU_FILE", tmp_path / "none")
    monkeypatch.setattr(device_module, "cpu_facts", cpu_facts.__wrapped__)
    assert cpu_has_bf16() is False


def test_seeded_block_repeats_and_leaves_the_generator_as_it_was():
    state = torch.get_rng_state()
    with seeded(5, CPU):
        first = torch.rand(3)
    with seeded(5, CPU):
        assert torch.equal(torch.rand(3), first)
    assert torch.equal(torch.get_rng_state(), state)


def test_settling_a_process_makes_cuda_repeatable_and_changes_no_result(monkeypatch):
    monkeypatch.setattr(torch.backends.cudnn, "deterministic", False)
    monkeypatch.setattr(torch.backends.cudnn, "allow_tf32", True)
    before = torch.ones(1 << 20).sum()
    choose_device("cpu")
    assert not torch.backends.cudnn.deterministic  # choosing sets nothing
    settle_process()
    assert torch.backends.cudnn.deterministic
    assert not torch.backends.cudnn.allow_tf32
    assert torch.ones(1 << 20).sum() == before


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (torch.OutOfMemoryError("CUDA out of memory"), True),
        (MemoryError(), True),
        (RuntimeError("DefaultCPUAllocator: can't allocate memory"), True),
        (RuntimeError("shapes do not match"), False),
        (ValueError("can't allocate memory"), False),
    ],
)
def test_a_lack_of_memory_is_told_from_other_errors(error, expected):
    assert is_out_of_memory(error) is expected
