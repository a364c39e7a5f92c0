"""Leads in milliseconds: taken from a report's file, and as frames."""

import json

import numpy as np
import pytest

from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.windows.lead import frames_of, lead_from
from semgrid_eval.windows.plan import WindowConfig


@pytest.fixture(name="file")
def file_fixture(tmp_path):
    path = tmp_path / "with:colon" / "leads.json"
    path.parent.mkdir()
    path.write_text(json.dumps({"lead_ms": {"mean_known": 235.0, "vehicles": 118.0}}))
    return path


def test_the_lead_of_the_mean_or_of_a_category_is_taken_from_a_file(file):
    assert lead_from(f"from {file}") == 235.0
    assert lead_from(f"from {file}:vehicles") == 118.0
    assert parse_config(WindowConfig, {"lead_ms": f"from {file}"}).lead_ms == 235.0
    assert [lead_from(each) for each in (120.0, None)] == [120.0, None]


@pytest.mark.parametrize(
    ("content", "asked", "fault"),
    [
        (None, "", "leads.json"),
        ("{}", "", "lead_ms"),
        ('{"lead_ms": {"vehicles": 1.0}}', "", "lead_ms: 'mean_known' is not vehicles, the only choice"),
        ('{"lead_ms": {}}', ":person", "lead_ms: 'person' is not one of"),
        ('{"lead_ms": {"mean_known": -1.0}}', "", "must be above 0"),
    ],
)
def test_what_cannot_be_read_is_told_with_the_file(tmp_path, content, asked, fault):
    path = tmp_path / "leads.json"
    if content is not None:
        path.write_text(content)
    with pytest.raises(ConfigError, match=fault):
        parse_config(WindowConfig, {"lead_ms": f"from {path}{asked}"})


def test_a_lead_is_the_nearest_number_of_frames_and_at_least_one():
    stamps_ns = np.arange(10) * 58_823_529
    assert [frames_of(lead_ms, stamps_ns) for lead_ms in (1.0, 59.0, 85.0, 92.0, 294.0)] == [1, 1, 1, 2, 5]
    assert frames_of(294.0, stamps_ns[:1]) == 1
