"""Make packs of kernels: ``python -m der.packs.build --to FOLDER GROUP ...``.

Small rings are computed with kernels run by Python itself, which shows what kernels Python calls,
with arguments of which types. Numba compiles these; what they call is linked in before LLVM sees
it, so that it is optimised once. The pack has to prove itself: another process runs the calls that
were seen, and its results must be equal, bit by bit, to those of numba's own code for the same
kernels, not optimised and called in numba's way.
"""

from __future__ import annotations

import ast
import copy
import importlib
import os
import pickle
import platform
import sqlite3
import subprocess
import sys
import tempfile
import time
import traceback
from contextlib import closing
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from der.packs import kernel as kernels
from der.packs.folders import kept_folder, say
from der.packs.kernel import Kernel, Seen
from der.packs.load import (
    GROUPS,
    PACKAGE,
    Pack,
    digest,
    file_name,
    folders,
    group_of,
    linked,
    read,
    write,
)

_FOLD = "der.analysis.fold:use_kernels"
_PATH = {"stability": True, "self_crossings": True, "snaps": False}
# what calls the kernels of a group on small rings
USES: dict[str, tuple[str, dict[str, bool]]] = {
    "path": (_FOLD, _PATH),
    "bvp": ("der.bvp.solve:use_kernels", {"quarter": True}),
    "motion": (_FOLD, _PATH | {"snaps": True}),
    "planar": ("der.analysis.planar.planar_states:use_kernels", {}),
    "rod": (_FOLD, _PATH),
}
CALLS = 4  # of each kernel, kept for the proof
# code for any processor of a family is as fast here as code for one of them
PROCESSOR = {"x86_64": "x86-64-v2", "AMD64": "x86-64-v2"}


def main(words: list[str]) -> None:
    """Build the packs that are named; an empty one where that fails, so that it is tried once."""
    folder, groups = Path(words[1]), words[2:]
    for group in groups:
        with closing(sqlite3.connect(folder / f"{group}.lock", timeout=600.0)) as lock:
            lock.execute("BEGIN EXCLUSIVE")  # ends with this process at the latest
            if fresh(folder, group) is not None:
                continue
            try:
                build(group, folder)
            except Exception:  # of numba's, of the proof: numba goes on alone, until sources change
                traceback.print_exc()
                write(folder / file_name(group), Pack(everything(), [], [], b""))


def build(group: str, folder: Path) -> None:
    """Compile a pack, and put it in place if it proves itself."""
    from der.packs.compile import compiled  # numba; who waits or compares needs none

    seen = calls(group)
    known, code, reference = compiled(group, seen)
    pack = Pack(sources(), known, list(reference), code)
    expected = []
    for one in seen:
        args = copy.deepcopy(one.args)
        expected.append((one.name, one.args, bits(reference[one.name](*args), args)))
    with tempfile.TemporaryDirectory() as private:
        proof = Path(private, "proof")
        proof.write_bytes(pickle.dumps((group, pack, expected)))
        subprocess.run([sys.executable, "-m", __spec__.name, "--prove", str(proof)], check=True)
    write(folder / file_name(group), pack)


def prove(file: Path) -> None:
    """Run a pack and compare; raises where it differs, and may crash."""
    group, pack, expected = pickle.loads(file.read_bytes())
    functions = linked(group, pack)
    for name, args, wanted in expected:
        if bits(functions[name](*args), args) != wanted:
            raise ArithmeticError(f"{name} gives other results than numba's code")


def bits(result: Any, args: tuple[Any, ...]) -> bytes:
    """A result, and all that a call may have written to."""
    return pickle.dumps((result, args))


# --- What is called ----------------------------------------------------------------------------


def calls(group: str) -> list[Seen]:
    """Some calls by Python of each kernel of a group."""
    found: dict[str, list[Seen]] = {}
    inside = False

    def watch(kernel: Kernel, *args: Any) -> Any:
        nonlocal inside
        if inside:
            return kernel.py_func(*args)
        kept = found.setdefault(kernel.name, [])
        if len(kept) < CALLS:
            kept.append(Seen(kernel.name, copy.deepcopy(args)))
        inside = True
        try:
            return plain(kernel.py_func(*args))
        finally:
            inside = False

    kernels.instead = watch
    try:
        with np.errstate(all="ignore"):
            use, options = USES[group]
            module, function = use.split(":")
            getattr(importlib.import_module(module), function)(**options)
    finally:
        kernels.instead = None
    return [one for name, kept in found.items() if group_of(name) == group for one in kept]


def plain(value: Any) -> Any:
    """Numbers as machine code returns them: Python's."""
    if type(value) is tuple:
        return tuple(map(plain, value))
    return value.item() if isinstance(value, np.generic) else value


# --- What kernels are made from --------------------------------------------------------------


def sources() -> dict[str, str]:
    """Hashes of the modules that the kernels were made from.

    Those of all kernels that have been compiled, and those from which they import constants.
    """
    kept = [module for name, module in sys.modules.items() if name.split(".")[0] == "der"]
    kernel_modules = {
        one.py_func.__module__
        for module in kept
        for one in vars(module).values()
        if isinstance(one, Kernel) and "dispatcher" in vars(one)
    }
    found, waiting = {}, sorted(kernel_modules)
    while waiting:
        module = sys.modules[waiting.pop()]
        file = Path(str(module.__file__))
        name = file.relative_to(PACKAGE).as_posix()
        if name not in found:
            found[name] = digest(name)
            waiting += constants_from(module, file.read_text(encoding="utf-8"))
    return found


def everything() -> dict[str, str]:
    """Hashes of all modules of this package that are loaded: any of them may have failed."""
    names = [name for name in sys.modules if name.split(".")[0] == "der"]
    files = [Path(str(sys.modules[name].__file__)) for name in names]
    places = [file.relative_to(PACKAGE).as_posix() for file in files]
    return {place: digest(place) for place in [*places, "packs/build.py"]}


def constants_from(module: ModuleType, text: str) -> list[str]:
    """The modules of this package from which a module imports what is no function or class."""
    return [
        str(node.module)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "der"
        for one in node.names
        if not callable(getattr(module, one.asname or one.name, callable))
    ]


# --- Who has packs built -----------------------------------------------------------------------


_building: dict[str, subprocess.Popen[bytes]] = {}  # by group: what builds it for this process


def build_missing(wanted: str) -> Pack:
    """Build the packs that are missing, on all cores, and wait for one of them.

    The others are built on in their processes. Two commands at once wait for each other.
    """
    places = folders()
    folder = kept_folder(places, "DER_PACKS")
    if wanted not in _building:
        say("compiling kernels, once: about half a minute on two cores")
        missing = [group for group in GROUPS if not any(fresh(place, group) for place in places)]
        _building.update(start(folder, missing, first=wanted))
    process = _building[wanted]
    while (pack := fresh(folder, wanted)) is None and process.poll() is None:
        time.sleep(0.05)
    pack = pack or fresh(folder, wanted)  # it may have ended in between
    if pack is None or not pack.entries:
        raise RuntimeError(f"the kernels {wanted!r} could not be compiled ahead")
    return pack


def build_all(folder: Path) -> bool:
    """Build all packs into a folder; whether that could be done."""
    for process in start(folder, list(GROUPS), first="rod").values():
        process.wait()
    return all((pack := fresh(folder, group)) and pack.entries for group in GROUPS)


def start(folder: Path, groups: list[str], *, first: str) -> dict[str, subprocess.Popen[bytes]]:
    """Build packs in processes, one a core; the first has a core of its own, if there are two."""
    folder.mkdir(parents=True, exist_ok=True)
    cores = max(os.cpu_count() or 1, 1)
    others = [group for group in groups if group != first]
    queues = [[first], *(others[k :: cores - 1] for k in range(min(cores - 1, len(others))))]
    if cores == 1:
        queues = [[first, *others]]
    inside = os.pathsep.join([str(PACKAGE.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
    processor = PROCESSOR.get(platform.machine(), "generic")
    env = {"PYTHONPATH": inside, "NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": ""}
    quiet = None if os.environ.get("DER_PACKS_LOG") else subprocess.DEVNULL
    started = {}
    for queue in queues:
        words = [sys.executable, "-m", "der.packs.build", "--to", str(folder), *queue]
        process = subprocess.Popen(words, env=os.environ | env, stdout=quiet, stderr=quiet)
        started.update(dict.fromkeys(queue, process))
    return started


def fresh(folder: Path, group: str) -> Pack | None:
    """A pack that is there and made from these sources."""
    pack = read(folder / file_name(group))
    return pack if pack is not None and pack.fits() else None


if __name__ == "__main__":
    if sys.argv[1] == "--prove":
        prove(Path(sys.argv[2]))
    elif sys.argv[1] == "--all":
        sys.exit(0 if build_all(Path(sys.argv[2])) else 1)
    else:
        main(sys.argv[1:])
