"""Data flows one way through the house, and nothing is loaded before it is needed."""

import ast
import importlib
import json
import pkgutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import der

HOUSE = Path(__file__).parent.parent

# Rooms from the ground up; within a room a module may import those before it.
ROOMS = {
    "statement": (
        "checks",
        "outline",
        "profiles",
        "ring",
        "profile_files",
        "sites",
        "sections",
        "scene",
    ),
    "answer": (
        "files",
        "shapes",
        "record",
        "unfinished",
        "landscape_files",
        "landscape_record",
        "landscape_surface_record",
        "landscape_push_record",
        "states_record",
        "planar_record",
    ),
    "kernels": ("frames", "strain", "dense", "block_ldl", "linking", "assembly", "planar_rod"),
    "engine": (
        "rod",
        "supports",
        "stability",
        "sector",
        "equilibrium",
        "chords",
        "step",
        "passages",
        "branches",
        "turns",
        "special",
        "path",
        "forces",
        "masses",
        "relaxation",
        "implicit",
        "falls",
        "gradient_flow",
        "motion",
        "snap",
        "control",
        "trail",
        "relaxed_march",
        "restriction",
        "matching",
        "moved_folds",
        "error_bars",
        "unfolding",
        "folding",
        "landscape_alone",
        "landscape_bars",
        "landscape_rests",
        "landscape_curve",
        "landscape_flood",
        "landscape_surface",
        "landscape_saddles",
        "landscape_free",
        "landscape_over",
        "landscape_tools",
        "landscape_march",
        "landscape_push_search",
        "landscape_push",
        "states_images",
        "states_deflation",
        "states_starts",
        "states_basins",
        "states_measures",
        "states_search",
        "planar_march",
        "planar_ring",
        "planar_area",
        "planar_states",
        "planar_squeeze",
    ),
    "film": ("curve", "film", "captions", "ribbon", "panel", "projection", "tween"),
    "layout": (
        "view_layout",
        "view_reel",
        "view_panels",
        "view_terrain",
        "view_style",
        "view_arrows",
    ),
    "views": (
        "summary",
        "view_plots",
        "view_rerun",
        "view_landscape",
        "view_surface",
        "view_movie",
        "view_html",
        "view_states",
        "view_push",
        "view_planar",
    ),
    "roof": (
        "output",
        "drawings",
        "landscape_words",
        "states_words",
        "planar_words",
        "cli_options",
        "cli_answers",
        "cli",
        "__main__",
    ),
}
# What each room may import from besides itself.
BELOW = {
    "statement": (),
    "answer": ("statement",),
    "kernels": (),
    "engine": ("statement", "answer", "kernels"),
    "film": ("statement", "answer"),
    "layout": ("statement", "answer", "film"),
    "views": ("statement", "answer", "film", "layout"),
    "roof": ("statement", "answer", "engine", "layout", "views"),
}
ROOM = {module: room for room, modules in ROOMS.items() for module in modules}
# of validation: they time the engine, so they see all of it
BENCHES = {
    "bench",
    "bench_cited",
    "bench_cold",
    "bench_elastica",
    "bench_methods",
    "bench_needs",
    "bench_orders",
    "bench_paths",
    "bench_plot",
    "bench_rings",
    "bench_rows",
    "bench_scaling",
    "bench_state",
    "bench_stepping",
    "bench_sweep",
    "stress",
    "stress_kinds",
}


class Import(NamedTuple):
    """One imported module, and where: inside a function, under TYPE_CHECKING, or on top."""

    module: str
    where: str
    line: int


def imports(file):
    """All modules that a file imports, at any depth; `der.fold` counts as import of its home."""
    found = []

    def visit(node, where):
        if isinstance(node, ast.Import):
            found.extend(Import(alias.name, where, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}:{node.lineno}: a relative import"
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                name = inner if node.module in ("der", "validation", "scenarios") else node.module
                found.append(Import(at_home(name), where, node.lineno))
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.value.id == "der":
                found.append(Import(at_home(f"der.{node.attr}"), where, node.lineno))
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            where = "function"
        elif isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            where = "types" if where == "top" else where
        for child in ast.iter_child_nodes(node):
            visit(child, where)

    visit(ast.parse(file.read_text()), "top")
    return found


def at_home(name):
    """The module in which a public name of der lives: der.fold -> der.folding.fold."""
    package, _, public = name.partition(".")
    homes = [f"der.{home}.{public}" for home, names in der._HOME.items() if public in names]
    return homes[0] if package == "der" and homes else name


def files(package):
    return sorted((HOUSE / package).rglob("*.py"))


def part(found):
    """The module of der that an import reaches, "" if none."""
    package, *rest = found.module.split(".")
    return rest[0] if package == "der" and rest else ""


def named(file, found):
    return f"{file.relative_to(HOUSE)}:{found.line} imports {found.module}"


def users(*packages):
    """Files that import one of these packages, with the imports."""
    return {
        str(file.relative_to(HOUSE)): found
        for package in ("der", "scenarios", "validation")
        for file in files(package)
        if (found := [i for i in imports(file) if i.module.split(".")[0] in packages])
    }


def loaded(code, *names):
    """Which of the named modules a fresh Python has loaded after running ``code``."""
    ask = f"import json, sys\n{code}\nprint(json.dumps([n for n in {names!r} if n in sys.modules]))"
    command = [sys.executable, "-c", ask]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=HOUSE)
    return json.loads(done.stdout.splitlines()[-1])


# --- Directions ------------------------------------------------------------------------------


def test_every_module_has_a_room():
    """A module that no room knows would escape the checks below."""
    there = {file.stem for file in files("der")} - {"__init__"}
    assert there == set(ROOM)


@pytest.mark.parametrize("module", sorted(ROOM))
def test_modules_import_only_what_lies_below(module):
    """Statement -> engine -> answer -> film -> views -> roof; never up, never sideways."""
    room = ROOM[module]
    allowed = set(ROOMS[room][: ROOMS[room].index(module)])
    allowed.update(*(ROOMS[below] for below in BELOW[room]))
    if room == "views":
        allowed -= set(ROOMS["views"])
    file = HOUSE / "der" / f"{module}.py"
    wrong = [named(file, i) for i in imports(file) if part(i) and part(i) not in allowed]
    assert not wrong


def test_scan_sees_an_import_from_the_wrong_floor(tmp_path):
    """The check above can fail: imports in functions, `from der import x` and `der.x` are seen."""
    file = tmp_path / "wrong.py"
    file.write_text(
        "import der\nfrom der import assembly, circle\n"
        "def f():\n    import der.path\n    return der.fold\n"
    )
    assert [(part(i), i.where) for i in imports(file) if part(i)] == [
        ("assembly", "top"),
        ("ring", "top"),
        ("path", "function"),
        ("folding", "function"),
    ]


def test_package_imports_its_names_when_they_are_used():
    """`der/__init__` imports modules of der for the type checker only: `import der` is free."""
    wrong = [i for i in imports(HOUSE / "der/__init__.py") if part(i) and i.where != "types"]
    assert not wrong


def test_modules_are_not_imported_by_text_but_in_the_package():
    """import_module and __import__ would escape the scan; only the packages' own files use them."""
    for file in {*files("der"), *files("scenarios"), *files("validation")}:
        nodes = list(ast.walk(ast.parse(file.read_text())))
        words = {node.id for node in nodes if isinstance(node, ast.Name)}
        words |= {node.attr for node in nodes if isinstance(node, ast.Attribute)}
        if file not in (HOUSE / "der/__init__.py", HOUSE / "validation/__init__.py"):
            assert not words & {"import_module", "__import__"}, file


@pytest.mark.parametrize(
    "file", [f for f in files("validation") if f.stem not in BENCHES], ids=lambda file: file.stem
)
def test_validation_knows_only_the_statement_and_the_answer(file):
    """Else the two solvers would not be independent; benches time the engine and may use it.

    The words of a summary, and the curve through a record's states, are part of the answer.
    """
    allowed = {*ROOMS["statement"], *ROOMS["answer"], "summary", "curve"}
    assert not [named(file, i) for i in imports(file) if part(i) and part(i) not in allowed]


@pytest.mark.parametrize(
    "file", [f for f in files("validation") if f.stem not in BENCHES], ids=lambda file: file.stem
)
def test_nothing_in_validation_leans_on_a_bench(file):
    """Through a bench the engine would come in by the back door."""
    reached = [(i, i.module.split(".")) for i in imports(file)]
    wrong = [named(file, i) for i, (package, *rest) in reached if BENCHES & set(rest[:1])]
    assert not wrong


@pytest.mark.parametrize(
    "file", [*files("validation"), *files("scenarios")], ids=lambda file: f"{file.parts[-2:]}"
)
def test_nothing_but_the_command_imports_the_roof(file):
    """der/cli.py imports scenarios and validation, so neither imports it."""
    assert not [named(file, i) for i in imports(file) if ROOM.get(part(i)) == "roof"]


def test_validation_does_not_import_scenarios():
    """Scenarios are experiments with the engine: sideways from the other solver."""
    assert not [file for file in users("scenarios") if file.startswith("validation")]


def test_only_commands_import_validation_and_scenarios():
    """Of der, cli.py alone, and there inside its functions, so that the engine stands alone."""
    found = {f: i for f, i in users("validation", "scenarios").items() if f.startswith("der/")}
    assert set(found) <= {"der/cli.py"}
    assert {i.where for i in found.get("der/cli.py", [])} <= {"function", "types"}


# --- Foreign packages ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("package", "allowed"),
    [
        ("typer", {"der/cli.py", "der/cli_options.py"}),
        ("click", set()),
        ("rich", {"der/cli_answers.py", "validation/figures/drawing.py", "validation/scan.py"}),
        (
            "matplotlib",
            {
                "der/view_landscape.py",
                "der/view_movie.py",
                "der/view_planar.py",
                "der/view_plots.py",
                "der/view_push.py",
                "der/view_states.py",
                "der/view_style.py",
                "der/view_surface.py",
                "scenarios/hysteresis_plot.py",
                "scenarios/states_plot.py",
                "validation/comparison_plot.py",
                "validation/figures/canvas.py",
                "validation/packing_figures.py",
                "validation/phase_plot.py",
            },
        ),
        (
            "rerun",
            {
                "der/view_layout.py",
                "der/view_panels.py",
                "der/view_reel.py",
                "der/view_rerun.py",
                "der/view_terrain.py",
            },
        ),
        ("plotly", {"der/view_html.py"}),
        ("elastica", {"validation/bench_elastica.py"}),
        ("dask", set()),
        ("distributed", {"validation/bench_phase.py", "validation/workers.py"}),
    ],
)
def test_shell_packages_stay_in_their_files(package, allowed):
    """matplotlib and its like are imported only by the file that draws or sends."""
    assert set(users(package)) == allowed


def test_rich_is_imported_only_when_progress_is_shown():
    """A quiet run, or one whose errors go to a file, does not pay for it."""
    assert {i.where for i in users("rich")["der/cli_answers.py"]} == {"function"}


@pytest.mark.parametrize(
    "module",
    [m for room in ROOMS if room not in ("kernels", "engine", "roof") for m in ROOMS[room]],
)
def test_statement_answer_and_views_have_no_kernels(module):
    """They load without numba, so that a record can be read where nothing is compiled."""
    assert "numba" not in {i.module.split(".")[0] for i in imports(HOUSE / f"der/{module}.py")}


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
    assert loaded("import der.record, der.summary", "numba", "scipy", "matplotlib") == []


def test_help_loads_no_numerics():
    """`der --help` answers at once: no numba, scipy or matplotlib behind it."""
    ask = "from der.cli import main\ntry:\n    main(['--help'])\nexcept SystemExit:\n    pass"
    assert loaded(ask, "numba", "scipy", "matplotlib", "numpy", "rerun") == []


def test_a_wrong_option_loads_no_kernels():
    """Bad input is refused at the door, before anything is compiled."""
    ask = (
        "from der.cli import main\n"
        "try:\n    main(['fold', 'circle', '--h-over-t', '0'])\nexcept SystemExit:\n    pass"
    )
    assert loaded(ask, "numba", "matplotlib") == []


def test_a_fold_without_a_plot_loads_no_matplotlib():
    """What is not asked for is not imported."""
    ask = (
        "from der.cli import main\n"
        "try:\n    main('fold circle --h-over-t 4 --edges 16 --gamma-max 0.1'.split())\n"
        "except SystemExit as left:\n    assert left.code == 0"
    )
    assert loaded(ask, "matplotlib", "PIL", "rich", "rerun", "plotly") == []


# --- Names -----------------------------------------------------------------------------------


def test_no_module_has_the_name_of_a_public_function():
    """Importing der.fold the module would replace der.fold the function."""
    modules = {module.name for module in pkgutil.iter_modules(der.__path__)}
    assert not modules & set(der.__all__)


@pytest.mark.parametrize("name", der.__all__)
def test_public_names_are_where_they_are_said_to_be(name):
    """Every name of __all__ resolves, and stays what it is once every module has been imported."""
    before = getattr(der, name)
    for module in ROOM:
        if module != "__main__":
            importlib.import_module(f"der.{module}")
    assert getattr(der, name) is before
    assert before.__name__ == name


def test_an_unknown_name_is_refused_like_any_attribute():
    """AttributeError, so that hasattr and typos behave."""
    with pytest.raises(AttributeError, match="module 'der' has no attribute 'fould'"):
        _ = der.fould


def test_scene_and_rod_mean_the_same_measures():
    """scene.MEASURES are the measures that rod() takes, by the number that kernels read."""
    from der.rod import rod
    from der.scene import MEASURES

    bodies = [rod(np.ones(3), np.zeros(3), (1.0, 1.0, 1.0), measure=name) for name in MEASURES]
    assert [body.measure for body in bodies] == list(range(len(MEASURES)))


def test_rod_refuses_a_measure_that_scene_does_not_know():
    """And no other."""
    from der.rod import rod

    with pytest.raises(ValueError, match="curvature must be one of logarithm, angle, tangent"):
        rod(np.ones(3), np.zeros(3), (1.0, 1.0, 1.0), measure="sine")
