"""Pages of the site that are generated from sources: reference, case keys, commands, laws, gallery, validation tables.

MkDocs calls the functions `on_...`; see https://www.mkdocs.org/user-guide/configuration/#hooks.
"""

from __future__ import annotations

import ast
import json
import posixpath
import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
TOOLS = Path(__file__).parent

ROOMS = {
    "closures": ("Laws", "Physical laws as scalar functions: one function per equation."),
    "cfddem/case": ("Case", "Case files: schema, materials, input errors, the gallery."),
    "cfddem/preflight": ("Pre-run check", "Estimates, warnings and errors before a run."),
    "cfddem/run": ("Run", "Simulation, time step, run folder, history, budgets."),
    "cfddem/studies": ("Studies", "Sweeps, samples, calibration, job arrays, a run in a notebook."),
    "cfddem/features": (
        "Features",
        "What a case turns on: feeds and outlets, heat, drying, bridges, energy budgets.",
    ),
    "cfddem/particles": (
        "Particles",
        "Discrete-element solver: contacts, films, bridges, walls, neighbours, packings.",
    ),
    "cfddem/fluid": ("Fluid", "Volume-averaged flow on a staggered grid."),
    "cfddem/coupling": ("Coupling", "Momentum exchange between particles and fluid."),
    "cfddem/model": ("Model", "What a simulation is made of: declared fields, forces, equipment, what a user adds."),
    "cfddem/io": ("Input and output", "Run folders, snapshots, checkpoints, reading, export."),
    "cfddem/analysis": ("Analysis", "Measures of a run, time series, bubbles, mixing, reports."),
    "cfddem/plotting": ("Plotting", "Pictures, movies and curves from run folders."),
    "cfddem/backend": (
        "Backend",
        "Compilation and caching of loops, threads, errors, the communicator, printed tables.",
    ),
    "scenarios": ("Scenarios", "Cases that can be run from Python."),
}
"""Folder of modules -> title and sentence."""

TABLES = {"material": "[material.NAME]", "pair": "[pair.NAME.NAME]", "compare": "[compare.NAME]"} | {
    name: f"[[{name}]]" for name in ("wall", "feed", "outlet")
}
"""Headings of tables of a case file that have names of their own."""

HIDDEN = {
    "scenarios/validation",
    "scenarios/benchmarks",
    "scenarios/references/resolved_suspension",
    "figures.py",
    "validation.py",
    "checks.py",
}
"""Folders and file names of `scenarios` without a page in the reference."""


def modules(room: str) -> dict[str, str]:
    """Dotted name of every module of a room, and the first sentence of its docstring."""
    found = {}
    for path in sorted((ROOT / room).rglob("*.py")):
        place = path.relative_to(ROOT)
        hidden = room == "scenarios" and (path.name in HIDDEN or any(str(each) in HIDDEN for each in place.parents))
        if not path.stem.startswith("_") and not hidden:
            text = ast.get_docstring(ast.parse(path.read_text())) or ""
            found[".".join(place.with_suffix("").parts)] = " ".join(text.split("\n\n")[0].split())
    return found


def page_of(module: str) -> str:
    """Address of the page of a module."""
    return f"reference/{module.replace('.', '/')}.md"


def reference() -> Iterator[tuple[str, str]]:
    """Address and text of the pages of the reference."""
    lines = [
        "# Reference",
        "",
        "All public modules, generated from their docstrings. The page of a law shows its source code",
        "",
    ]
    lines[2] += " below its equation."
    lines += ["- [Keys of a case file](case.md)", "- [Commands](commands.md)", "- [Laws](laws.md)", ""]
    for room, (title, sentence) in ROOMS.items():
        lines += [f"## {title}", "", sentence, "", "| module | contents |", "|:--|:--|"]
        for module, about in modules(room).items():
            lines.append(f"| [`{module}`]({page_of(module).removeprefix('reference/')}) | {_plain(about)} |")
            yield page_of(module), f"# `{module}`\n\n::: {module}\n"
        lines.append("")
    yield "reference/index.md", "\n".join(lines)
    yield "reference/case.md", case_keys()
    yield "reference/commands.md", commands()
    yield "reference/laws.md", laws()


def case_keys() -> str:
    """Every key of a case file, with unit and default."""
    from cfddem.case.input_errors import sections_of
    from cfddem.case.schema import Case

    lines = ["# Keys of a case file", "", "A case file is TOML. All numbers are in SI units, given in brackets."]
    lines += ["`Case` in Python takes the same keys. `cfddem new --schema` prints them as a JSON schema for"]
    lines += ["editors. `--set table.key=value` replaces one of them for one command; the table may be omitted"]
    lines += ["where the key is unique: `--set seed=2`.", ""]
    for name, field in Case.model_fields.items():
        parts = sections_of(field)
        if not parts:
            lines += [f"`{name}`: {_plain(field.description or '')}.", ""]
            continue
        table = TABLES.get(name, f"[{name}]")
        about = field.description or (parts[0].__doc__ or "").split("\n")[0]
        lines += [*_table_of_keys(table, about, parts[0])]
        for key, each in parts[0].model_fields.items():
            for part in sections_of(each) if str(each.annotation).startswith("dict") else []:
                lines += [*_table_of_keys(f"[{name}.{key}.NAME]", each.description or "", part)]
    return "\n".join(lines)


def _table_of_keys(table: str, about: str, part: Any) -> Iterator[str]:
    """The keys of one table of a case file."""
    yield from (f"## `{table}`", "", _plain(about), "", "| key | meaning | default |", "|:--|:--|:--|")
    for key, each in part.model_fields.items():
        default = "**required**" if each.is_required() else f"`{_default(each.get_default())}`"
        invalid = any(getattr(rule, "gt", None) == each.get_default() for rule in each.metadata)
        if not each.is_required() and (each.get_default() is None or invalid):
            default = "-"
        yield f"| `{key}` | {_plain(each.description or '')}{_choices(each.annotation)} | {default} |"
    yield ""


def _choices(annotation: Any) -> str:
    """The allowed words of a key that takes words only."""
    found = re.findall(r"Literal\[([^\]]*)\]", str(annotation))
    return f"; one of `{found[0]}`" if found else ""


def _default(value: Any) -> str:
    return json.dumps(list(value) if isinstance(value, tuple) else value)


def commands() -> str:
    """The help texts of all commands."""
    from cfddem.cli.app import app

    text = app.generate_docs(output_format="markdown")
    text = re.sub(r"^#+ ", lambda mark: mark[0] if len(mark[0]) > 2 else "## ", text, flags=re.MULTILINE)
    text = re.sub(r"## Table of Contents\n.*?(?=\*\*Commands)", "", text, flags=re.DOTALL)
    return f"# Commands\n\n{text.removeprefix('## cfddem')}"


def laws() -> str:
    """All laws by kind."""
    from cfddem.particles.interactions.contact_law import CONTACTS, load_contact_laws
    from closures import registry

    registry.load_built_in_laws()
    load_contact_laws()
    lines = [
        "# Laws",
        "",
        "All laws by kind. A case selects a drag law and a contact law by name: `drag` and `contact`",
        "",
    ]
    lines[2] += " in `[laws]`. The contact laws consist of functions of `closures`."
    lines += ["## Contact laws of a run", "", "| law | description | source |", "|:--|:--|:--|"]
    for name, each in sorted(CONTACTS.items()):
        sentence = (each.force.__doc__ or "").split("\n\n")[0]
        address = f"{each.force.__module__}.{each.force.__name__}"
        lines.append(f"| [`{name}`][{address}] | {_plain(sentence)} | {_plain(each.reference)} |")
    lines.append("")
    for kind, entries in sorted(registry.REGISTRY.items()):
        lines += [f"## `{kind}`", "", "| law | description | source |", "|:--|:--|:--|"]
        for name, entry in sorted(entries.items()):
            sentence = (entry.function.__doc__ or "").split("\n\n")[0]
            address = f"{entry.function.__module__}.{name}"
            lines.append(f"| [`{name}`][{address}] | {_plain(sentence)} | {_plain(entry.reference)} |")
        lines.append("")
    return "\n".join(lines)


LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)#:\s]+)(#[\w-]+)?\)")
PICTURE = re.compile(r"(src=\"|!\[[^\]]*\]\()(?:\.\./)+docs/images/")


def gallery_page(readme: Path) -> str:
    """Address of the page made from a README of `scenarios`."""
    return "gallery/index.md" if readme.parent.name == "scenarios" else f"gallery/{readme.parent.name}.md"


def gallery() -> Iterator[tuple[str, str]]:
    """Address and text of the pages of the scenarios; links to source files become plain names."""
    for path in sorted((ROOT / "scenarios").rglob("README.md")):
        address = gallery_page(path)
        text = PICTURE.sub(r"\1../images/", path.read_text())
        text = LINK.sub(lambda link, path=path: _relinked(link, path), text)
        wide = "---\nhide: [toc]\n---\n\n" if address == "gallery/index.md" else ""  # its table needs the width
        yield address, wide + text


def _relinked(link: re.Match[str], readme: Path) -> str:
    """A link of a README, changed so that it is right on the page of the gallery."""
    words, target, anchor = link[1], link[2], link[3] or ""
    place = posixpath.normpath(posixpath.join(str(readme.parent.relative_to(ROOT)), target))
    if place.startswith("docs/"):
        return f"[{words}](../{place.removeprefix('docs/')}{anchor})"
    if place.endswith("README.md") and (ROOT / place).exists():
        return f"[{words}]({gallery_page(ROOT / place).removeprefix('gallery/')}{anchor})"
    if place.endswith("README.md"):  # a scenario without a page
        return words
    return f"{words} (`{place}`)" if words.strip("`") != place else f"`{place}`"


def _plain(text: str) -> str:
    """Text for a cell of a table."""
    from docstrings import sentence

    return sentence(" ".join(text.split())).replace("|", "\\|")


# ---------------------------------------------------------------- hooks of MkDocs


def on_config(config: Any) -> Any:
    """Add the generated pages to the navigation."""
    sys.path[:0] = [str(each) for each in (ROOT, TOOLS) if str(each) not in sys.path]
    rooms = [
        {title: [{_short_name(module, room): page_of(module)} for module in modules(room)]}
        for room, (title, _) in ROOMS.items()
    ]
    pages = [{"Keys of a case file": "reference/case.md"}]
    pages += [{"Commands": "reference/commands.md"}, {"Laws": "reference/laws.md"}]
    for entry in config["nav"]:
        if entry == {"Reference": ["reference/index.md"]}:
            entry["Reference"] = ["reference/index.md", *pages, *rooms]
        elif entry == {"Gallery": ["gallery/index.md"]}:
            entry["Gallery"] = ["gallery/index.md", *(page for page, _ in gallery() if page != "gallery/index.md")]
    return config


def _short_name(module: str, room: str) -> str:
    """Name of a module in the navigation: its path inside the room."""
    return module.removeprefix(room.replace("/", ".") + ".").replace(".", "/")


def on_files(files: Any, config: Any) -> Any:
    """Add the generated pages."""
    from mkdocs.structure.files import File

    generated = [*reference(), *gallery(), *notebooks(), ("changes.md", changes())]
    for address, content in generated:
        files.append(File.generated(config, address, content=content))
    return files


def notebooks() -> list[tuple[str, str]]:
    """Address and content of the pages of the notebooks, and of the files to download."""
    if str(TOOLS) not in sys.path:
        sys.path.insert(0, str(TOOLS))
    import notebooks as made

    return list(made.files())


def changes() -> str:
    """CHANGELOG.md with links to pages of the site."""
    text = (ROOT / "CHANGELOG.md").read_text().replace("](docs/", "](")
    return re.sub(r"\]\(scenarios/[\w/]*?(\w+)/README\.md(#[\w-]*)?\)", r"](gallery/\1.md\2)", text)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace `<!-- table: NAME -->` by a validation table and `<!-- source: NAME -->` by the source of a method."""
    markdown = re.sub(r"<!-- source: ([\w.]+) -->", lambda found: source(found[1]), markdown)
    return re.sub(r"<!-- table: ([\w-]+) -->", lambda found: validation_table(found[1]), markdown)


def source(name: str) -> str:
    """The source of a method, `package.module.Class.method`."""
    *module, owner, method = name.split(".")
    text = ROOT.joinpath(*module).with_suffix(".py").read_text()
    definition = next(each for each in ast.parse(text).body if isinstance(each, ast.ClassDef) and each.name == owner)
    found = next(each for each in definition.body if isinstance(each, ast.FunctionDef) and each.name == method)
    lines = text.splitlines()[found.lineno - 1 : found.end_lineno]
    return "```python\n" + textwrap.dedent("\n".join(lines)) + "\n```"


def validation_table(name: str) -> str:
    """The rows of docs/tables/NAME.json, written by `cfddem validate NAME`."""
    path = ROOT / "docs" / "tables" / f"{name}.json"
    if not path.exists():
        return f"*No table is stored; `cfddem validate {name}` writes it.*"
    report = json.loads(path.read_text())
    noted = any(row["note"] for row in report["rows"])
    lines = ["| quantity | cfddem | reference | difference | limit | |", "|:--|--:|--:|--:|--:|:--|"]
    if noted:
        lines = [f"{line}{more}" for line, more in zip(lines, (" note |", ":--|"))]
    for row in report["rows"]:
        unit = "" if row["unit"] == "-" else f" [{row['unit']}]"
        numbers = (_short(row[key]) for key in ("value", "reference", "difference", "limit"))
        note = f" {_plain(row['note'])} |" if noted else ""
        lines.append(f"| {_plain(row['quantity'])}{unit} | {' | '.join(numbers)} | {row['verdict']} |{note}")
    judged = [row for row in report["rows"] if row["verdict"] != "report"]
    held = sum(row["verdict"] == "holds" for row in judged)
    lines += ["", f"{held} of {len(judged)} limits hold; {len(report['rows']) - len(judged)} rows have no limit."]
    return "\n".join(lines)


def _short(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def store_tables(results: Path) -> None:
    """Store the tables of a validation, without the points behind each row."""
    for path in sorted(results.glob("*/table.json")):
        report = json.loads(path.read_text())
        for row in report["rows"]:
            row.pop("points", None)
        (ROOT / "docs" / "tables" / f"{path.parent.name}.json").write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    store_tables(Path(sys.argv[1] if len(sys.argv) > 1 else "results/validation"))
