"""Which device ONNX Runtime works on; it is replaced by one that has a GPU where the test is about that."""

import numpy as np
import pytest

pytest.importorskip("onnxruntime", reason="the extra 'segment' is not installed")
pytest.importorskip("onnx", reason="onnx, which makes the models, is not installed")

import onnxruntime
from support.onnx_models import colour_network

from semgrid_eval.errors import ConfigError
from semgrid_eval.segmentation.session import open_model

CPU, CUDA = "CPUExecutionProvider", "CUDAExecutionProvider"


@pytest.fixture
def path(tmp_path):
    return colour_network(tmp_path / "network.onnx", colours={0: (1.0, 0.0, 0.0)})


class Session:
    """A session that uses the providers that it was asked for, but for those that do not work."""

    broken: tuple[str, ...] = ()

    def __init__(self, path, settings, providers):
        self.asked = providers

    def get_providers(self):
        names = [each if isinstance(each, str) else each[0] for each in self.asked]
        return [name for name in names if name not in self.broken]


@pytest.fixture
def gpu(monkeypatch):
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: [CUDA, CPU])
    monkeypatch.setattr(onnxruntime, "InferenceSession", Session)


@pytest.mark.parametrize("device", ["auto", "cpu"])
def test_without_gpu_the_cpu_works(path, device):
    opened = open_model(path, device)
    assert opened.device == "cpu"
    (answer,) = opened.session.run(None, {"image": np.ones((1, 3, 2, 4), np.float32)})
    assert answer.shape == (1, 19, 2, 4)


@pytest.mark.parametrize(("device", "number"), [("auto", "0"), ("cuda", "0"), ("cuda:0", "0"), ("cuda:3", "3")])
def test_gpu_is_taken_where_there_is_one(gpu, path, device, number):
    opened = open_model(path, device)
    assert opened.device == f"cuda:{number}"
    (name, options), after = opened.session.asked
    assert (name, options["device_id"], after) == (CUDA, number, CPU)


def test_cpu_is_taken_where_it_is_asked_for(gpu, path):
    opened = open_model(path, "cpu")
    assert (opened.device, opened.session.asked) == ("cpu", [CPU])


def test_gpu_that_does_not_work_is_not_said_to(gpu, path, monkeypatch):
    """ONNX Runtime goes on without a provider whose libraries it does not find."""
    monkeypatch.setattr(Session, "broken", (CUDA,))
    assert open_model(path, "auto").device == "cpu"
    with pytest.raises(ConfigError, match=r"device: this ONNX Runtime cannot use 'cuda:1'; install onnxruntime-gpu"):
        open_model(path, "cuda:1")


@pytest.mark.parametrize("device", ["gpu", "cuda:", "cuda:x", "CUDA", ""])
def test_unknown_device_is_refused(path, device):
    with pytest.raises(ConfigError, match=r"device: there is no device '.*' for ONNX Runtime; use auto, cpu or cuda"):
        open_model(path, device)
