"""The plan of the house, enforced: layers, owners of third-party libraries, one conversion table, names."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[1] / "src" / "finback"
MODULES = sorted(path for path in SOURCE.rglob("*.py"))

# A room may import rooms of a lower level only, and itself.
LEVELS = {
    "errors": 0,
    "digits": 0,
    "units": 0,
    "arrays": 0,
    "channels": 0,
    "files": 0,
    "records": 1,
    "dynamics": 1,
    "flight": 2,
    "formats": 2,
    "identification": 2,
    "validation": 3,
    "study": 4,  # reads the option types of validation
    "store": 5,
    "views": 5,
    "campaign": 6,
    "pipeline": 7,
    "cli": 8,
}
# Within level 0 the order is errors < units, arrays < channels; elsewhere rooms of one level are strangers.
LEVEL_0_ORDER = ("errors", "digits", "arrays", "files", "units", "channels")
FORBIDDEN_PAIRS = {
    ("dynamics", "channels"): "mathematics knows no aircraft",
    ("dynamics", "records"): "mathematics knows no flight",
    ("identification", "flight"): "identification sees records, not aircraft",
}
# Of another room, only modules whose names begin so.
NARROW_PAIRS = {
    ("flight", "dynamics"): ("finback.dynamics.continuation", "the simulator knows no polynomials"),
}
OWNERS = {
    "jsbsim": {"flight"},
    "matplotlib": {"views"},
    "rerun": {"views"},
    "rerun_cli": {"views"},
    "jinja2": {"views"},
    "typer": {"cli"},
    "rich": {"cli"},
    "pandas": {"records", "formats", "store"},
    "pydantic": {"study"},
    "cattrs": {"store"},
    "pyarrow": {"store", "views"},
    "sympy": {"store"},
    "numba": {"dynamics"},
    "dask": {"flight"},
    "distributed": {"flight"},
}
UNOWNED = {"numpy", "scipy"}
DRAWERS = {"utils", "util", "common", "helpers", "core", "base", "misc"}
CONVERSIONS = re.compile(
    r"57\.29|0\.01745|180(\.0)?\s*/\s*(math\.|np\.)?pi|pi\s*/\s*180|\b(deg2rad|rad2deg|radians|degrees)\(|"
    r"0\.3048|3\.2808|32\.17|14\.59|4\.448|47\.88|1\.3558|0\.4535"
)
F8II_NUMBERS = re.compile(r"f8ii|0\.98471|0\.3504260|8\.217328|35\.129|14\.725|295\.07|0\.26548|14300|42\.2\b")


def room_of(path: Path) -> str:
    """Return the room (top-level module or package) that a file belongs to."""
    return path.relative_to(SOURCE).parts[0].removesuffix(".py")


def imports_of(path: Path) -> set[str]:
    """Return every module that a file imports, wherever the import stands."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            if node.module == "finback":
                found |= {f"finback.{alias.name}" for alias in node.names}
            elif node.module:
                found.add(node.module)
    return found


def test_there_is_something_to_check() -> None:
    assert len(MODULES) > 20
    rooms = {room_of(path) for path in MODULES} - {"__init__"}
    assert rooms == set(LEVELS), "a new room needs a level"


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_imports_go_down_only(path: Path) -> None:
    room = room_of(path)
    if room == "__init__":
        return
    for module in imports_of(path):
        parts = module.split(".")
        if parts[0] != "finback" or len(parts) == 1 or parts[1] == "__version__":
            continue
        other = parts[1]
        if other == room:
            continue
        assert (room, other) not in FORBIDDEN_PAIRS, f"{path} imports {module}: {FORBIDDEN_PAIRS[room, other]}"
        if (room, other) in NARROW_PAIRS:
            begins, reason = NARROW_PAIRS[room, other]
            assert module.startswith(begins), f"{path} imports {module}: {reason}"
        if LEVELS[room] == LEVELS[other] == 0:
            assert LEVEL_0_ORDER.index(other) < LEVEL_0_ORDER.index(room), f"{path} imports {module}"
        else:
            assert LEVELS[other] < LEVELS[room], f"{path} (level {LEVELS[room]}) imports {module}"


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_each_third_party_library_has_one_home(path: Path) -> None:
    for module in imports_of(path):
        library = module.split(".")[0]
        if library in sys.stdlib_module_names or library == "finback" or library in UNOWNED:
            continue
        assert library in OWNERS, f"{path} imports {library}, which has no home: see CONTRIBUTING.md"
        assert room_of(path) in OWNERS[library], f"{path} imports {library}, whose home is {OWNERS[library]}"


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_no_unit_is_converted_outside_the_table(path: Path) -> None:
    if room_of(path) == "units":
        return
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        assert not CONVERSIONS.search(line), f"{path}:{number} converts a unit itself: {line.strip()}"


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_the_source_knows_no_number_of_the_f8ii(path: Path) -> None:
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        assert not F8II_NUMBERS.search(line), f"{path}:{number} knows the F-8 II: {line.strip()}"


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_files_are_small_and_named_for_what_they_hold(path: Path) -> None:
    assert path.stem not in DRAWERS
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 450, f"{path}: is this two things?"


def test_nothing_depends_on_what_lies_outside_the_project() -> None:
    root = SOURCE.parents[1]
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],  # noqa: S607 - git from PATH
        cwd=root,
        capture_output=True,
        text=True,
        check=True,
    )
    here = Path(__file__).resolve()
    for name in listed.stdout.splitlines():
        path = root / name
        if path.suffix in {".py", ".sh", ".toml", ".md", ".xml", ".in"} and path.exists() and path.resolve() != here:
            assert "/shared/" not in path.read_text(encoding="utf-8"), f"{name} reaches outside the project"


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("finback.cli.main", {"numpy", "scipy", "pandas", "matplotlib", "rerun", "jsbsim", "pyarrow", "pydantic"}),
        ("finback.pipeline", {"scipy.stats", "pandas", "matplotlib", "rerun", "jinja2", "sympy", "distributed"}),
    ],
)
def test_what_starts_imports_nothing_heavy_that_it_may_not_need(module: str, heavy: set[str]) -> None:
    code = f"import sys, {module}; print(' '.join(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not heavy & set(done.stdout.split())
