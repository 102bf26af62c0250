"""What the docs promise: citations, links and paths that lead somewhere, a short README, marks for all that is generated."""

import importlib.util
import json
import re
from pathlib import Path

import pytest
import typer

import warpsph
from warpsph import Case
from warpsph.cli import app
from warpsph.measure.gauges import GAUGES

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted(path for room in ("kernels", "warpsph", "scripts", "tests") for path in (ROOT / room).rglob("*.py"))
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
README_BYTES = 12_000

# A citation: `theory: riemann#a3`, several with commas between them, or `riemann#a2 to riemann#a7`.
PLACE = r"[a-z_]+#[a-z0-9-]+"
CITATION = re.compile(rf"theory: ({PLACE}(?:(?:, | to ){PLACE})*)")
# What a citation must not look like: the letter and number of a section without the page.
BARE = re.compile(r"\bmethods:? (?:table|[A-Z]\d*\b|0\.\d)")
# A file of the repository named in a text.
NAMED = re.compile(
    r"(?<![\w/.-])(?:docs|scripts|cases|tests|benchmarks|warpsph|kernels)/[\w./-]*\w\.(?:md|py|json|yaml|csv|txt|png)\b"
)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


def relative(path):
    return path.relative_to(ROOT).as_posix()


def without_code(text):
    """Markdown without its code blocks and code spans."""
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE))


def anchors(page):
    """Explicit anchors of a page of the theory."""
    path = ROOT / "docs" / "theory" / f"{page}.md"
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    return set(re.findall(r"^#+ .*\{#([\w-]+)\}$", text, re.MULTILINE))


def citations(text):
    """Pages and anchors that a text cites, as (page, anchor)."""
    return [tuple(place.split("#")) for found in CITATION.findall(text) for place in re.findall(PLACE, found)]


def lost(text):
    """What a text cites that is not there."""
    return [f"{page}#{anchor}" for page, anchor in citations(text) if anchor not in anchors(page)]


def dead_links(path, text):
    """Relative links of a page whose file does not exist; pages of the gallery are made when the site is built."""
    targets = [target.partition("#")[0] for target in LINK.findall(without_code(text)) if "://" not in target]
    return [target for target in targets if target and not (path.parent / target).exists()]


def test_every_citation_of_the_theory_has_its_anchor():
    assert sum(len(citations(path.read_text(encoding="utf-8"))) for path in SOURCES) > 20, "the pattern finds nothing"
    wrong = {relative(path): lost(path.read_text(encoding="utf-8")) for path in SOURCES if path != Path(__file__)}
    assert not {path: places for path, places in wrong.items() if places}


def test_no_citation_without_its_page():
    wrong = {
        f"{relative(path)}:{number}": line.strip()
        for path in SOURCES
        if path != Path(__file__)
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if BARE.search(line) or ("theory:" in line and not CITATION.search(line))
    }
    assert not wrong, "write theory: PAGE#ANCHOR, as in docs/theory/index.md"


def test_what_counts_as_a_citation():
    """The checks above see what they must see."""
    assert lost("(theory: riemann#a3, isph#b1 to isph#b99; Lee 2008)") == ["isph#b99"]
    assert lost("theory: nowhere#a1") == ["nowhere#a1"]
    for text in ("methods A3", "(methods B; ", "methods 0.2, column L", "methods K1", "methods: table of kernels"):
        assert BARE.search(text), text
    assert not BARE.search("other methods of a class")
    text = "[a](docs/nothing.md) ![b](docs/tutorial.md#first) `[c](x)`"
    assert dead_links(ROOT / "README.md", text) == ["docs/nothing.md"]


def test_readme_is_short():
    size = (ROOT / "README.md").stat().st_size
    assert size < README_BYTES, f"README.md has {size} bytes: move what is not needed for a first run to docs/"


@pytest.mark.parametrize("path", PAGES, ids=relative)
def test_links_and_paths_lead_somewhere(path):
    text = path.read_text(encoding="utf-8")
    assert not dead_links(path, text)
    assert not [name for name in sorted(set(NAMED.findall(text))) if not (ROOT / name).exists()]


def test_pages_that_the_source_names_exist():
    wrong = []
    for path in [*SOURCES, *sorted((ROOT / "cases").glob("*.yaml"))]:
        named = [name for name in NAMED.findall(path.read_text(encoding="utf-8")) if name.startswith("docs/")]
        wrong += [f"{relative(path)}: {name}" for name in named if path != Path(__file__) and not (ROOT / name).exists()]
    assert not wrong


def test_every_gauge_and_command_is_described():
    text = (ROOT / "docs" / "gauges.md").read_text(encoding="utf-8")
    assert [name for name in GAUGES if f"<!-- generated: columns {name} -->" not in text] == []
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    commands = typer.main.get_command(app).commands
    assert [name for name in commands if f"<!-- generated: help {name} -->" not in text] == []


def test_every_public_name_is_described():
    text = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    names = set(warpsph.__all__) - {"__version__"}
    assert [name for name in sorted(names) if f"<!-- generated: api {name} -->" not in text] == []


def every_key(schema):
    """The keys of all mappings in a schema."""
    if isinstance(schema, list):
        return {key for item in schema for key in every_key(item)}
    if not isinstance(schema, dict):
        return set()
    inner = {name for name in schema.get("properties", {}) if isinstance(schema["properties"], dict)}
    return inner | {key for item in schema.values() for key in every_key(item)}


def script(name):
    """A script as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "scripts" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def pages():
    """scripts/docs_pages.py, where MkDocs is installed."""
    pytest.importorskip("mkdocs")
    pytest.importorskip("latex2mathml")
    return script("docs_pages")


def test_keys_are_listed_with_limits_defaults_and_examples(pages):
    text = pages.keys("")
    limits = "number &ge; 1 and &le; 20"
    row = f"| `gamma` | exponent of the equation of state (7 liquid, 1.4 gas) | {limits} | `7` | `gamma: 7` |"
    assert row in text
    assert "## `phases.NAME` {#phase}" in text
    assert sorted(key for key in every_key(Case.model_json_schema(by_alias=True)) if f"| `{key}` |" not in text) == []
    with pytest.raises(pages.PluginError, match="courant of Numerics has no example"):
        pages.key_table({"title": "Numerics", "properties": {"courant": {"type": "number"}}})


def test_choices_of_a_key_have_tables_of_their_own(pages):
    """A mapping that stands in place among the choices of a key, not under a name of its own."""
    choices = [{"description": "d", "properties": {"scheme": {"const": word}}} for word in ("a", "b")]
    parts = {}
    pages.name_parts({"properties": {"numerics": {"oneOf": choices}}}, parts)
    assert choices == [{"$ref": "#/$defs/NumericsA"}, {"$ref": "#/$defs/NumericsB"}]
    assert pages.variant(parts["NumericsB"]) == " with `scheme: b`"


def test_a_picture_belongs_to_the_case_with_the_longest_name(pages):
    assert [path.name for path in pages.pictures("rising_bubble_3d")] == ["rising_bubble_3d.png"]
    assert "rising_bubble_3d.png" not in [path.name for path in pages.pictures("rising_bubble")]


def test_columns_of_a_gauge_have_units_in_two_and_three_dimensions(pages):
    lines = pages.columns("energy").splitlines()
    assert "| `surface` | J/m | J |" in lines
    assert "| `kinetic gas` | J/m | J |" in lines


def test_text_of_case_files_is_shown_as_it_is(pages):
    assert pages.escaped("a_b < c* `d_e`") == r"a\_b &lt; c\* `d_e`"


def test_a_run_is_taken_from_one_record_alone(pages, tmp_path, monkeypatch):
    """Records of the GPU folder come first; lists and tables of other scripts are no records."""
    monkeypatch.setattr(pages, "ROOT", tmp_path)
    row = {"case": "a", "run": "1", "particles": 4, "steps": 2, "seconds": 1.0, "precision": "float32", "quantity": "q"}
    (tmp_path / "gpu").mkdir()
    for name, device in (("old.json", "CPU"), ("gpu/new.json", "GPU")):
        record = {"level": "quick", "command": "c", "device_name": device, "rows": [row, row | {"quantity": "other"}]}
        (tmp_path / name).write_text(json.dumps(record), encoding="utf-8")
    (tmp_path / "list.json").write_text("[1]", encoding="utf-8")
    runs = pages.measured(tmp_path)["a"]
    assert [(run["device"], len(run["rows"])) for run in runs] == [("GPU", 2)]


def test_equations_become_mathml(pages):
    class Place:
        class file:
            src_path = "theory/x.md"

    shown = pages.on_page_content(r'<div class="arithmatex">\[a &lt; \frac{1}{2}\]</div>', Place(), None, None)
    assert shown.startswith("<math") and "<mfrac>" in shown and 'display="block"' in shown


def test_lists_of_arguments_get_a_heading():
    pytest.importorskip("griffe")
    text = "Does.\n\na: first\n    goes on\nb, c: others\nRaises: no\n"
    shown = "Does.\n\n\nArgs:\n    a: first\n        goes on\n    b: others\n    c: others\n\nRaises: no"
    assert script("docs_arguments").with_heading(text, {"a", "b", "c"}) == shown
    assert script("docs_arguments").with_heading("a: no argument", set()) == "a: no argument"
