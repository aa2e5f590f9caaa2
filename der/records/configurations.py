"""The shapes of a ring at every state of a path, its motion in snaps, and its softest modes.

Free of kernels, like the record of the path. They are saved in a file of their own, as npz.
"""

from __future__ import annotations

import math
import os
import re
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import BinaryIO

import numpy as np
from numpy.lib import format as npy

from der.utils import checks
from der.utils.checks import Array
from der.utils.files import FilePath, opened, write_whole

LARGEST = 2**28  # bytes of arrays that are read from a smaller file


@dataclass(frozen=True, eq=False)
class Fall:
    """How the ring moves in a snap: configurations in their order, none of them an equilibrium.

    Raises
    ------
    ValueError
        If an array has a wrong shape, or a value is not finite.
    """

    after: int  # position in the path of the state that it leaves
    gamma: Array  # (k,) rad
    energy: Array  # (k,) GJ/a, of the full ring
    x: Array  # (k, N, 3) vertices, a
    frames: Array  # (k, N, 3, 3) material frames of the edges, rows d1, d2, d3

    def __post_init__(self) -> None:
        object.__setattr__(self, "after", checks.count("after of a fall", self.after))
        k, n_v, _ = _keep(self, "x of a fall", "x", ("k", "N", 3)).shape
        _keep(self, "frames of a fall", "frames", (k, n_v, 3, 3))
        for name in ("gamma", "energy"):
            _keep(self, f"{name} of a fall", name, (k,))


@dataclass(frozen=True, eq=False)
class Softest:
    """The softest mode of each symmetry class at every state, and the ring displaced by one.

    Raises
    ------
    ValueError
        If an array has a wrong shape, or a value is not finite.
    """

    classes: tuple[str, ...]  # (m,) names
    eigenvalues: Array  # (n, m) stiffness per length, GJ/a^2
    u: Array  # (n, N, 3) displacements of the vertices in the softest of these modes, any scale

    def __post_init__(self) -> None:
        classes = checks.each("classes of the modes", self.classes, checks.text)
        object.__setattr__(self, "classes", tuple(classes))
        n, _, _ = _keep(self, "u of the modes", "u", ("n", "N", 3)).shape
        _keep(self, "eigenvalues of the modes", "eigenvalues", (n, len(classes)))


@dataclass(frozen=True, eq=False)
class Internal:
    """Force, moment and strains along the ring at every state; signs as in `records.forces`.

    Raises
    ------
    ValueError
        If an array has a wrong shape, or a value is not finite.
    """

    force: Array  # (n, N, 3) at the vertices, along E1, E2, E3, GJ/a^2
    moment: Array  # (n, N, 3) likewise, GJ/a
    curvature: Array  # (n, N, 3) k1, k2 and twist k3 at the vertices, 1/a
    stretch: Array  # (n, N) strain of the edges

    def __post_init__(self) -> None:
        n, n_v, _ = _keep(self, "force along the ring", "force", ("n", "N", 3)).shape
        for name in ("moment", "curvature"):
            _keep(self, f"{name} along the ring", name, (n, n_v, 3))
        _keep(self, "stretch along the ring", "stretch", (n, n_v))


@dataclass(frozen=True, eq=False, repr=False)
class Shapes:
    """The full ring at every state of a path.

    Parameters
    ----------
    x : (n, N, 3) array
        Vertex positions, a.
    frames : (n, N, 3, 3) array
        Material frames, per edge; rows d1, d2, d3.
    falls : how the ring moves in its snaps, where that was kept.
    softest : its softest modes, where they were asked for.
    arc_length : (N,) array
        Arc lengths of the frames from the first grip, a; None where they are evenly spaced.
    internal : force, moment and strains along the ring, where they were asked for.

    Raises
    ------
    ValueError
        If an array has a wrong shape, a value is not finite, or a snap starts from no state.
    """

    x: Array
    frames: Array
    falls: tuple[Fall, ...] = ()
    softest: Softest | None = None
    arc_length: Array | None = None
    internal: Internal | None = None

    def __post_init__(self) -> None:
        n, n_v, _ = _keep(self, "x", "x", ("n", "N", 3)).shape
        _keep(self, "frames", "frames", (n, n_v, 3, 3))
        if self.arc_length is not None:
            _keep(self, "arc_length", "arc_length", (n_v,))
        object.__setattr__(self, "falls", tuple(self.falls))
        for fall in self.falls:
            if fall.x.shape[1] != n_v:
                raise ValueError(f"a fall must be of {n_v} vertices, got {fall.x.shape[1]}")
            if fall.after >= n:
                raise ValueError(f"after of a fall must be a state, below {n}, got {fall.after}")
        if self.softest is not None and self.softest.u.shape != self.x.shape:
            raise ValueError(
                f"u of the modes must have shape {self.x.shape}, got {self.softest.u.shape}"
            )

        if self.internal is not None and self.internal.force.shape != self.x.shape:
            raise ValueError(
                f"force along the ring must have shape {self.x.shape}, "
                f"got {self.internal.force.shape}"
            )

    def __repr__(self) -> str:
        states, vertices, _ = self.x.shape
        return f"Shapes({states} states, {vertices} vertices, {len(self.falls)} snaps)"

    def save(self, path: FilePath) -> None:
        """Write npz, atomically.

        Raises
        ------
        OSError
            If the file cannot be written; one already there is then unharmed.
        """
        arrays = {"x": self.x, "frames": self.frames}
        if self.arc_length is not None:
            arrays["arc_length"] = self.arc_length
        if self.softest is not None:
            arrays |= _named("softest", self.softest)
        if self.internal is not None:
            arrays |= _named("internal", self.internal)
        for k, fall in enumerate(self.falls):
            arrays |= _named(f"falls/{k}", fall)
        write_whole(path, lambda file: np.savez(file, **arrays))  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: FilePath) -> Shapes:
        """Shapes of an npz file.

        Raises
        ------
        OSError
            If the file cannot be read.
        ValueError
            If it is broken, too large, or not such a file.
        """
        with opened(path) as file:
            try:
                arrays = _arrays(file)
                x, frames, places = arrays["x"], arrays["frames"], arrays.get("arc_length")
                falls, modes, inside = _falls(arrays), _softest(arrays), _internal(arrays)
            except Exception as problem:  # zipfile and numpy raise some ten classes on broken files
                why = checks.short(str(problem))
                raise ValueError(
                    f"{os.fspath(path)}: no shapes.npz as --out writes ({why})"
                ) from problem
        try:
            return cls(x, frames, falls, modes, places, inside)
        except ValueError as problem:
            raise ValueError(f"{os.fspath(path)}: {problem}") from problem


def _keep(record: object, called: str, name: str, shape: tuple[int | str, ...]) -> Array:
    """Replace an array of a frozen record by its checked copy, read-only."""
    array = checks.checked_array(called, getattr(record, name), shape)
    array.setflags(write=False)
    object.__setattr__(record, name, array)
    return array


def _arrays(file: BinaryIO) -> dict[str, Array]:
    """The arrays of an npz file that shapes have, by name; others are not read.

    `Shapes.save` does not compress: what unpacks to more than its file, and is large, is refused.
    """
    allowed = max(LARGEST, file.seek(0, os.SEEK_END))
    with zipfile.ZipFile(file) as archive:
        parts = {part.filename.removesuffix(".npy"): part for part in archive.infolist()}
        parts = {name: part for name, part in parts.items() if _NAMES.fullmatch(name)}
        size = sum(part.file_size for part in parts.values())
        if size > allowed:
            raise ValueError(f"arrays of {size} bytes, and {allowed} are allowed")
        return {name: _array(archive, part) for name, part in parts.items()}


def _array(archive: zipfile.ZipFile, part: zipfile.ZipInfo) -> Array:
    """One array, whose header must say its size: numpy makes room for it before it reads."""
    with archive.open(part) as content:
        version = npy.read_magic(content)
        headers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
        shape, _, kind = headers[version](content)
        size = content.tell() + math.prod(shape) * kind.itemsize
        if kind.hasobject or size != part.file_size:
            raise ValueError(f"{part.filename} is no array of {part.file_size} bytes")
        content.seek(0)
        found: Array = npy.read_array(content, allow_pickle=False)
        return found


def _named(prefix: str, record: Fall | Softest | Internal) -> dict[str, Array]:
    """The entries of a record as arrays of the file."""
    return {f"{prefix}/{name}": np.asarray(value) for name, value in vars(record).items()}


_PARTS = {r"falls/\d{1,6}": Fall, "softest": Softest, "internal": Internal}
_NAMES = re.compile(
    "|".join(
        ["x", "frames", "arc_length"]
        + [f"{part}/{entry.name}" for part, kind in _PARTS.items() for entry in fields(kind)]
    )
)


def _falls(arrays: Mapping[str, Array]) -> tuple[Fall, ...]:
    """The falls in a file."""
    names = [entry.name for entry in fields(Fall)]
    found: list[Fall] = []
    while f"falls/{len(found)}/x" in arrays:
        entries = {name: arrays[f"falls/{len(found)}/{name}"] for name in names}
        found.append(Fall(**entries | {"after": entries["after"].item()}))  # type: ignore[arg-type]
    return tuple(found)


def _softest(arrays: Mapping[str, Array]) -> Softest | None:
    """The softest modes in a file, if there are any."""
    if "softest/u" not in arrays:
        return None
    entries = {entry.name: arrays[f"softest/{entry.name}"] for entry in fields(Softest)}
    return Softest(**entries | {"classes": entries["classes"].tolist()})


def _internal(arrays: Mapping[str, Array]) -> Internal | None:
    """Force, moment and strains in a file, if there are any."""
    if "internal/force" not in arrays:
        return None
    return Internal(**{entry.name: arrays[f"internal/{entry.name}"] for entry in fields(Internal)})
