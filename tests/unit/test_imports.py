"""Who may import whom. Read from the source, so that imports inside functions count too."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HOST = sorted((ROOT / "warpsph").rglob("*.py"))
KERNELS = sorted((ROOT / "kernels").rglob("*.py"))
HEAVY = {"pyvista", "vtk", "vtkmodules", "matplotlib", "h5py", "scipy"}

# Kernel modules that schemes import and that are no stages: structure, fields, numbers and clock of a run.
NOT_STAGES = {"spec", "fields", "params", "clock", "smoothing", "time_signals", "poses", "block_sums"}


def name_of(path: Path) -> str:
    """Dotted name of a source file; kernels/ is imported as warpsph.kernels."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    if parts[0] == "kernels":
        parts = ("warpsph", *parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(path: Path, module_level_only: bool = False) -> set[str]:
    """Dotted names a file imports, `from a import b` as both a and a.b, relative imports resolved.

    With `module_level_only`, what runs on import: not the bodies of functions nor `if TYPE_CHECKING:`.
    """
    package = name_of(path).split(".")
    if path.name != "__init__.py":
        package = package[:-1]
    found: set[str] = set()

    def visit(node: ast.AST) -> None:
        if module_level_only:
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
                return
            if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
                return
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            found.add(source)
            found.update(f"{source}.{alias.name}" for alias in node.names)
        for child in ast.iter_child_nodes(node):
            visit(child)

    visit(ast.parse(path.read_text(encoding="utf-8")))
    return found


def within(name: str, package: str) -> bool:
    return name == package or name.startswith(package + ".")


def identify(path: Path) -> str:
    return str(path.relative_to(ROOT))


# Rooms that work without a scheme, a kernel and Warp.
LIGHT_ROOMS = ("measure", "files", "study")


def room_of(room: str) -> list[Path]:
    return sorted((ROOT / "warpsph" / room).glob("*.py"))


@pytest.mark.parametrize("path", KERNELS, ids=identify)
def test_kernels_import_warp_the_standard_library_and_siblings(path):
    allowed = {"warp", "warpsph"} | set(sys.stdlib_module_names)
    for name in imports(path):
        assert name.split(".")[0] in allowed, f"{name}: kernels need no other package"
        if name.split(".")[0] == "warpsph" and name != "warpsph":
            assert within(name, "warpsph.kernels"), f"{name}: kernels do not know the host code"
    # `import warpsph` would give a kernel the host code by another way
    assert "warpsph" not in {
        alias.name
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Import)
        for alias in node.names
    }


@pytest.mark.parametrize("path", KERNELS, ids=identify)
def test_kernels_keep_annotations_as_objects(path):
    assert "__future__.annotations" not in imports(path)


def test_only_schemes_name_stages():
    """Whoever wants to know what a step does reads one file."""
    schemes = ROOT / "warpsph" / "schemes"
    stages = {
        name_of(path)
        for path in KERNELS
        if path.stem not in {"__init__", *NOT_STAGES}
        and any(name_of(path) in imports(scheme) for scheme in schemes.glob("*.py"))
    }
    assert stages, "no scheme imports a stage: this test looks in the wrong place"
    found = {identify(path): imports(path) & stages for path in HOST if path.parent != schemes}
    assert not {path: names for path, names in found.items() if names}


@pytest.mark.parametrize("path", HOST, ids=identify)
def test_nothing_imports_the_command_line(path):
    if path.name != "__main__.py" and path.parent.name != "cli":
        assert not any(within(name, "warpsph.cli") for name in imports(path))


@pytest.mark.parametrize("path", HOST, ids=identify)
def test_no_heavy_import_at_module_level(path):
    assert not {name for name in imports(path, module_level_only=True) if name.split(".")[0] in HEAVY}


@pytest.mark.parametrize("path", [path for room in LIGHT_ROOMS for path in room_of(room)], ids=identify)
def test_output_knows_no_scheme_and_no_kernel(path):
    found = imports(path)
    assert not {
        entry for entry in found if within(entry, "warpsph.schemes") or within(entry, "warpsph.kernels")
    }


@pytest.mark.parametrize("path", [path for room in ("case", *LIGHT_ROOMS) for path in room_of(room)], ids=identify)
def test_input_and_output_need_no_warp(path):
    """Loading, checking and plotting work, and are tested, without starting Warp."""
    assert not any(within(entry, "warp") for entry in imports(path))


@pytest.mark.parametrize("statement", ["import warpsph", "import warpsph.cli", "import warpsph.errors"])
def test_import_stays_light(statement):
    """In a fresh interpreter: nothing of these is loaded, by whatever way."""
    heavy = sorted(HEAVY | {"warp", "numpy", "pydantic", "rich", "ruamel"})
    code = f"{statement}\nimport sys\nprint([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_public_names_resolve():
    import warpsph

    for name in warpsph.__all__:
        assert getattr(warpsph, name) is not None
    assert set(warpsph.__all__) <= set(dir(warpsph))
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = warpsph.nonsense


def test_kernels_are_found_beside_the_package():
    import warpsph.kernels

    assert Path(warpsph.kernels.__file__).parent.name == "kernels"
