"""What the site of the docs has beyond its Markdown files; a hook of MkDocs, named in mkdocs.yml.

- gallery/CASE.md for each case file: title, description, pictures, errors from the records, commands, the file;
- `<!-- generated: gallery -->`, `keys`, `columns GAUGE`, `help COMMAND`, `api NAME` in a page: replaced by what is read from
  the case files, the schema of cases, the gauges, the command line and the public names at the time of the build;
- equations: TeX between dollars becomes MathML, which browsers show without a script or a network.

Whatever cannot be generated ends the build.
"""

from __future__ import annotations

import html
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import warpsph  # noqa: E402
from warpsph import Case, load_case  # noqa: E402
from warpsph.measure import gauges  # noqa: E402

LEVELS = ("quick", "seed", "fine")
# Members of public classes that a user calls; of the other classes all that are documented.
MEMBERS = {
    "Case": ["from_dict", "load", "replace", "to_dict", "resolved", "spacing", "phase_names", "periodic", "source_folder"],
    "Simulation": ["gauge", "state", "run", "close"],
}
MARK = re.compile(r"<!-- generated: (\w+) ?(\w*) -->")
INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
DISPLAY = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)


# ------------------------------------------------------------------------------------------------------------
# what MkDocs calls


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the pages of the cases into the navigation, behind the overview of the gallery."""
    for entry in config.nav or []:
        if "Gallery" in entry:
            entry["Gallery"] = [entry["Gallery"][0], *({name: f"gallery/{name}.md"} for name in case_names())]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the page of each case."""
    records = measured(ROOT / "benchmarks")
    for name in case_names():
        files.append(File.generated(config, f"gallery/{name}.md", content=case_page(name, records.get(name, []))))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Replace the marks of a page by what they stand for."""

    def generate(match: re.Match[str]) -> str:
        kind, argument = match.groups()
        if kind not in GENERATORS:
            raise PluginError(f"{page.file.src_path}: nothing generates {match.group()}; known: {', '.join(GENERATORS)}")
        return GENERATORS[kind](argument)

    return MARK.sub(generate, markdown)


def on_page_content(content: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn the equations of a page into MathML."""

    def equation(match: re.Match[str], display: str) -> str:
        tex = html.unescape(match.group(1)).strip()
        try:
            return convert(tex, display=display)
        except Exception as error:
            raise PluginError(f"{page.file.src_path}: no equation: {tex}: {error!r}") from error

    content = DISPLAY.sub(lambda match: equation(match, "block"), content)
    return INLINE.sub(lambda match: equation(match, "inline"), content)


# ------------------------------------------------------------------------------------------------------------
# gallery


def case_names() -> list[str]:
    """Names of the shipped cases, in the order of the gallery."""
    return [name for names in case_groups().values() for name in names]


def case_groups() -> dict[str, list[str]]:
    """Names of the shipped cases by what they are about."""
    groups: dict[str, list[str]] = {
        "Several fluids, surface tension": [],
        "Several fluids": [],
        "One fluid, Riemann scheme": [],
        "One fluid, projection ISPH": [],
        "One fluid, delta-plus-SPH": [],
        "One fluid, compressible gas": [],
    }
    of_scheme = {
        "riemann": "Riemann scheme",
        "isph": "projection ISPH",
        "delta_plus": "delta-plus-SPH",
        "gas": "compressible gas",
    }
    for path in sorted((ROOT / "cases").glob("*.yaml")):
        case = load_case(path)
        if case.has_surface_tension:
            group = "Several fluids, surface tension"
        elif len(case.phases) > 1:
            group = "Several fluids"
        else:
            group = f"One fluid, {of_scheme[case.numerics.scheme]}"
        groups[group].append(path.stem)
    return groups


def pictures(name: str) -> list[Path]:
    """The pictures of docs/ that show a case: called after it, and not after a case with a longer name."""
    longer = [path.stem for path in (ROOT / "cases").glob("*.yaml") if path.stem.startswith(f"{name}_")]

    def shows(stem: str, case: str) -> bool:
        return stem == case or stem.startswith(f"{case}_")

    found = [*(ROOT / "docs").glob("*.png"), *sorted((ROOT / "docs" / "validation").glob("*.png"))]
    return [path for path in found if shows(path.stem, name) and not any(shows(path.stem, other) for other in longer)]


def escaped(text: str) -> str:
    """Text that Markdown shows as it is, also in a table, but for what stands in backquotes."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(part if part.startswith("`") else re.sub(r"([*_\[\]{}])", r"\\\1", _entities(part)) for part in parts)


def _entities(text: str) -> str:
    return html.escape(text, quote=False).replace("|", "&#124;").replace("$", "&#36;")


def heading_comment(path: Path) -> str:
    """The comment at the head of a case file as Markdown; what to look at and how long it takes are paragraphs."""
    paragraphs: list[str] = [""]
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        text = line.lstrip("#").strip()
        if not text or text.startswith(("Look at:", "Takes about")):
            paragraphs.append("")
        paragraphs[-1] += f" {text}"
    return "\n\n".join(escaped(text.strip()) for text in paragraphs if text.strip())


def gallery(_: str) -> str:
    """Cards of all cases, by group."""
    lines = []
    for group, names in case_groups().items():
        lines += [f"## {group}", "", '<div class="grid cards" markdown>', ""]
        for name in names:
            case = load_case(ROOT / "cases" / f"{name}.yaml")
            lines += [f"-   **[{escaped(case.title)}]({name}.md)** (`{name}`)", ""]
            shown = pictures(name)
            if shown:
                lines += [f"    ![]({link_to(shown[0])}){{ loading=lazy }}", ""]
            first = heading_comment(ROOT / "cases" / f"{name}.yaml").split("\n\n")[0]
            lines += [f"    {re.split(r'(?<=[a-z0-9)][.]) (?=[A-Z])', first)[0]}", ""]
        lines += ["</div>", ""]
    return "\n".join(lines)


def link_to(picture: Path) -> str:
    """Link to a picture from a page of the gallery."""
    return "../" + picture.relative_to(ROOT / "docs").as_posix()


def case_page(name: str, runs: list[dict[str, Any]]) -> str:
    """The page of a case; `runs` as from `measured`."""
    path = ROOT / "cases" / f"{name}.yaml"
    case = load_case(path)
    phases = "one phase" if len(case.phases) == 1 else f"{len(case.phases)} phases"
    kind = f"{case.dimension}-D, {phases}, scheme `{case.numerics.scheme}`"
    lines = [f"# {escaped(case.title)}", "", f"Case `{name}`: {kind}.", "", heading_comment(path), ""]
    if case.description:
        lines += [escaped(case.description), ""]
    commands = [f"python -m warpsph run cases/{name}.yaml", f"python -m warpsph validate {name} --level quick"]
    lines += ["```sh", *commands, "```", ""]
    for picture in pictures(name):
        rest = picture.stem[len(name) + 1 :].replace("_", " ")
        caption = escaped(case.title + (f": {rest}" if rest else ""))
        lines += [f"![{caption}]({link_to(picture)}){{ loading=lazy }}", "", f"*{caption}*", ""]
    lines += ["## Against its references", ""]
    if not runs:
        lines += ["No record is shipped; the commands above measure it.", ""]
    for run in runs:
        lines += [*run_table(run), ""]
    lines += ["## The case file", "", "```yaml", path.read_text(encoding="utf-8").rstrip(), "```", ""]
    return "\n".join(lines)


def measured(folder: Path) -> dict[str, list[dict[str, Any]]]:
    """Runs of `validate` in the records of a folder, by case and level, each once: that of a GPU before that of a CPU.

    A run is a dict with name, level, command, device, file and rows.
    """
    found: dict[tuple[str, str, str], dict[str, Any]] = {}
    paths = sorted(folder.rglob("*.json"), key=lambda path: (path.parent == folder, path.as_posix()))
    for path in paths:
        record = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(record, Mapping) or not {"level", "command", "rows"} <= record.keys() or "cases" in record:
            continue  # those with cases are of `benchmark`
        for row in record["rows"]:
            key = (row["case"], row["run"], row.get("precision", "float32"))
            run = found.setdefault(
                key,
                {
                    "name": row["run"],
                    "precision": key[2],
                    "level": record["level"],
                    "command": record["command"],
                    "device": record.get("device_name", ""),
                    "file": path.relative_to(ROOT).as_posix(),
                    "rows": [],
                },
            )
            if run["file"] == path.relative_to(ROOT).as_posix():
                run["rows"].append(row)
    result: dict[str, list[dict[str, Any]]] = {}
    for (case, _, _), run in found.items():
        result.setdefault(case, []).append(run)
    for runs in result.values():
        runs.sort(key=lambda run: (LEVELS.index(run["level"]), run["precision"], run["rows"][0]["particles"]))
    return result


def run_table(run: Mapping[str, Any]) -> list[str]:
    """Lines of Markdown: how a run was made and its errors."""
    first = run["rows"][0]
    seconds = "" if first.get("seconds") is None else f" in {first['seconds']:.3g} s"
    size = f"{first['particles']} particles, {first['steps']} steps{seconds}, {run['precision']}, {run['device']}"
    lines = [
        f"### {escaped(run['name'])}",
        "",
        f"Level `{run['level']}`: {size}. Record `{run['file']}`, by `{run['command'].strip()}`.",
        "",
        "| quantity | measured | reference | error | allowed | | against |",
        "|---|---:|---:|---:|---:|---|---|",
    ]
    for row in run["rows"]:
        unit = "" if row.get("unit") == "1" else row.get("unit") or ""
        cells = [
            row["quantity"].replace("_", " "),
            f"{number(row['value'])} {unit}".strip(),
            f"{number(row['reference'])} {unit}".strip(),
            share(row["error"], row["absolute"], unit),
            share(row["allowed"], row["absolute"], unit) or "reported",
            {"missed": "**missed**", "no limit": ""}.get(row["outcome"], row["outcome"]),
            escaped(row.get("source") or ""),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def number(value: float | None) -> str:
    """A number with four digits, nothing for None."""
    return "" if value is None else f"{value:.4g}"


def share(value: float | None, absolute: bool, unit: str) -> str:
    """An error in per cent, or in the unit of its quantity."""
    if value is None:
        return ""
    return f"{value:.2g} {unit}".strip() if absolute else f"{value * 100:.2g} %"


# ------------------------------------------------------------------------------------------------------------
# keys of a case file


def keys(_: str) -> str:
    """All keys of a case file from its schema, a table for each part."""
    schema = Case.model_json_schema(by_alias=True, mode="validation")
    parts = schema["$defs"]
    lift_parts(schema, parts)
    name_parts(schema, parts)
    places: dict[str, list[str]] = {}
    order = list(_parts(schema, "", parts))
    for name, place in order:
        places.setdefault(name, []).append(place)
    lines = ["## The case {#case}", "", schema["description"].split("\n")[0], "", *key_table(schema), ""]
    for name, where in places.items():
        part = parts[name]
        title = ", ".join(f"`{place}`" for place in dict.fromkeys(where)) + variant(part)
        lines += [f"## {title} {{#{anchor(name)}}}", "", part.get("description", "").split("\n\n")[0].replace("\n", " "), ""]
        if "properties" in part:
            lines += [*key_table(part), ""]
        else:
            lines += [f"One of: {words(part)}.", "", *short_table(part, parts), ""]
    return "\n".join(lines)


def lift_parts(schema: Any, parts: dict[str, Any]) -> None:
    """Make parts of the mappings with a title that stand in place under a key deep within a part, such as inlets."""
    for key, inner in list(schema.items()) if isinstance(schema, dict) else list(enumerate(schema)):
        if not isinstance(inner, dict | list):
            continue
        lift_parts(inner, parts)
        if schema is not parts and isinstance(inner, dict) and "title" in inner and "properties" in inner:
            parts[inner["title"]] = inner
            schema[key] = {"$ref": f"#/$defs/{inner['title']}"}


def name_parts(schema: Mapping[str, Any], parts: dict[str, Any]) -> None:
    """Make parts with names of the mappings that stand, in place, among the choices of a key of `schema`."""
    for key, inner in schema["properties"].items():
        for choices in (inner.get("oneOf", []), inner.get("anyOf", [])):
            for place, option in enumerate(choices):
                if "description" in option and "properties" in option:
                    words = (key, *(str(kind["const"]) for kind in option["properties"].values() if "const" in kind))
                    name = "".join(word.title() for text in words for word in text.split("_"))
                    parts[name] = option
                    choices[place] = {"$ref": f"#/$defs/{name}"}


def variant(part: Mapping[str, Any]) -> str:
    """What tells a part from others at the same place: the type of a gauge, a scheme, the kind of a reference."""
    kinds = part.get("properties", {})
    for key, inner in kinds.items():
        if "const" in inner:
            return f" with `{key}: {inner['const']}`"
    if "allowed" in kinds and "source" in kinds:
        return next(f" with `{kind}`" for kind in ("value", "curve", "curves", "exact", "interface") if kind in kinds)
    return ""


def anchor(name: str) -> str:
    """Anchor of a part of the schema."""
    return re.sub(r"(?<!^)(?=[A-Z])", "-", name).lower()


def _parts(schema: Mapping[str, Any], place: str, parts: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """(Name of a part, its place in a file) for all parts below a schema, from the outside in."""
    for key, inner in schema.get("properties", {}).items():
        here = f"{place}.{key}" if place else key
        for name, path in _references(inner, here):
            yield name, path
            yield from _parts(parts[name], path, parts)
    if "properties" not in schema:
        for name, path in _references(schema, place):
            yield name, path
            yield from _parts(parts[name], path, parts)


def _references(schema: Any, place: str) -> Iterator[tuple[str, str]]:
    """(Name of a part, its place) for the references of one key; a list has .0, a mapping of names .NAME."""
    if not isinstance(schema, Mapping):
        return
    if "$ref" in schema:
        yield schema["$ref"].rsplit("/", 1)[1], place
    for option in (*schema.get("anyOf", ()), *schema.get("oneOf", ())):
        yield from _references(option, place)
    for inner, step in (("items", "0"), ("additionalProperties", "NAME")):
        yield from _references(schema.get(inner), f"{place}.{step}")
    if "type" in schema and schema["type"] == "object":
        for key, inner in schema.get("properties", {}).items():
            yield from _references(inner, f"{place}.{key}")


def key_table(schema: Mapping[str, Any]) -> list[str]:
    """The table of the keys of one part."""
    lines = ["| key | meaning | value | default | example |", "|---|---|---|---|---|"]
    required = schema.get("required", ())
    for key, inner in schema["properties"].items():
        meaning = escaped(inner.get("description", ""))
        default = inner.get("default")
        shown = "required" if key in required else "" if default in (None, [], {}, "") else f"`{written(default)}`"
        examples = inner.get("examples") or ([inner["const"]] if "const" in inner else [])
        if not examples:
            raise PluginError(f"the key {key} of {schema.get('title')} has no example: add examples=[...] to its field")
        example = f"`{key}: {examples[0]}`".replace("|", "\\|")
        lines.append(f"| `{key}` | {meaning} | {words(inner)} | {shown} | {example} |")
    return lines


def short_table(schema: Mapping[str, Any], parts: Mapping[str, Any]) -> list[str]:
    """The table of the keys of a part that has short forms besides: those of all its mappings."""
    lines = ["| key | value | example |", "|---|---|---|"]

    def add(choices: list[Any]) -> None:
        for option in choices:
            for key, inner in option.get("properties", {}).items():
                lines.append(f"| `{key}` | {words(inner)} | `{key}: {instance(inner, parts)}` |")
                add(inner.get("anyOf", []))

    add(schema["anyOf"])
    return list(dict.fromkeys(lines))


def instance(schema: Mapping[str, Any], parts: Mapping[str, Any]) -> str:
    """Something that a schema allows, as a case file has it."""
    if schema.get("examples"):
        return str(schema["examples"][0])
    if "$ref" in schema:
        return instance(parts[schema["$ref"].rsplit("/", 1)[1]], parts)
    if "anyOf" in schema:
        return instance(schema["anyOf"][0], parts)
    if "enum" in schema:
        return str(schema["enum"][0])
    if schema.get("type") == "array":
        return "[1, 0]"
    if "properties" in schema:
        shown = schema["properties"]
        if all(inner.get("examples") for inner in shown.values()):  # a part of its own, with a table of its own
            shown = dict(list(shown.items())[-1:])
        return "{" + ", ".join(f"{key}: {instance(inner, parts)}" for key, inner in shown.items()) + "}"
    raise PluginError(f"no example can be made of {schema}")


def written(value: Any) -> str:
    """A value as a case file has it."""
    if isinstance(value, list | tuple):
        return "[" + ", ".join(written(item) for item in value) + "]"
    return str(value).lower() if isinstance(value, bool) else f"{value:g}" if isinstance(value, float) else str(value)


def words(schema: Mapping[str, Any]) -> str:
    """What can be written for a key, in words."""
    options = list(dict.fromkeys(option for option in _words(schema) if option))
    return ", ".join(options)


def _words(schema: Mapping[str, Any]) -> Iterator[str]:
    if "$ref" in schema:
        name = schema["$ref"].rsplit("/", 1)[1]
        yield f"[{re.sub(r'(?<!^)(?=[A-Z])', ' ', name).lower()}](#{anchor(name)})"
    elif "anyOf" in schema or "oneOf" in schema:
        for option in (*schema.get("anyOf", ()), *schema.get("oneOf", ())):
            yield from _words(option)
    elif "enum" in schema:
        yield from (f"`{item}`" for item in schema["enum"] if item is not None)
    elif "const" in schema:
        yield f"`{schema['const']}`"
    else:
        yield from _plain_words(schema)


def _plain_words(schema: Mapping[str, Any]) -> Iterator[str]:
    kind = schema.get("type")
    if kind in ("number", "integer"):
        signs = {"exclusiveMinimum": "&gt;", "minimum": "&ge;", "exclusiveMaximum": "&lt;", "maximum": "&le;"}
        limits = [f"{sign} {schema[key]:g}" for key, sign in signs.items() if key in schema]
        yield " ".join(["whole number" if kind == "integer" else "number", " and ".join(limits)]).strip()
    elif kind == "string":
        described = schema.get("description", "")
        if described.startswith("formula"):
            yield described
        elif not described.startswith("arithmetic"):  # said once, above the tables
            yield "text"
    elif kind == "boolean":
        yield "`true`, `false`"
    elif kind == "array":
        inside = words(schema.get("items", {})) or "value"
        yield "list of " + re.sub(r"^(number|text|value|whole number)\b", r"\1s", inside)
    elif kind == "object" and "properties" in schema:
        yield "mapping with " + ", ".join(f"`{key}`" for key in schema["properties"])
    elif kind == "object":
        inner = schema.get("additionalProperties")
        yield "mapping of names to " + (words(inner) if isinstance(inner, Mapping) and words(inner) else "values")


# ------------------------------------------------------------------------------------------------------------
# gauges, commands, public names


def scene(dimension: int, gauge: Mapping[str, Any]) -> Case:
    """A case of two phases, gas and liquid, with surface tension, walls and a body, that has one gauge."""
    lower, upper = [0.0] * dimension, [1.0] * dimension
    phases = {"gas": {"density": 1, "sound_speed": 10}, "liquid": {"density": 1000, "sound_speed": 10}}
    return Case.from_dict(
        {
            "dimension": dimension,
            "particle_spacing": 0.1,
            "end_time": 1.0,
            "domain": {"lower": lower, "upper": upper, "boundary": dict.fromkeys("xyz"[:dimension], "wall")},
            "phases": phases,
            "surface_tension": [{"between": ["gas", "liquid"], "coefficient": 1}],
            "fluids": [
                {"phase": "gas", "shape": {"sphere": {"center": [0.5] * dimension, "radius": 0.2}}},
                {"phase": "liquid", "shape": "rest"},
            ],
            "bodies": {"block": {"shape": {"box": {"lower": lower, "upper": [0.2] * dimension}}}},
            "gauges": {"g": gauge},
        }
    )


def channel(dimension: int, gauge: Mapping[str, Any]) -> Case:
    """A case of one phase with an inlet and an outlet along x, that has one gauge."""
    ends = {"lower": {"inlet": {"velocity": [1.0, *[0.0] * (dimension - 1)]}}, "upper": {"outlet": {"pressure": 0}}}
    return Case.from_dict(
        {
            "dimension": dimension,
            "particle_spacing": 0.1,
            "end_time": 1.0,
            "domain": {
                "lower": [0.0] * dimension,
                "upper": [1.0] * dimension,
                "boundary": {"x": ends, **dict.fromkeys("yz"[: dimension - 1], "wall")},
            },
            "phases": {"water": {"density": 1000, "sound_speed": 10}},
            "fluids": [{"phase": "water", "shape": "rest"}],
            "gauges": {"g": gauge},
        }
    )


def basin(dimension: int, gauge: Mapping[str, Any]) -> Case:
    """A case of one phase between walls with delta-plus-SPH that has one gauge."""
    domain = {"lower": [0.0] * dimension, "upper": [1.0] * dimension, "boundary": dict.fromkeys("xyz"[:dimension], "wall")}
    return Case.from_dict(
        {
            "dimension": dimension,
            "particle_spacing": 0.1,
            "end_time": 1.0,
            "domain": domain,
            "phases": {"water": {"density": 1000, "sound_speed": 10}},
            "fluids": [{"phase": "water", "shape": "rest"}],
            "numerics": {"scheme": "delta_plus"},
            "gauges": {"g": gauge},
        }
    )


def three_layers(dimension: int, gauge: Mapping[str, Any]) -> Case:
    """A case of three phases in layers that has one gauge."""
    domain = {"lower": [0.0] * dimension, "upper": [1.0] * dimension, "boundary": dict.fromkeys("xyz"[:dimension], "wall")}
    return Case.from_dict(
        {
            "dimension": dimension,
            "particle_spacing": 0.1,
            "end_time": 1.0,
            "domain": domain,
            "phases": {name: {"density": 1000} for name in ("oil", "water", "air")},
            "fluids": [
                {"phase": "water", "shape": {"where": {"condition": "y < 0.3"}}},
                {"phase": "oil", "shape": {"where": {"condition": "y > 0.3 and y < 0.6"}}},
                {"phase": "air", "shape": "rest"},
            ],
            "gauges": {"g": gauge},
        }
    )


def columns(kind: str) -> str:
    """The columns of a gauge in the scene above, with their units in two and three dimensions."""
    keys: dict[str, Any] = {"type": kind, "interval": 0.1}
    units: dict[str, dict[int, str]] = {"time": {2: "s", 3: "s"}}
    for dimension in (2, 3):
        if kind == "elevation":
            keys |= {"places": [[0.0] * (dimension - 1), [0.5] * (dimension - 1)]}
        if kind == "points":
            keys |= {"points": [[0.5] * dimension], "fields": ["pressure", "velocity"]}
        elif kind == "line":
            ends = {"from": [0.5, *[0.1] * (dimension - 1)], "to": [0.5, *[0.9] * (dimension - 1)]}
            keys |= {**ends, "count": 11, "fields": ["pressure", "velocity"]}
        elif kind == "reattachment":
            keys |= {"from": [0.1] * dimension, "to": [0.9, *[0.1] * (dimension - 1)], "count": 11}
        elif kind == "force_coefficients":
            keys |= {"speed": 1, "length": 1, "phase": "liquid"}
            keys |= {"area": 1, "lift": [0, 0, 1]} if dimension == 3 else {}
        elif kind == "surface_stress":
            keys |= {"speed": 1, "phase": "liquid"}
        elif kind == "interface_wave":
            keys |= {"phase": "liquid", "wavelength": 1.0}
        elif kind in ("contour", "lens"):
            keys |= {"mirror": "x"} if kind == "contour" else {"phase": "oil"}
            if dimension == 3:
                continue
        made = {"flow_rate": channel, "budget": basin, "lens": three_layers}.get(kind, scene)
        case = made(dimension, keys)
        gauge = gauges.GAUGES[kind]("g", case.gauges["g"], case)
        for column in gauge.columns:
            units.setdefault(column.name, {})[dimension] = column.unit
    lines = ["| column | 2-D | 3-D |", "|---|---|---|"]
    lines += [f"| `{name}` | {unit.get(2, '-')} | {unit.get(3, '-')} |" for name, unit in units.items()]
    return "\n".join(lines)


def command_help(command: str) -> str:
    """What `python -m warpsph COMMAND --help` prints."""
    done = subprocess.run(
        [sys.executable, "-m", "warpsph", command, "--help"],
        cwd=ROOT,
        env=os.environ | {"COLUMNS": "100", "PYTHONPATH": str(ROOT), "NO_COLOR": "1"},
        capture_output=True,
        text=True,
    )
    if done.returncode != 0:
        raise PluginError(f"python -m warpsph {command} --help ends with {done.returncode}: {done.stderr}")
    return f"```text\n{done.stdout.strip()}\n```"


def api(name: str) -> str:
    """What mkdocstrings makes of a public name, wherever it is defined."""
    lines = [f"::: {getattr(warpsph, name).__module__}.{name}", "    options:", "      heading_level: 3"]
    if name in MEMBERS:
        lines += ["      show_bases: false", f"      members: [{', '.join(MEMBERS[name])}]"]
    return "\n".join(lines)


GENERATORS = {"gallery": gallery, "keys": keys, "columns": columns, "help": command_help, "api": api}
