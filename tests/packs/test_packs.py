"""Packs: kernels as machine code that is checked first, and left to numba where it fails."""

import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

from der.continuation.interpolant import combined
from der.kernels.quaternions import _turns_between
from der.packs import build, load
from der.packs.load import GROUPS, PACKAGE
from der.rod.manifold import product

WEIGHT, X = np.array([1.0, 2.0]), np.array([3.0, 4.0])


def pack_of(group):
    """The pack that is in use here."""
    packs = (load.read(folder / load.file_name(group)) for folder in load.folders())
    return next(pack for pack in packs if pack is not None and pack.fits())


def machine_code(kernel):
    """A kernel's function in its pack."""
    return load.loaded(kernel.name)


# --- Results -----------------------------------------------------------------------------------


def test_results_are_those_of_numba_bit_by_bit():
    """A sum, a result that is written, and frames, by machine code of a pack and by numba."""
    rng = np.random.default_rng(0)
    w, x, y = rng.normal(size=(3, 50))
    assert machine_code(product)(w, x, y) == product.dispatcher(w, x, y)
    found, expected = np.empty(50), np.empty(50)
    machine_code(combined)(0.3, w, -1.7, x, 2.9, y, found)
    combined.dispatcher(0.3, w, -1.7, x, 2.9, y, expected)
    assert found.tobytes() == expected.tobytes()
    frames = rng.normal(size=(2, 30, 4))
    found, expected = np.empty((30, 3)), np.empty((30, 3))
    machine_code(_turns_between)(*frames, found)
    _turns_between.dispatcher(*frames, expected)
    assert found.tobytes() == expected.tobytes()


@pytest.mark.parametrize("command", ["fold", "bvp"])
def test_commands_run_without_numba(command, tmp_path):
    """Nothing on a path imports the compiler, nor compiles."""
    code = (
        "import sys\nfrom der.cli.commands import main\ntry: main(sys.argv[1:])\n"
        "except SystemExit as end: print(end.code, 'numba' in sys.modules)"
    )
    words = [command, "circle", "--h-over-t", "4", "--quiet"]
    done = subprocess.run(
        [sys.executable, "-c", code, *words], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.stdout.splitlines()[-1] == "0 False"
    assert done.stderr == ""


# --- Arguments that do not fit -------------------------------------------------------------------


@pytest.mark.parametrize(
    "wrong",
    [
        X.astype(np.float32), X.astype(np.int64), X.astype(">f8"), X[::-1], X.reshape(2, 1),
        np.ascontiguousarray(X).view(np.ma.MaskedArray), [3.0, 4.0], None,
        np.frombuffer(X.tobytes()), np.frombuffer(b"0" + X.tobytes(), offset=1),
    ],
    ids=["float32", "integers", "byte order", "strides", "axes", "subclass", "list", "None",
         "read only", "not aligned"],
)  # fmt: skip
def test_other_arrays_are_refused_and_nothing_is_read(wrong):
    """Machine code would take them for what they are not."""
    assert machine_code(product)(WEIGHT, wrong, X) is NotImplemented


def test_other_numbers_are_refused():
    """Whole numbers for real ones, too many arguments, too few."""
    out = np.empty(2)
    function = machine_code(combined)
    assert function(1, X, 2.0, X, 3.0, X, out) is NotImplemented
    assert function(1.0, X, 2.0, X, 3.0, X) is NotImplemented
    assert function(1.0, X, 2.0, X, 3.0, X, out, out) is NotImplemented
    assert function(np.float64(1.0), X, 2.0, X, 3.0, X, out) is None


def test_numba_takes_what_a_pack_refuses():
    """Strided arrays give the same sum."""
    assert product(WEIGHT, X[::-1], X) == WEIGHT[0] * 12.0 + WEIGHT[1] * 12.0


# --- Files ---------------------------------------------------------------------------------------


def test_files_that_are_torn_or_old_are_not_packs(tmp_path):
    """A byte less, one changed, no file; and a source that has changed since."""
    pack, file = pack_of("path"), tmp_path / "a.pack"
    load.write(file, pack)
    assert load.read(file) == pack
    whole = file.read_bytes()
    for torn in (whole[:-1], whole[:-9] + b"?" + whole[-8:], whole[:50], b"", b"[]\n", b"{}\n"):
        file.write_bytes(torn)
        assert load.read(file) is None
    assert load.read(tmp_path / "none") is None
    assert pack.fits()
    assert not pack._replace(sources=pack.sources | {"kernels/linking.py": "0"}).fits()
    assert not pack._replace(sources=pack.sources | {"kernels/gone.py": "0"}).fits()


def test_packs_know_the_modules_of_kernels_and_of_their_constants():
    """All kernels of the groups belong to exactly one of them, and their sources are named."""
    for group in GROUPS:
        pack = pack_of(group)
        assert {load.group_of(name) for name in pack.entries} == {group}
        modules = {
            name.split(":")[0].removeprefix("der.").replace(".", "/") for name in pack.entries
        }
        assert {f"{module}.py" for module in modules} <= set(pack.sources)
        assert all((PACKAGE / name).exists() for name in pack.sources)
    assert "errors.py" in pack_of("rod").sources  # REASONS, a constant


def test_a_pack_of_old_sources_is_waited_for_until_it_is_new(tmp_path, monkeypatch):
    """A file that is there already is no reason to give up."""
    new = pack_of("path")
    file = tmp_path / load.file_name("path")
    load.write(file, new._replace(sources=new.sources | {"kernels/linking.py": "0"}))

    class Builder:
        asked = 0

        def poll(self):
            self.asked += 1
            if self.asked == 2:
                load.write(file, new)

    monkeypatch.setenv("DER_PACKS", str(tmp_path))
    monkeypatch.setattr(build, "_building", {"path": Builder()})
    assert build.build_missing("path") == new


def test_a_failure_is_believed_until_any_module_changes():
    """Its empty pack names the modules that are loaded, the builder among them."""
    assert {"packs/build.py", "packs/load.py", "kernels/quaternions.py"} <= set(build.everything())


def test_a_pack_that_gives_other_results_is_not_believed(tmp_path):
    """One bit is enough."""
    pack, args = pack_of("path"), (WEIGHT, X, X)
    right = build.bits(41.0, args)
    for said, fits in ((right, True), (build.bits(np.nextafter(41.0, 42.0).item(), args), False)):
        file = tmp_path / "proof"
        file.write_bytes(pickle.dumps(("path", pack, [(product.name, args, said)])))
        words = [sys.executable, "-m", "der.packs.build", "--prove", str(file)]
        done = subprocess.run(words, capture_output=True, text=True)
        assert (done.returncode == 0) is fits
        assert fits or f"{product.name} gives other results" in done.stderr


@pytest.mark.parametrize(("packs", "said"), [("off", 0), ("empty", 1)])
def test_without_packs_numba_compiles(packs, said, tmp_path):
    """Where they are not wanted, or could not be built: at most one line, and the same number."""
    if packs == "empty":
        pack = pack_of("path")._replace(entries=[], code=b"", known=[])
        load.write(tmp_path / load.file_name("path"), pack)
    code = (
        "import numpy as np\nfrom der.rod.manifold import product\n"
        "x = np.array([3.0, 4.0])\nprint(product(np.array([1.0, 2.0]), x, x))"
    )
    env = os.environ | {"DER_PACKS": packs if packs == "off" else str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True)
    assert done.stdout == "41.0\n"
    assert done.stderr.count("\n") <= said
