"""Compile schemas/*.proto into semgrid_eval/log/schemas with one fixed compiler version.

    python tools/compile_schemas.py           # write
    python tools/compile_schemas.py --check   # exit 1 if what is checked in differs

The compiler (grpcio-tools) pins an older protobuf than the package uses, so it is installed without dependencies
into a temporary folder unless this environment has the right version anyway.
"""

import argparse
import filecmp
import importlib.metadata
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

COMPILER = "grpcio-tools"
COMPILER_VERSION = "1.62.3"  # its code loads on protobuf 4.25 to 7 and checks no run-time version
ROOT = Path(__file__).resolve().parent.parent
SOURCES = ROOT / "schemas"
OUTPUT = ROOT / "semgrid_eval" / "log" / "schemas"
PACKAGE = Path("semgrid", "v1")
DESCRIPTOR_SET = "descriptors.bin"
_STUB_HEADER = "# mypy: disable-error-code=type-arg\n"  # the compiler writes a bare Mapping, which strict mypy rejects


def compile_schemas(output: Path) -> None:
    """Write the modules, their type stubs and the descriptor set to `output`."""
    with tempfile.TemporaryDirectory() as scratch:
        environment = _compiler_environment(Path(scratch) / "compiler")
        generated = Path(scratch) / "generated"
        generated.mkdir()
        sources = sorted(SOURCES.glob("*.proto"))
        # Files are compiled as semgrid/v1/*.proto: names in the global descriptor pool must not meet other packages'.
        command = [
            *(sys.executable, "-m", "grpc_tools.protoc"),
            *(f"--proto_path={PACKAGE.as_posix()}={SOURCES}", f"--python_out={generated}", f"--pyi_out={generated}"),
            *(f"--descriptor_set_out={generated / DESCRIPTOR_SET}", "--include_imports"),
            *((PACKAGE / source.name).as_posix() for source in sources),
        ]
        subprocess.run(command, check=True, env=environment)
        output.mkdir(parents=True, exist_ok=True)
        for file in [*sorted((generated / PACKAGE).iterdir()), generated / DESCRIPTOR_SET]:
            shutil.copyfile(file, output / file.name)
        for stub in output.glob("*.pyi"):
            stub.write_text(_STUB_HEADER + stub.read_text())


def is_current() -> bool:
    """Whether compiling now gives exactly the files that are checked in."""
    with tempfile.TemporaryDirectory() as scratch:
        compile_schemas(Path(scratch))
        fresh = sorted(file.name for file in Path(scratch).iterdir())
        kept = sorted(file.name for file in OUTPUT.iterdir() if file.name not in ("__init__.py", "__pycache__"))
        return fresh == kept and not any(filecmp.cmpfiles(scratch, OUTPUT, fresh, shallow=False)[1:])


def _compiler_environment(folder: Path) -> dict[str, str]:
    try:
        if importlib.metadata.version(COMPILER) == COMPILER_VERSION:
            return dict(os.environ)
    except importlib.metadata.PackageNotFoundError:
        pass
    requirement = f"{COMPILER}=={COMPILER_VERSION}"
    install = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--retries=0",
        "--no-deps",
        "--target",
        str(folder),
        requirement,
    ]
    subprocess.run(install, check=True)
    return {**os.environ, "PYTHONPATH": str(folder)}


def main() -> None:
    """Compile, or with `--check` compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare only; exit 1 on a difference")
    if not parser.parse_args().check:
        compile_schemas(OUTPUT)
    elif not is_current():
        sys.exit(f"{OUTPUT} differs from a fresh compilation of {SOURCES}; run: python tools/compile_schemas.py")


if __name__ == "__main__":
    main()
