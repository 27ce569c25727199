"""Modules of users: a Python file is imported with helper modules of its own, and sources have a
digest.
"""

import ast
import builtins
import functools
import hashlib
import importlib
import importlib.util
import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib.machinery import (
    EXTENSION_SUFFIXES,
    SOURCE_SUFFIXES,
    ModuleSpec,
    PathFinder,
    SourceFileLoader,
)
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, NamedTuple

NAMESPACE = "own_deciders_"
OURS = ("hybrid_env", "baselines", "agents")
# Names that no file of a user replaces.
NEVER_BESIDE = {*OURS, *sys.stdlib_module_names}
# Folders of installed packages, which are told by their versions.
RELEASED = ("site-packages", "dist-packages")
INDIRECT = {
    "import_module",
    "__import__",
    "exec",
    "eval",
    "spec_from_file_location",
    "SourceFileLoader",
    "run_path",
    "run_module",
}
"""Names by which a source imports what it does not name."""
# Characters of a text that may be the name of a file.
LONGEST_NAME = 200


class _Loader(SourceFileLoader):
    """Runs a source as it is now, with an `import` that looks beside the file of the user first."""

    def get_code(self, fullname: str) -> CodeType:
        """Compile the source; a cached file may be that of another version of the same second."""
        path = self.get_filename(fullname)
        code: CodeType = self.source_to_code(self.get_data(path), path)
        return code

    def exec_module(self, module: ModuleType) -> None:
        """See `importlib.abc.Loader`."""
        importer = functools.partial(_import, module.__name__.partition(".")[0])
        vars(module)["__builtins__"] = vars(builtins) | {"__import__": importer}
        super().exec_module(module)


class _Finder:
    """Finds the modules of the namespaces of users' files."""

    @staticmethod
    def find_spec(
        name: str,
        path: Sequence[str] | None = None,
        target: Any = None,
    ) -> ModuleSpec | None:
        """See `importlib.abc.MetaPathFinder`."""
        if path is None or not name.startswith(NAMESPACE):
            return None
        spec = PathFinder.find_spec(name, path)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _Loader(name, spec.loader.path)
        return spec


sys.meta_path.insert(0, _Finder)


def _import(
    namespace: str,
    name: str,
    globals: Mapping[str, Any] | None = None,
    locals: Mapping[str, Any] | None = None,
    fromlist: Sequence[str] | None = (),
    level: int = 0,
) -> ModuleType:
    """Import a module as `__import__` does, but one that stands beside the file into the
    namespace of the file.
    """
    top = name.partition(".")[0]
    if level or not _is_beside(namespace, top):
        return builtins.__import__(name, globals, locals, fromlist or (), level)
    inner = f"{namespace}.{name}"
    if fromlist:
        return builtins.__import__(inner, globals, locals, fromlist)
    importlib.import_module(inner)
    return sys.modules[f"{namespace}.{top}"]


@functools.cache
def _is_beside(namespace: str, top: str) -> bool:
    """Return whether a module or package stands beside the file; a mere folder only if nothing
    else has its name.
    """
    if top in NEVER_BESIDE:
        return False
    spec = PathFinder.find_spec(top, sys.modules[namespace].__path__)
    return spec is not None and (spec.origin is not None or importlib.util.find_spec(top) is None)


def import_file(path: Path) -> ModuleType:
    """Import a Python file, once for each version of it and of what it imports.

    What stands beside the file is imported for this file alone, so that files in two folders may
    have helper modules of the same name.
    """
    return _import_version(path, file_digest(path) or str(path.stat().st_mtime_ns))


@functools.cache
def _import_version(path: Path, version: str) -> ModuleType:
    namespace = NAMESPACE + hashlib.sha256(f"{path} {version}".encode()).hexdigest()[:12]
    package = ModuleType(namespace)
    package.__path__ = [str(path.parent)]
    sys.modules[namespace] = package
    importlib.invalidate_caches()
    name = f"{namespace}.{path.stem.replace('.', '_')}"
    loader = _Loader(name, str(path))
    spec = importlib.util.spec_from_file_location(name, path, loader=loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    # Dataclasses look their module up.
    sys.modules[name] = module
    loader.exec_module(module)
    return module


def import_named(name: str) -> ModuleType:
    """Import a module by its name; its digest is taken before, because the process keeps it as
    it was then.
    """
    named_digest(name)
    return importlib.import_module(name)


def named_digest(name: str) -> str | None:
    """Return the digest of the package or file of a module when it was imported; None if that is
    not known.
    """
    return _digest_at_import(name.partition(".")[0])


@functools.cache
def _digest_at_import(top: str) -> str | None:
    files = [] if top in sys.modules else list(_files(top, None, released=True))
    return _digest(files, None) if files else None


def file_digest(path: Path) -> str | None:
    """Return a digest of a Python file and of all that it imports and no release has; None if
    that is not known.
    """
    return _digest([path], path.parent)


def _digest(files: Sequence[Path], folder: Path | None) -> str | None:
    """Return the digest of files, of what they import, from a folder first, and of the files
    that they name.
    """
    waiting = list(files)
    contents = {}
    while waiting:
        path = waiting.pop().resolve()
        if path in contents:
            continue
        try:
            content = path.read_bytes()
        except OSError:
            return None
        contents[path] = hashlib.sha256(content).hexdigest()
        if path.suffix not in SOURCE_SUFFIXES:
            continue
        source = _read_source(content)
        if source.indirect:
            return None
        for name in source.imports:
            waiting += _files(name, folder)
        named = (place / text for text in source.texts for place in (path.parent, Path.cwd()))
        waiting += [file for file in named if file.is_file()]
    lines = sorted(f"{path} {content}" for path, content in contents.items())
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def _files(name: str, folder: Path | None, released: bool = False) -> Iterator[Path]:
    """Yield the files of a module or of a whole package; those of installed packages only if
    `released`.
    """
    if name in NEVER_BESIDE:
        return
    try:
        beside = None if folder is None else PathFinder.find_spec(name, [str(folder)])
        spec = beside or importlib.util.find_spec(name)
    except ValueError:
        # A module without a specification.
        return
    if spec is None:
        return
    suffixes = (*SOURCE_SUFFIXES, *EXTENSION_SUFFIXES)
    for place in map(Path, spec.submodule_search_locations or [spec.origin or ""]):
        if released or not set(RELEASED) & set(place.parts):
            inside = sorted(place.rglob("*")) if place.is_dir() else [place]
            yield from (file for file in inside if file.name.endswith(suffixes))


class _Source(NamedTuple):
    """What a source names."""

    # Top-level names of modules.
    imports: frozenset[str]
    # That may be names of files.
    texts: frozenset[str]
    # Whether it imports, or may import, what it does not name.
    indirect: bool


@functools.cache
def _read_source(content: bytes) -> _Source:
    try:
        nodes = list(ast.walk(ast.parse(content)))
    except (SyntaxError, ValueError):
        # It cannot be imported.
        return _Source(frozenset(), frozenset(), False)
    imports: set[str] = set()
    texts: set[str] = set()
    names: set[str] = set()
    for node in nodes:
        match node:
            case ast.Import(names=modules):
                imports |= {module.name.partition(".")[0] for module in modules}
            # From . import helper.
            case ast.ImportFrom(module=None, names=parts):
                imports |= {part.name for part in parts}
            case ast.ImportFrom(module=str(module), names=parts):
                imports.add(module.partition(".")[0])
                names |= {part.name for part in parts}
            case ast.Constant(value=str(text)) if (
                0 < len(text) < LONGEST_NAME and text.isprintable()
            ):
                texts.add(text)
            case ast.Name(id=name):
                names.add(name)
            # Other folders are searched.
            case ast.Attribute(value=ast.Name(id="sys"), attr="path"):
                names.add("import_module")
            # Methods of models have these names.
            case ast.Attribute(attr=name) if name not in ("eval", "exec"):
                names.add(name)
    return _Source(frozenset(imports), frozenset(texts), bool(names & INDIRECT))
