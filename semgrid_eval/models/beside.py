"""A model's file and what it imports from beside it, found while its code runs and at no other time."""

import ast
import importlib
import importlib.util
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from semgrid_eval.errors import InputError
from semgrid_eval.files import digest_files, digest_value, read_bytes

_MAKING_NAMES = {"*", "exec", "globals", "locals", "vars", "setattr", "__getattr__"}
"""Where code has one of these, other names may be defined than those that are written in it."""


@dataclass(frozen=True)
class Code:
    """The files that make a model of one's own."""

    sources: tuple[Path, ...]
    folder: Path  # of the files that it declares

    def version(self, files: Sequence[str], name: str, package: str | None) -> str:
        """Digest the code with the files that it declares, and the version of the package that it is of, if it is.

        Raises:
            InputError: a declared file is missing.
        """
        for each in files:
            if not (self.folder / each).is_file():
                raise InputError(f"declares the file {each}, which is not in {self.folder}", field=f"{name}: files")
        digest = digest_files([*self.sources, *(self.folder / each for each in files)])
        return digest if package is None else digest_value([package, digest])


def require_python(path: Path) -> None:
    """Make sure that a path may be a model's file; an InputError says that it is not."""
    if path.suffix != ".py":
        raise InputError("is not a Python file (.py); a model is given as path.py:Class", path=path)
    if not path.is_file():
        fault = "is not a file" if path.exists() else "is not there"
        raise InputError(f"{fault}; a model is given as path.py:Class", path=path)


def require_defined(path: Path, name: str) -> None:
    """Make sure, without running a Python file, that it may define a name; files that make names are not judged.

    Raises:
        InputError: it is not Python code, or nothing in it has that name.
    """
    try:
        code = ast.parse(read_bytes(path), filename=path.name)
    except (SyntaxError, ValueError, RecursionError) as error:
        raise InputError(f"is not Python code: {error}", path=path) from None
    named = set().union(*map(_names_of, ast.walk(code)))
    if name not in named and not named & _MAKING_NAMES:
        raise undefined(path, name)


def undefined(path: Path | str, name: str) -> InputError:
    """Say that a file does not define a name."""
    return InputError(f"defines no {name!r}", path=path)


def _names_of(node: ast.AST) -> set[str]:
    """Return the names that a piece of code binds or reads."""
    match node:
        case ast.ClassDef(name=name) | ast.FunctionDef(name=name) | ast.Name(id=name) | ast.Attribute(attr=name):
            return {name}
        case ast.alias(name=name, asname=asname):
            return {asname or name.partition(".")[0]}
    return set()


class ModelFile:
    """A Python file with its neighbours.

    `sys.path` and `sys.modules` are as before whenever none of its code runs, so that the neighbours of two files may
    have the same names. What the file imports while it is loaded is all that it can import from beside it: no
    neighbour can take part in numbers that is not part of their id.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.folder = path.resolve().parent
        self._neighbours: dict[str, ModuleType] = {}
        self._digest = ""
        self._is_present = False

    def load(self) -> ModuleType:
        """Run the file, which may import what lies beside it.

        Raises:
            InputError: it is not a Python file.
        """
        # The name stays known, since dataclasses and pickle look a class's module up by it.
        name = f"semgrid_eval_own_{digest_value(str(self._path.resolve()))}_{self._path.stem}"
        require_python(self._path)
        spec = importlib.util.spec_from_file_location(name, self._path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        # What the caller has imported from beside the file is imported again, so that it is known as a source.
        others = {each for each in sys.modules if not each.startswith(("semgrid_eval", "__main__"))}
        tops = {top for top in {each.partition(".")[0] for each in others} if self._is_beside(top)}
        callers = {each: sys.modules.pop(each) for each in others if each.partition(".")[0] in tops}
        sys.modules[name] = module
        before = set(sys.modules)
        importlib.invalidate_caches()
        sys.path.insert(0, str(self.folder))
        # Bytecode is told from its source by seconds and size, which two versions of a file may share.
        writes_bytecode, sys.dont_write_bytecode = sys.dont_write_bytecode, True
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[name]
            raise
        finally:
            sys.dont_write_bytecode = writes_bytecode
            sys.path.remove(str(self.folder))
            self._take_neighbours(before)
            sys.modules.update(callers)
        self._digest = digest_files(self.sources())
        return module

    def sources(self) -> list[Path]:
        """List the files that make the model: its own, and those that it imported from beside it."""
        return [self._path, *sorted(Path(file) for each in self._neighbours.values() if (file := each.__file__))]

    def is_current(self) -> bool:
        """Tell whether these files are still what was run."""
        try:
            return self._digest == digest_files(self.sources())
        except InputError:
            return False

    @contextmanager
    def present(self) -> Iterator[None]:
        """Let its code find the neighbours that it has imported, inside the block."""
        if self._is_present:
            yield
            return
        hidden = {name: sys.modules[name] for name in self._neighbours if name in sys.modules}
        sys.modules.update(self._neighbours)
        self._is_present = True
        try:
            yield
        finally:
            self._is_present = False
            for name in self._neighbours:
                sys.modules.pop(name, None)
            sys.modules.update(hidden)

    def _take_neighbours(self, before: set[str]) -> None:
        """Keep what was loaded from beside the file out of `sys.modules`; other packages may stay."""
        found = {name: module for name, module in sys.modules.items() if name.partition(".")[0] not in before}
        self._neighbours = {name: module for name, module in found.items() if self._is_beside(name.partition(".")[0])}
        for name in self._neighbours:
            del sys.modules[name]

    def _is_beside(self, package: str) -> bool:
        """Tell whether a top-level module or package lies in the folder itself, and not in an environment below it."""
        module = sys.modules.get(package)
        if file := getattr(module, "__file__", None):
            return Path(file).resolve().parent in (self.folder, self.folder / package)
        return any(Path(place).resolve() == self.folder / package for place in getattr(module, "__path__", ()))
