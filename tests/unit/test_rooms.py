"""The rooms of the package: which may import which, how long files and kernel factories may be, and names of files.

Read from the source, so that imports inside functions count too; those for type checkers alone do not. The order stands in
docs/records/house.md as well.
"""

import ast
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LONGEST_FILE, LONGEST_FACTORY = 700, 200

# From the lowest to the highest: a module imports from its own room and from those before it. A module is in the room with
# the longest name that it begins with.
ROOMS = {
    "errors": ("warpsph", "warpsph.errors"),
    "names of schemes": ("warpsph.schemes", "warpsph.schemes.base", "warpsph.schemes.registry"),
    "case": ("warpsph.case",),
    "state": ("warpsph.snapshot", "warpsph.start"),
    "kernels": ("warpsph.kernels",),
    "kernels of schemes": (
        "warpsph.kernels.delta", "warpsph.kernels.gas", "warpsph.kernels.isph", "warpsph.kernels.linear",
        "warpsph.kernels.riemann",
    ),
    "engine": ("warpsph.engine",),
    "scene": ("warpsph.scene",),
    "solvers": ("warpsph.solvers",),
    "schemes": ("warpsph.schemes.",),
    "files": ("warpsph.files",),
    "measure": ("warpsph.measure",),
    "running": ("warpsph.running",),
    "study": ("warpsph.study",),
    "simulation": ("warpsph.simulation",),
    "validation": ("warpsph.study.validation", "warpsph.study.baseline", "warpsph.study.sweep", "warpsph.study.benchmark"),
    "command line": ("warpsph.cli", "warpsph.__main__"),
}
ORDER = list(ROOMS)

# Still to be split; a file or factory that no longer needs its entry fails, so that the lists end up empty.
LONG_FILES: set[str] = set()
# A sweep whose parts round otherwise than the whole: cutting it moves the last bit of every result.
LONG_FACTORIES = {"kernels/riemann/momentum.py: make_momentum"}


def name_of(path: Path, root: Path = ROOT) -> str:
    """Dotted name of a source file; kernels/ is imported as warpsph.kernels."""
    parts = path.relative_to(root).with_suffix("").parts
    if parts[0] == "kernels":
        parts = ("warpsph", *parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def sources(root: Path = ROOT) -> dict[str, Path]:
    """Every module of the package by its dotted name."""
    return {name_of(path, root): path for room in ("warpsph", "kernels") for path in sorted((root / room).rglob("*.py"))}


def is_for_type_checkers(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")


def imports_of(name: str, path: Path, modules: dict[str, Path]) -> set[str]:
    """The modules of the package that a file imports, in functions too, but not for type checkers alone.

    `from a import b` imports a.b if that is a module, else a.
    """
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    found: set[str] = set()

    def visit(node: ast.AST) -> None:
        if is_for_type_checkers(node):
            for child in node.orelse:
                visit(child)
            return
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            found.update(full if (full := f"{source}.{alias.name}") in modules else source for alias in node.names)
        for child in ast.iter_child_nodes(node):
            visit(child)

    visit(ast.parse(path.read_text(encoding="utf-8")))
    return (found & modules.keys()) - {name}


def graph(root: Path = ROOT) -> dict[str, set[str]]:
    modules = sources(root)
    return {name: imports_of(name, path, modules) for name, path in modules.items()}


def circle(arrows: dict[str, set[str]]) -> list[str]:
    """The modules of one circle of imports in order, the first again at the end; empty if there is none."""
    done: set[str] = set()

    def follow(name: str, way: list[str]) -> list[str]:
        if name in way:
            return [*way[way.index(name) :], name]
        if name in done:
            return []
        for other in sorted(arrows[name]):
            found = follow(other, [*way, name])
            if found:
                return found
        done.add(name)
        return []

    return next((found for name in sorted(arrows) if (found := follow(name, []))), [])


def room_of(name: str) -> str:
    """The room of a module: the one with the longest name that it begins with."""
    fits = [
        (len(prefix), room)
        for room, prefixes in ROOMS.items()
        for prefix in prefixes
        if name == prefix or name.startswith(prefix if prefix.endswith(".") else prefix + ".")
    ]
    return max(fits)[1]


def against_the_order(arrows: dict[str, set[str]]) -> list[str]:
    """Imports from a room above the own one."""
    return [
        f"{name} ({room_of(name)}) imports {other} ({room_of(other)})"
        for name, others in sorted(arrows.items())
        for other in sorted(others)
        if ORDER.index(room_of(other)) > ORDER.index(room_of(name))
    ]


def too_long(root: Path = ROOT) -> set[str]:
    """Files of more lines than a file may have."""
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in sources(root).values()}
    return {path.relative_to(root).as_posix() for path, lines in lengths.items() if lines > LONGEST_FILE}


def same_names(root: Path = ROOT) -> list[str]:
    """Names that several files have."""
    count = Counter(path.name for path in sources(root).values() if path.name != "__init__.py")
    return sorted(name for name, files in count.items() if files > 1)


def long_factories(root: Path = ROOT) -> set[str]:
    """Functions of kernels/ of more lines than a factory may have, decorators included."""
    found = set()
    for path in sorted((root / "kernels").rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef):
                first = min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
                if node.end_lineno - first + 1 > LONGEST_FACTORY:
                    found.add(f"{path.relative_to(root).as_posix()}: {node.name}")
    return found


def test_every_module_is_in_a_room_of_its_own():
    """`warpsph` alone, the fallback, holds nothing but itself and what is named with it."""
    strangers = [name for name in sources() if room_of(name) == "errors" and name not in ROOMS["errors"]]
    assert not strangers, f"name a room for {strangers}"


def test_no_circle_of_imports():
    assert not (found := circle(graph())), " -> ".join(found)


def test_imports_follow_the_order_of_the_rooms():
    assert not (found := against_the_order(graph())), "\n".join(found)


def test_no_file_is_too_long():
    assert too_long() == LONG_FILES


def test_no_two_files_have_one_name():
    assert not same_names()


def test_no_kernel_factory_is_too_long():
    assert long_factories() == LONG_FACTORIES


def test_the_order_is_written_down():
    text = (ROOT / "docs" / "records" / "house.md").read_text(encoding="utf-8")
    written = [line.split("|")[1].strip() for line in text.splitlines() if line.startswith("| ")][1:]
    assert written == ORDER


# the checks can fail ----------------------------------------------------------------------------------------


@pytest.fixture
def package(tmp_path):
    """A function that writes files of a package and returns where it is."""

    def write(**files: str) -> Path:
        for name, text in files.items():
            path = tmp_path / (name.replace("__", "/") + ".py")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return tmp_path

    return write


@pytest.mark.parametrize(
    "text",
    [
        "from warpsph.study.plot import b",
        "from warpsph.study import plot",
        "import warpsph.study.plot",
        "from ..study.plot import b",
        "from ..study import plot",
        "def f():\n    from warpsph.study.plot import b",
        "class A:\n    def f(self):\n        if True:\n            import warpsph.study.plot",
    ],
)
def test_a_circle_and_an_arrow_upwards_are_found(package, text):
    root = package(warpsph__case__values=text, warpsph__study__plot="from warpsph.case import values")
    assert circle(graph(root)) == ["warpsph.case.values", "warpsph.study.plot", "warpsph.case.values"]
    assert against_the_order(graph(root)) == ["warpsph.case.values (case) imports warpsph.study.plot (study)"]


def test_imports_for_type_checkers_do_not_count(package):
    text = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from warpsph.study.plot import b\n"
    root = package(warpsph__case__values=text, warpsph__study__plot="from warpsph.case.values import c")
    assert not circle(graph(root)) and not against_the_order(graph(root))
    root = package(warpsph__case__values=text + "else:\n    from warpsph.study import plot\n")
    assert circle(graph(root))


def test_a_long_way_round_is_a_circle(package):
    root = package(
        warpsph__case__a="from warpsph.case.b import x", warpsph__case__b="from warpsph.case.c import x",
        warpsph__case__c="def f():\n    from warpsph.case.a import x", warpsph__case__d="from warpsph.case.a import x",
    )  # fmt: skip
    assert len(circle(graph(root))) == 4 and not against_the_order(graph(root))


def test_schemes_are_in_two_rooms():
    assert room_of("warpsph.schemes.registry") == "names of schemes"
    assert room_of("warpsph.schemes.isph_numerics") == "schemes"
    assert room_of("warpsph.kernels.core.clock") == "kernels" and room_of("warpsph.kernels.linear.x") == "kernels of schemes"


def test_long_files_and_factories_and_doubled_names_are_found(package):
    lines = "    x = 1\n" * (LONGEST_FACTORY - 2)
    root = package(
        kernels__core__a=f"@cache\ndef short():\n{lines}\n@cache\ndef long():\n{lines}    y = 1\n",
        kernels__core__b="x = 1\n" * LONGEST_FILE,
        warpsph__case__b="x = 1\n" * (LONGEST_FILE + 1),
    )
    assert long_factories(root) == {"kernels/core/a.py: long"}
    assert too_long(root) == {"warpsph/case/b.py"}
    assert same_names(root) == ["b.py"]
