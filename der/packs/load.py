"""Packs: machine code of kernels, made once by numba, loaded without it.

A pack is a file: a line of JSON, then object code. The line says where the functions are, and which
sources of this package the code was made from: if one of them has changed, the pack is made again.
Its name has the versions of what it depends on. The code is for any processor of the machine's
family. What goes wrong here is said in one line, and left to numba.

The environment variable DER_PACKS names a folder to keep packs in; "off" leaves all to numba.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib
import importlib.machinery
import importlib.util
import json
import os
import platform
import sys
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from der.packs.folders import say, user_folder

# which kernels are built together: those that call the same ones; the first that fits
GROUPS = {
    "path": ("der.continuation", "der.kernels.linking", "der.kernels.strands", "der.rod.manifold"),
    "bvp": ("der.bvp", "der.diagram"),
    "motion": ("der.rod.relaxation", "der.rod.dynamics", "der.rod.implicit_step"),
    "planar": ("der.kernels.planar",),
    "rod": ("der",),
}
PACKAGE = Path(__file__).resolve().parent.parent
BUILT = PACKAGE / "packs" / "built"  # in an installed package

_loaded: dict[str, dict[str, Callable[..., Any]]] = {}  # by group, by kernel
_alive: list[Any] = []  # what machine code in use refers to


class Pack(NamedTuple):
    """What is read from a file."""

    sources: dict[str, str]  # hash of each, by its place in the package
    known: list[str]  # objects that arguments are compared with
    entries: list[str]  # kernels
    code: bytes

    def fits(self) -> bool:
        """Whether it was made from the sources that are here."""
        return all(digest(name) == made for name, made in self.sources.items())


def group_of(kernel: str) -> str:
    """The pack that may hold a kernel "module:function"."""
    starts = kernel.startswith
    return next(name for name, modules in GROUPS.items() if any(map(starts, modules)))


def loaded(kernel: str) -> Callable[..., Any] | None:
    """A kernel from its pack, which is built if need be; None: numba has to compile it."""
    group = group_of(kernel)
    if group not in _loaded:
        _loaded[group] = {}
        if usable():
            try:
                _loaded[group] = linked(group, _found(group))
            except Exception as e:  # whatever it is, numba can do without
                say(f"kernels are compiled one by one, which is slower: {e}")
    return _loaded[group].get(kernel)


def usable() -> bool:
    """Whether packs are wanted, and objects of Python look as wrappers expect."""
    shared_lock = getattr(sys, "_is_gil_enabled", lambda: True)()
    usual = platform.python_implementation() == "CPython" and sys.maxsize > 2**32 and shared_lock
    read_as_python = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
    return usual and os.environ.get("DER_PACKS") != "off" and not read_as_python


def _found(group: str) -> Pack:
    """The pack of a group, the missing ones built now."""
    for folder in folders():
        pack = read(folder / file_name(group))
        if pack is not None and pack.fits():
            return pack
    from der.packs.build import build_missing

    return build_missing(group)


def folders() -> list[Path]:
    """Where packs are looked for."""
    given = os.environ.get("DER_PACKS")
    if given:
        return [Path(given)]
    place = hashlib.sha256(str(PACKAGE).encode()).hexdigest()[:12]  # one user, many clones
    return [BUILT, user_folder() / "ring-origami" / place]


@cache
def file_name(group: str) -> str:
    """The name of a pack: what it depends on, but its sources."""
    versions = "-".join(version(name) for name in ("numba", "llvmlite", "numpy"))
    tag = f"{sys.implementation.cache_tag}-{sys.platform}-{platform.machine()}"
    return f"{group}-{versions}-{tag}.pack"


@cache
def digest(source: str) -> str:
    """Hash of a source file of this package; empty if there is none."""
    try:
        return hashlib.sha256((PACKAGE / source).read_bytes()).hexdigest()[:16]
    except OSError:
        return ""


def read(file: Path) -> Pack | None:
    """The pack in a file; None if there is none, or one that is torn."""
    try:
        head, _, code = file.read_bytes().partition(b"\n")
        said = json.loads(head)
        whole = said["code"] == hashlib.sha256(code).hexdigest()
        return Pack(said["sources"], said["known"], said["entries"], code) if whole else None
    except (OSError, ValueError, LookupError, TypeError):
        return None


def write(file: Path, pack: Pack) -> None:
    """Write a pack, whole or not at all."""
    head = pack._asdict() | {"code": hashlib.sha256(pack.code).hexdigest()}
    part = file.with_suffix(f".{os.getpid()}")
    part.write_bytes(json.dumps(head).encode() + b"\n" + pack.code)
    part.replace(file)


# --- Machine code ------------------------------------------------------------------------------


class _Method(ctypes.Structure):  # CPython's PyMethodDef
    _fields_ = (
        ("name", ctypes.c_char_p), ("address", ctypes.c_void_p),
        ("flags", ctypes.c_int), ("doc", ctypes.c_char_p),
    )  # fmt: skip


_FASTCALL = 0x80  # METH_FASTCALL: arguments as an array


def linked(group: str, pack: Pack) -> dict[str, Callable[..., Any]]:
    """The functions of a pack, ready to be called; an empty one leaves all to numba."""
    if not pack.entries:
        return {}
    from llvmlite import binding

    engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _machine())
    engine.add_object_file(binding.ObjectFileRef.from_data(pack.code))
    engine.finalize_object()
    known = [_known(name) for name in pack.known]
    table = engine.get_global_value_address(f"known.{group}")
    (ctypes.c_void_p * len(known)).from_address(table)[:] = [id(one) for one in known]
    make = ctypes.pythonapi.PyCFunction_NewEx
    make.restype, make.argtypes = ctypes.py_object, (ctypes.c_void_p,) * 3
    functions = {}
    for kernel in pack.entries:
        address = engine.get_function_address(f"call.{kernel}")
        method = _Method(kernel.encode(), address, _FASTCALL, None)
        functions[kernel] = make(ctypes.addressof(method), None, None)
        _alive.append(method)
    _alive.extend((engine, known))
    return functions


@cache
def _machine() -> Any:
    """What code is linked for: this machine, with numba's way to allocate arrays at hand."""
    from llvmlite import binding

    home = importlib.util.find_spec("numba")
    if home is None or home.origin is None:
        raise ImportError("numba is missing")
    for module, prefix in (("core.runtime._nrt_python", "NRT_"), ("_helperlib", "numba_")):
        helpers = _extension(Path(home.origin).parent, module).c_helpers
        for name, address in helpers.items():
            binding.add_symbol(name if name.startswith("_") else prefix + name, address)
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    triple = binding.get_process_triple()
    return binding.Target.from_triple(triple).create_target_machine(
        cpu=binding.get_host_cpu_name(),
        reloc="static" if triple.startswith("x86") else "default",
        codemodel="jitdefault",
        jit=True,
    )


def _extension(numba: Path, name: str) -> Any:
    """An extension module of numba's by its place: the package around it is not imported."""
    if (there := sys.modules.get(f"numba.{name}")) is not None:
        return there
    *folders, short = name.split(".")
    suffixes = importlib.machinery.EXTENSION_SUFFIXES
    files = [numba.joinpath(*folders, short + suffix) for suffix in suffixes]
    spec = importlib.util.spec_from_file_location(short, next(f for f in files if f.exists()))
    if spec is None or spec.loader is None:
        raise ImportError(f"numba's {name} cannot be loaded")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _known(name: str) -> Any:
    """An object by "module:name"."""
    module, _, attribute = name.partition(":")
    return getattr(importlib.import_module(module), attribute)
