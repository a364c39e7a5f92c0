import importlib.util
from email.message import Message
from pathlib import Path
from types import SimpleNamespace

import pytest

TOOL = Path(__file__).parents[2] / "tools" / "licences.py"


@pytest.fixture(scope="module")
def licences():
    spec = importlib.util.spec_from_file_location("licences", TOOL)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def package(*, version="1.0", classifiers=(), **fields):
    metadata = Message()
    for name, value in fields.items():
        metadata[name.replace("_", "-")] = value
    for each in classifiers:
        metadata["Classifier"] = f"License :: {each}"
    return SimpleNamespace(metadata=metadata, version=version)


@pytest.mark.parametrize(
    ("expression", "fine"),
    [
        ("MIT", True),
        ("GPL-3.0-only", False),
        ("EPL-2.0 OR GPL-2.0-or-later", True),
        ("MIT AND GPL-2.0-only", False),
        ("(MIT OR GPL-2.0-only) AND Apache-2.0", True),
        ("(MIT AND GPL-2.0-only) OR LGPL-3.0-only", False),
        ("Apache-2.0 WITH LLVM-exception AND BSD-2-Clause", True),
        ("any-OSI", True),
        ("unknown", False),
        ("", False),
    ],
)
def test_an_expression_is_fine_if_licences_that_are_can_meet_it(licences, expression, fine):
    assert licences.is_fine(expression) is fine


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"License_Expression": "MIT OR Apache-2.0", "License": "GPL"}, "MIT OR Apache-2.0"),
        ({"classifiers": ["OSI Approved :: BSD License"]}, "BSD"),
        ({"classifiers": ["OSI Approved :: BSD License"], "License": "BSD-3-Clause"}, "BSD-3-Clause"),
        ({"classifiers": ["OSI Approved :: MIT License"], "License": "see file"}, "MIT"),
        ({"License": "Copyright of somebody. Redistribution and use in source\n  and binary forms"}, "BSD"),
        ({"License": "GNU General Public License, unlike MIT"}, "GNU General Public License, unlike MIT"),
        (
            {"classifiers": ["OSI Approved :: GNU Lesser General Public License v3 (LGPLv3)"]},
            "GNU Lesser General Public License v3 (LGPLv3)",
        ),
        ({}, "unknown"),
    ],
)
def test_the_licence_is_read_from_what_a_package_says(licences, given, expected):
    assert licences.licence_of(package(**given)) == expected


def test_a_package_that_is_not_known_to_be_fine_is_marked_and_fails(licences, monkeypatch, capsys):
    found = {"good": package(License="MIT"), "bad": package(License="Beerware"), "nvidia-cublas": package()}
    monkeypatch.setattr(licences, "needed", lambda: found)
    assert licences.main() == 1
    good, bad, cuda, last = capsys.readouterr().out.splitlines()
    assert good.split() == ["good", "1.0", "MIT"]
    assert bad.endswith("Beerware  <- not known to be fine")
    assert "not open source" in cuda
    assert last == "3 packages, 1 with a licence that is not known to be fine"
    del found["bad"]
    assert licences.main() == 0


def test_dependencies_of_dependencies_are_found(licences):
    found = licences.needed()
    assert {"numpy", "pydantic", "pydantic-core", "torch", "sympy"} <= found.keys()
    assert "semgrid-eval" not in found
