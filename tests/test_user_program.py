"""The program of a user runs, and the public face is what it says."""

import importlib
import math
import pathlib

import pytest
import user_program

import der

FUNCTIONS = (
    *("fold", "solve_bvp", "compare", "landscape", "energy_surface", "barrier", "least_push"),
    *("states", "planar", "squeeze", "packing_ratio", "phase_diagram"),
)


def test_the_program_of_a_user_runs(tmp_path):
    """A circle at h/t = 4 folds stably, packs to 1/9, and both solvers agree."""
    found = user_program.answer(der.circle(), 4.0, tmp_path)
    assert found.foldable
    assert found.fold_gammas == ()
    assert found.peak_moment == pytest.approx(1.478, abs=0.01)
    assert 0.0 < found.barrier < 0.05
    assert found.packing == pytest.approx(1.0 / 9.0, abs=1e-6)
    assert found.agreement > 0.9
    assert "flat" in found.minima
    assert (tmp_path / "path.png").exists()


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_public_function_has_its_name_where_it_lives(name):
    """So that a traceback, a search and the documentation show one name."""
    public = getattr(der, name)
    assert public.__name__ == name
    assert getattr(importlib.import_module(public.__module__), name) is public


def test_the_package_says_its_version_and_that_it_has_types():
    assert math.prod(int(part) >= 0 for part in der.__version__.split(".")[:2])
    assert (pathlib.Path(der.__file__).parent / "py.typed").exists()


def test_every_public_name_is_there():
    """And listed once."""
    assert len(set(der.__all__)) == len(der.__all__)
    assert all(hasattr(der, name) for name in der.__all__)
