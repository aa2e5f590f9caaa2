"""Nothing is loaded before it is needed, and every public name is where it is said to be."""

import importlib
import json
import pkgutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import der

CLONE = Path(__file__).parent.parent
NOT_IMPORTED = ("__main__", "hatch_build")  # a command, and what only a build imports
MODULES = [
    one.name
    for one in pkgutil.walk_packages(der.__path__, "der.")
    if one.name.split(".")[-1] not in NOT_IMPORTED
]


def loaded(code, *names):
    """Which of the named modules a fresh Python has loaded after running ``code``."""
    ask = f"import json, sys\n{code}\nprint(json.dumps([n for n in {names!r} if n in sys.modules]))"
    command = [sys.executable, "-c", ask]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=CLONE)
    return json.loads(done.stdout.splitlines()[-1])


# --- What is loaded --------------------------------------------------------------------------


def test_import_der_is_free():
    """`import der` loads neither numpy nor numba; names are looked up when used."""
    assert loaded("import der", "numpy", "numba", "scipy", "matplotlib", "typer") == []


def test_a_scene_is_stated_without_kernels():
    """Stating the problem, section and ring and all, compiles and loads no numba."""
    state = "import der\nder.Scene(der.circle(), der.rectangular_section(4.0))"
    assert loaded(state, "numba", "matplotlib", "typer") == []


def test_a_record_is_read_without_kernels():
    """The record is readable where nothing of the engine is."""
    assert loaded("import der.records.path, der.records.text", "numba", "scipy", "matplotlib") == []


def test_help_loads_no_numerics():
    """`der --help` answers at once: no numba, scipy or matplotlib behind it."""
    ask = (
        "from der.cli.commands import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass"
    )
    assert loaded(ask, "numba", "scipy", "matplotlib", "numpy", "rerun") == []


def test_a_wrong_option_loads_no_kernels():
    """Bad input is refused at the door, before anything is compiled."""
    ask = (
        "from der.cli.commands import main\n"
        "try:\n    main(['fold', 'circle', '--h-over-t', '0'])\nexcept SystemExit:\n    pass"
    )
    assert loaded(ask, "numba", "matplotlib") == []


def test_a_fold_without_a_plot_loads_no_matplotlib():
    """What is not asked for is not imported."""
    ask = (
        "from der.cli.commands import main\n"
        "try:\n    main('fold circle --h-over-t 4 --edges 16 --gamma-max 0.1'.split())\n"
        "except SystemExit as left:\n    assert left.code == 0"
    )
    assert loaded(ask, "matplotlib", "PIL", "rich", "rerun", "plotly") == []


# --- Names -----------------------------------------------------------------------------------


def test_no_module_has_the_name_of_a_public_function():
    """Importing der.fold the module would replace der.fold the function."""
    modules = {module.name for module in pkgutil.iter_modules(der.__path__)}
    assert not modules & set(der.__all__)


@pytest.mark.parametrize("name", sorted(set(der.__all__) - {"__version__"}))
def test_public_names_are_where_they_are_said_to_be(name):
    """Every name of __all__ resolves, and stays what it is once every module has been imported."""
    before = getattr(der, name)
    for module in MODULES:
        importlib.import_module(module)
    assert getattr(der, name) is before


def test_an_unknown_name_is_refused_like_any_attribute():
    """AttributeError, so that hasattr and typos behave."""
    with pytest.raises(AttributeError, match="module 'der' has no attribute 'fould'"):
        _ = der.fould


def test_scene_and_rod_mean_the_same_measures():
    """scene.MEASURES are the measures that rod() takes, by the number that kernels read."""
    from der.rod.rod import discrete_rod
    from der.scene import MEASURES

    rods = [
        discrete_rod(np.ones(3), np.zeros(3), (1.0, 1.0, 1.0), measure=name) for name in MEASURES
    ]
    assert [rod.measure for rod in rods] == list(range(len(MEASURES)))


def test_rod_refuses_a_measure_that_scene_does_not_know():
    """And no other."""
    from der.rod.rod import discrete_rod

    with pytest.raises(ValueError, match="curvature must be one of logarithm, angle, tangent"):
        discrete_rod(np.ones(3), np.zeros(3), (1.0, 1.0, 1.0), measure="sine")
