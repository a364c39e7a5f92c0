import importlib
import importlib.util
import subprocess
from pathlib import Path

import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet

from semgrid_eval.log import schemas

ROOT = Path(__file__).parents[2]
SOURCES = sorted((ROOT / "schemas").glob("*.proto"))


def compiler():
    spec = importlib.util.spec_from_file_location("compile_schemas", ROOT / "tools" / "compile_schemas.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_compiled_schemas_are_those_of_the_sources():
    try:
        assert compiler().is_current(), "run: python tools/compile_schemas.py"
    except subprocess.CalledProcessError:
        pytest.skip("the schema compiler cannot be installed here (no package index?)")


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
def test_generated_modules_match_the_descriptor_set(source):
    module = importlib.import_module(f"semgrid_eval.log.schemas.{source.stem}_pb2")
    kept = FileDescriptorSet.FromString(Path(schemas.__file__).with_name("descriptors.bin").read_bytes())
    files = {file.name: file for file in kept.file}
    for message in files[module.DESCRIPTOR.name].message_type:
        for field in message.field:
            field.ClearField("json_name")  # only descriptor sets carry it
    assert module.DESCRIPTOR.package == "semgrid.v1"
    assert files[module.DESCRIPTOR.name].SerializeToString() == module.DESCRIPTOR.serialized_pb


def test_every_message_has_a_source():
    kept = FileDescriptorSet.FromString(Path(schemas.__file__).with_name("descriptors.bin").read_bytes())
    own = {Path(file.name).name for file in kept.file if file.package == "semgrid.v1"}
    assert own == {path.name for path in SOURCES}
