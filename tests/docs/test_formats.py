"""The page on formats is what the code says, and says something of every key."""

import re
import runpy

from mcap.reader import make_reader
from support.commands import run_command
from support.drawn_again import write_town_like
from support.pages import ROOT, text_of

from semgrid_eval.models.registry import MODELS, find_model


def test_the_page_is_what_would_be_made():
    made = runpy.run_path(str(ROOT / "tools" / "format_pages.py"))
    assert text_of("docs/formats.md") == made["page"](), "python tools/format_pages.py"


def test_every_key_of_a_matrix_has_a_line():
    made = runpy.run_path(str(ROOT / "tools" / "format_pages.py"))
    listed = [model for _, model in made["MATRIX"]]
    text = "".join(line for model in listed for line in made["keys"](model))
    models = {kind.Settings for kind in map(find_model, MODELS) if kind.Settings.model_fields}
    assert models <= {*listed, *(base for model in listed for base in model.__mro__)}
    for model in (*listed, *models):
        for key in model.model_fields:
            assert f"| `{key}` |" in text, (model, key)


def test_every_channel_and_record_of_a_log_and_of_a_played_one_has_a_line(tmp_path):
    logs, run, played = write_town_like(tmp_path / "logs"), tmp_path / "run", tmp_path / "played.mcap"
    matrix = tmp_path / "m.yaml"
    matrix.write_text("rows: [{name: BL-Table, model: table, window: {step_frames: 1, target_frame: null}}]\n")
    for words in (
        ["run", matrix, "--logs", logs, "--out", run],
        ["play", run, "BL-Table", "--logs", logs, "--out", played],
    ):
        ended = run_command(list(map(str, words)))
        assert ended.code == 0, ended.err
    told = dict(re.findall(r"^\| `(/[^`]+)` \| `([^`]+)` \|", text_of("docs/formats.md"), re.MULTILINE))
    kinds = {re.compile(re.sub(r"\{\w+\}", "[^/]+", topic)): kind for topic, kind in told.items()}
    suffixes = {"/exact": "semgrid.v1.SemanticGrid", "/picture": "foxglove.CompressedImage"}
    for path in (next((logs / "val").iterdir()), played):
        with path.open("rb") as file:
            reader = make_reader(file)
            summary = reader.get_summary()
            records = [record.name for record in reader.iter_metadata()]
        for channel in summary.channels.values():
            ending = next((each for each in suffixes if channel.topic.endswith(each)), "")
            kind = next((k for known, k in kinds.items() if known.fullmatch(channel.topic.removesuffix(ending))), None)
            assert kind, channel.topic
            assert summary.schemas[channel.schema_id].name == suffixes.get(ending, kind), channel.topic
        assert records
        for name in records:
            assert f"| `{name}` |" in text_of("docs/formats.md")
