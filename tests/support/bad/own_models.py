"""Bad models of one's own: files, classes, and what they do."""

import textwrap
from pathlib import Path

from support.bad import small
from support.bad.case import Bad, Kind, table

ADDED = "run base.yaml --logs logs --out out --grids grids --no-pictures --device cpu --workers 1 --row Mine --model"
HERE = f"{ADDED} mine.py:Mine --own-models here"
APART = f"{ADDED} mine.py:Mine"
IMPORTS = "import torch\nfrom semgrid_eval import Config, Model, Network, NetworkSettings, one_hot\n"


def whole() -> None:
    """Write good logs, a matrix, and a good model."""
    small.whole()
    Path("base.yaml").write_bytes(f"defaults: {{{small.WINDOW}}}\nrows: [{{name: a, model: newest}}]\n".encode())
    Path("mine.py").write_bytes(_model("return one_hot(batch.past[:, 0, -1])"))


def _model(answer: str, *more: str) -> bytes:
    """Write a model with this body of `predict`, and more lines in its class."""
    lines = [f"    {line}" for line in (*more, "def predict(self, batch):", f"    {answer}")]
    return "\n".join([IMPORTS, "class Mine(Model):", *lines, ""]).encode()


def _network(answer: str, *more: str) -> bytes:
    """Write a network of one layer with this body of `forward`, and more in its class."""
    body = f"""
    class Settings(NetworkSettings):
        pass

    def __init__(self, settings, given):
        super().__init__(settings, given)
        self.weight = torch.nn.Parameter(torch.zeros(10))

    def forward(self, batch):
        grids = self.weight[None, :, None, None].expand(len(batch.past), 10, *batch.past.shape[-2:])
        {answer}
    """
    lines = textwrap.dedent(body).splitlines() + list(more)
    return "\n".join([IMPORTS, "class Mine(Network):", *(f"    {line}" for line in lines), ""]).encode()


def _classes(*lines: str) -> bytes:
    return "\n".join([IMPORTS, *lines, ""]).encode()


def _settings(*lines: str) -> bytes:
    return _model("return one_hot(batch.past[:, 0, -1])", *lines)


GOOD = "return one_hot(batch.past[:, 0, -1])"
ZEROS = "return torch.zeros(len(batch.past), {})"
FILES = {
    "a syntax error": b"def half(",
    "bytes that are no text": b"\xff\xfe\x00",
    "nothing": b"",
    "an import that is not there": _classes("import nowhere_to_be_found", "class Mine(Model):", "    pass"),
    "an import from beside it that is not there": _classes("from beside import SIZE", "class Mine(Model):", "    pass"),
    "it ends the process while it is loaded": _classes("class Mine(Model):", "    pass", "raise SystemExit(3)"),
    "no such class": _classes("class Other(Model):", "    pass"),
    "a number where the class should be": _classes("Mine = 7"),
    "a class without base": _classes("class Mine:", "    pass"),
    "a class with a base of torch alone": _classes("class Mine(torch.nn.Module):", "    pass"),
    "Settings without base": _settings("class Settings:", "    pass"),
    "Settings of a network that are not a network's": _classes(
        "class Mine(Network):", "    class Settings(Config):", "        pass"
    ),
    "Settings with a value that is needed": _settings("class Settings(Config):", "    width: int"),
    "files that are a list": _settings('files = ["mine.pt"]'),
    "a file that is declared and not there": _settings('files = ("mine.pt",)'),
    "baseline that is a word": _settings('baseline = "no"'),
    "no predict": _classes("class Mine(Model):", "    pass"),
    "an error while it is made": _settings(
        "def __init__(self, settings, given):", "    raise ValueError('no weights')"
    ),
    "an error in fit": _settings("def fit(self, windows):", "    raise OSError('no room')"),
    "an error in predict": _model("raise KeyError('key')"),
    "an error of several lines": _model("raise ValueError('one\\ntwo')"),
    "an error in check": _settings("@classmethod", "def check(cls, settings, given):", "    given.unheard_of"),
    "an answer that is a number": _model("return 3"),
    "an answer of numpy": _model("return batch.past.numpy()"),
    "an answer of 8 classes": _model(ZEROS.format("8, 128, 128")),
    "an answer of 11 classes": _model(ZEROS.format("11, 128, 128")),
    "an answer of another size": _model(ZEROS.format("10, 128, 64")),
    "an answer without batch": _model("return torch.zeros(10, 128, 128)"),
    "an answer of whole numbers": _model(ZEROS.format("10, 128, 128, dtype=torch.int64")),
    "an answer that is not a number": _model(ZEROS.format("10, 128, 128") + " / 0"),
    "a certainty of 3": _model("return 3 * one_hot(batch.past[:, 0, -1])"),
    "a certainty below 0": _model("return one_hot(batch.past[:, 0, -1]) - 2"),
    "a network without forward": _classes(
        "class Mine(Network):",
        "    class Settings(NetworkSettings):",
        "        pass",
        "    def __init__(self, settings, given):",
        "        super().__init__(settings, given)",
        "        self.layer = torch.nn.Linear(1, 1)",
    ),
    "a network without parameters": _classes(
        "class Mine(Network):", "    def forward(self, batch):", "        " + ZEROS.format("10, 128, 128")
    ),
    "a network whose answer has another size": _network("return grids[..., :64]"),
    "a network whose loss is a word": _network("return grids", "def loss(self, logits, batch):", "    return 'small'"),
    "a network whose loss has many numbers": _network(
        "return grids", "def loss(self, logits, batch):", "    return logits"
    ),
    "a network whose loss is not a number": _network("return grids / 0"),
    "a network without optimizer": _network("return grids", "def optimizer(self):", "    return None"),
}
ENDINGS = {
    "it ends its process": _model("import os; os._exit(3)"),
    "it uses up its memory": _model("torch.zeros(1 << 42)"),
}

MODEL = Kind(
    "Models of one's own",
    "What `mine.py` is, in `run MATRIX --model mine.py:Mine`.",
    whole,
    (
        *table(HERE, "mine.py", FILES),
        *(Bad(words, APART, {"mine.py": text}) for words, text in ENDINGS.items()),
        Bad("no file", HERE, spoil=lambda: Path("mine.py").unlink()),
        Bad("a folder", HERE, spoil=lambda: (Path("mine.py").unlink(), Path("mine.py").mkdir())),
        Bad("`--model mine.txt:Mine`", f"{ADDED} mine.txt:Mine", {"mine.txt": b"text"}),
        Bad("`--model mine.py`, without a class", f"{ADDED} mine.py"),
        Bad("`--model mine.py:`, with an empty class", f"{ADDED} mine.py:"),
        Bad("`--model fues`", f"{ADDED} fues"),
    ),
)
