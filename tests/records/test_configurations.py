"""Shapes, falls and softest modes come back from disk bit for bit, and refuse what is none."""

import io
import os
import tracemalloc
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from der.records.configurations import Fall, Shapes, Softest


def shapes(n=4):
    rng = np.random.default_rng(1)
    return Shapes(x=rng.normal(size=(n, 5, 3)), frames=rng.normal(size=(n, 5, 3, 3)))


def fall(after=1, k=7, n_v=5):
    rng = np.random.default_rng(2)
    sizes = ((k,), (k,), (k, n_v, 3), (k, n_v, 3, 3))
    return Fall(after, *(rng.normal(size=size) for size in sizes))


def softest(n=4, n_v=5):
    rng = np.random.default_rng(3)
    return Softest(("in phase", "odd"), rng.normal(size=(n, 2)), rng.normal(size=(n, n_v, 3)))


@pytest.mark.parametrize("name", ["shapes.npz", "shapes"])
def test_shapes_come_back_bit_for_bit(tmp_path, name):
    """Under exactly the name given: numpy would add .npz to one without it."""
    before = shapes()
    before.save(tmp_path / name)
    after = Shapes.load(tmp_path / name)
    assert after.x.tobytes() == before.x.tobytes()
    assert after.frames.tobytes() == before.frames.tobytes()
    assert os.listdir(tmp_path) == [name]


@pytest.mark.parametrize("content", [b"", b"text", b"PK\x03\x04 cut short"])
def test_broken_shapes_are_refused_by_name(tmp_path, content):
    (tmp_path / "broken.npz").write_bytes(content)
    with pytest.raises(ValueError, match=r"broken\.npz"):
        Shapes.load(tmp_path / "broken.npz")


def test_damaged_shapes_are_refused_by_name(tmp_path):
    """One flipped byte in the numbers is seen by the checksum."""
    file = tmp_path / "broken.npz"
    shapes().save(file)
    content = bytearray(file.read_bytes())
    content[300] ^= 0xFF
    file.write_bytes(content)
    with pytest.raises(ValueError, match=r"broken\.npz"):
        Shapes.load(file)


def test_other_arrays_are_not_shapes(tmp_path):
    np.savez(tmp_path / "other.npz", y=np.zeros(3))
    with pytest.raises(ValueError, match=r"other\.npz"):
        Shapes.load(tmp_path / "other.npz")


@pytest.mark.parametrize(("x", "frames"), [((4, 5, 2), (4, 5, 3, 3)), ((4, 5, 3), (4, 6, 3, 3))])
def test_shapes_of_another_shape_are_refused(x, frames):
    with pytest.raises(ValueError, match="shape"):
        Shapes(np.zeros(x), np.zeros(frames))


def test_falls_and_modes_come_back_bit_for_bit(tmp_path):
    """Falls of different lengths, in their order; names of symmetries."""
    before = replace(shapes(), falls=(fall(), fall(after=2, k=3)), softest=softest())
    before.save(tmp_path / "shapes.npz")
    after = Shapes.load(tmp_path / "shapes.npz")
    assert [one.after for one in after.falls] == [1, 2]
    for one, other in zip(before.falls, after.falls, strict=True):
        for name in ("gamma", "energy", "x", "frames"):
            assert_array_equal(getattr(one, name), getattr(other, name), strict=True)
    assert after.softest.classes == ("in phase", "odd")
    assert_array_equal(after.softest.eigenvalues, before.softest.eigenvalues, strict=True)
    assert_array_equal(after.softest.u, before.softest.u, strict=True)


def rewritten(file, change, how=zipfile.ZIP_STORED):
    """The file of shapes with its parts changed: a dict of bytes by name."""
    shapes().save(file)
    with zipfile.ZipFile(file) as old:
        parts = {name: old.read(name) for name in old.namelist()}
    change(parts)
    with zipfile.ZipFile(file, "w", how) as new:
        for name, content in parts.items():
            new.writestr(name, content)


def npy(values):
    """An array as a part of an npz file."""
    content = io.BytesIO()
    np.save(content, values)
    return content.getvalue()


@pytest.fixture
def small_memory():
    """At most 64 MB more than before can be had at a time while a file is read."""
    tracemalloc.start()
    yield
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2**26


def test_shapes_that_unpack_to_much_more_are_not_unpacked(tmp_path, small_memory):
    """3.2 MB became 3.1 GB."""
    bomb = npy(np.zeros((1, 5, 3))).replace(b"(1, 5, 3)", b"(2400000,5,3)")[:128]
    file = tmp_path / "bomb.npz"
    shapes().save(file)
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as new, new.open("x.npy", "w") as part:
        part.write(bomb)
        for _ in range(36):
            part.write(bytes(8_000_000))
    assert file.stat().st_size < 1e6
    with pytest.raises(
        ValueError, match=r"bomb\.npz: .*288000128 bytes, and 268435456 are allowed"
    ):
        Shapes.load(file)


def test_compressed_shapes_come_back(tmp_path):
    """Of a usual size; and from a file of more than is read of a small one."""
    rewritten(tmp_path / "shapes.npz", lambda parts: None, zipfile.ZIP_DEFLATED)
    assert_array_equal(Shapes.load(tmp_path / "shapes.npz").x, shapes().x, strict=True)


def test_large_shapes_come_back(tmp_path, monkeypatch):
    """As they are saved, without compression, no size is too large."""
    monkeypatch.setattr("der.records.configurations.LARGEST", 1000)
    shapes().save(tmp_path / "shapes.npz")
    assert_array_equal(Shapes.load(tmp_path / "shapes.npz").x, shapes().x, strict=True)


def test_arrays_of_other_names_are_not_read(tmp_path):
    """Neither one that numpy would not read, nor a pickle, nor one outside the folder."""
    others = {"y.npy": b"?", "z.npy": b"cos\nsystem\n", "../x.npy": b"", "falls/x/x.npy": b""}
    rewritten(tmp_path / "shapes.npz", lambda parts: parts.update(others))
    assert_array_equal(Shapes.load(tmp_path / "shapes.npz").x, shapes().x, strict=True)


@pytest.mark.parametrize(
    "content",
    [
        npy(np.zeros((4, 5, 3))).replace(b"(4, 5, 3), }   ", b"(4, 5, 999999),}"),
        npy(np.zeros((4, 5, 3))).replace(b"(4, 5, 3), }", b"(4, 5, -3),}"),
        npy(np.zeros((4, 5, 3)))[:-8],
        npy(np.zeros((4, 5, 3)) + 1e300),
        npy(np.zeros((4, 5, 3)) * 1j),
        npy(np.full((4, 5, 3), None, dtype=object)),
        b"\x93NUMPY\x09\x00",
        b"",
    ],
)
def test_array_that_is_not_what_its_header_says_is_refused(tmp_path, content, small_memory):
    """In one line, and before room is made for it."""
    rewritten(tmp_path / "wrong.npz", lambda parts: parts.update({"x.npy": content}))
    with pytest.raises(ValueError, match=r"wrong\.npz") as refused:
        Shapes.load(tmp_path / "wrong.npz")
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 600


def test_shapes_are_short_in_print():
    assert repr(shapes()) == "Shapes(4 states, 5 vertices, 0 snaps)"


def test_nothing_more_comes_back_than_was_kept(tmp_path):
    shapes().save(tmp_path / "shapes.npz")
    after = Shapes.load(tmp_path / "shapes.npz")
    assert (after.falls, after.softest) == ((), None)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda: fall(after=-1), "after of a fall must be an integer >= 0, got -1"),
        (lambda: replace(fall(), x=np.zeros((7, 5))), "x of a fall must be an array of numbers"),
        (lambda: replace(fall(), gamma=np.zeros(6)), r"gamma of a fall must have shape \(7,\)"),
        (lambda: replace(shapes(), falls=(fall(after=4),)), "after of a fall .* below 4, got 4"),
        (lambda: replace(shapes(), falls=(fall(n_v=6),)), "a fall must be of 5 vertices, got 6"),
        (
            lambda: replace(softest(), classes=("all",)),
            r"eigenvalues .* shape \(4, 1\), got \(4, 2\)",
        ),
        (
            lambda: replace(shapes(), softest=softest(n=3)),
            r"u of the modes .* \(4, 5, 3\), got \(3,",
        ),
        (lambda: replace(softest(), u=np.full((4, 5, 3), np.nan)), "u of the modes must be finite"),
    ],
)
def test_what_does_not_fit_is_named(wrong, words):
    with pytest.raises(ValueError, match=words):
        wrong()
