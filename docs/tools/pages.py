"""Pages of the site that are made from what stands elsewhere: reference, keys of a case, commands, gallery, tables.

MkDocs calls the functions `on_...`; see https://www.mkdocs.org/user-guide/configuration/#hooks.
"""

from __future__ import annotations

import ast
import json
import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

HOUSE = Path(__file__).parents[2]
TOOLS = Path(__file__).parent

ROOMS = {
    "closures": ("Laws", "One function an equation."),
    "cfddem": ("Case and run", "What is to be run, and its course in time."),
    "cfddem/particles": ("Particles", "Pairs, contacts, films, walls, motion, pouring."),
    "cfddem/fluid": ("Fluid", "The volume-averaged equations on a staggered grid."),
    "cfddem/coupling": ("Coupling", "What fluid and particles do to each other."),
    "cfddem/record": ("Record", "Run folders, checkpoints, measures, the ledger."),
    "cfddem/view": ("View", "Pictures, films, curves."),
    "scenarios": ("Scenarios", "Cases that can be run from Python."),
}
"""Folder of modules -> title and sentence."""

UNSEEN = {"scenarios": ("_validation", "_checks", "_figures")}
"""Modules that serve a validation and are no one's library."""


def modules(room: str) -> dict[str, str]:
    """Dotted name of every module of a room, and the first sentence of its docstring."""
    found = {}
    for path in sorted((HOUSE / room).glob("*.py")):
        if path.stem.startswith("_") or path.stem.endswith(UNSEEN.get(room, ("\0",))):
            continue
        text = ast.get_docstring(ast.parse(path.read_text())) or ""
        found[".".join([*room.split("/"), path.stem])] = " ".join(text.split("\n\n")[0].split())
    return found


def page_of(module: str) -> str:
    """Address of the page of a module."""
    return f"reference/{module.replace('.', '/')}.md"


def reference() -> Iterator[tuple[str, str]]:
    """The pages of the reference."""
    lines = ["# Reference", "", "Everything public, made from the docstrings. A law's page shows its source: read the"]
    lines += ["equation and its code side by side.", ""]
    lines += ["- [Keys of a case file](case.md)", "- [Commands](commands.md)", "- [Shelf of laws](shelf.md)", ""]
    for room, (title, sentence) in ROOMS.items():
        lines += [f"## {title}", "", sentence, "", "| module | holds |", "|:--|:--|"]
        for module, about in modules(room).items():
            lines.append(f"| [`{module}`]({page_of(module).removeprefix('reference/')}) | {_plain(about)} |")
            yield page_of(module), f"# `{module}`\n\n::: {module}\n"
        lines.append("")
    yield "reference/index.md", "\n".join(lines)
    yield "reference/case.md", case_keys()
    yield "reference/commands.md", commands()
    yield "reference/shelf.md", shelf()


def case_keys() -> str:
    """Every key of a case file, with unit and default."""
    from cfddem.case import Case
    from cfddem.mistakes import parts_of

    lines = ["# Keys of a case file", "", "A case file is TOML; all numbers are in SI units, given in brackets."]
    lines += ["The same words make a `Case` in Python. `cfddem new --schema` prints them as a JSON schema for"]
    lines += ["editors. `--set table.key=value` replaces any of them for one command; the table may be left out"]
    lines += ["where the key is unmistakable: `--set seed=2`.", ""]
    for name, field in Case.model_fields.items():
        parts = parts_of(field)
        if not parts:
            lines += [f"`{name}`: {_plain(field.description or '')}.", ""]
            continue
        table = f"[{name}.NAME]" if name == "material" else f"[{name}]"
        about = field.description or (parts[0].__doc__ or "").split("\n")[0]
        lines += [*_table_of_keys(table, about, parts[0])]
        for key, each in parts[0].model_fields.items():
            for part in parts_of(each) if str(each.annotation).startswith("dict") else []:
                lines += [*_table_of_keys(f"[{name}.{key}.NAME]", each.description or "", part)]
    return "\n".join(lines)


def _table_of_keys(table: str, about: str, part: Any) -> Iterator[str]:
    """The keys of one table of a case file."""
    yield from (f"## `{table}`", "", _plain(about), "", "| key | meaning | default |", "|:--|:--|:--|")
    for key, each in part.model_fields.items():
        default = "**needed**" if each.is_required() else f"`{_default(each.get_default())}`"
        refused = any(getattr(rule, "gt", None) == each.get_default() for rule in each.metadata)
        if not each.is_required() and (each.get_default() is None or refused):
            default = "-"
        yield f"| `{key}` | {_plain(each.description or '')}{_choices(each.annotation)} | {default} |"
    yield ""


def _choices(annotation: Any) -> str:
    """The words that a key takes, where it takes words only."""
    found = re.findall(r"Literal\[([^\]]*)\]", str(annotation))
    return f"; one of `{found[0]}`" if found else ""


def _default(value: Any) -> str:
    return json.dumps(list(value) if isinstance(value, tuple) else value)


def commands() -> str:
    """The help texts of all commands."""
    from cfddem.cli import app

    text = app.generate_docs(output_format="markdown")
    text = re.sub(r"^#+ ", lambda mark: mark[0] if len(mark[0]) > 2 else "## ", text, flags=re.MULTILINE)
    text = re.sub(r"## Table of Contents\n.*?(?=\*\*Commands)", "", text, flags=re.DOTALL)
    return f"# Commands\n\n{text.removeprefix('## cfddem')}"


def shelf() -> str:
    """All laws by kind."""
    from closures import shelf as laws

    laws.fill()
    lines = [
        "# Shelf of laws",
        "",
        "All laws of `closures`, by kind. A drag law is chosen by its name in `[laws] drag`.",
        "",
    ]
    for kind, cards in sorted(laws.SHELF.items()):
        lines += [f"## `{kind}`", "", "| law | what it is | source |", "|:--|:--|:--|"]
        for name, card in sorted(cards.items()):
            sentence = (card.function.__doc__ or "").split("\n\n")[0]
            address = f"{card.function.__module__}.{name}"
            lines.append(f"| [`{name}`][{address}] | {_plain(sentence)} | {_plain(card.reference)} |")
        lines.append("")
    return "\n".join(lines)


def gallery() -> Iterator[tuple[str, str]]:
    """The pages of the scenarios, whose links to files of the source become plain names."""
    for path in sorted((HOUSE / "scenarios").glob("*.md")):
        text = path.read_text().replace("../docs/images/", "../images/")
        text = re.sub(r"\]\(\.\./docs/([\w/-]+\.md)", r"](../\1", text)
        index = path.stem == "README"  # its table wants the width
        text = re.sub(r"\[([^\]]+)\]\(([\w/]+\.(?:py|toml))\)", r"\1" if index else r"\1 (`scenarios/\2`)", text)
        yield ("gallery/index.md", f"---\nhide: [toc]\n---\n\n{text}") if index else (f"gallery/{path.name}", text)


def _plain(text: str) -> str:
    """A sentence in a cell of a table."""
    from docstrings import sentence

    return sentence(" ".join(text.split())).replace("|", "\\|")


# ---------------------------------------------------------------- called by MkDocs


def on_config(config: Any) -> Any:
    """Put the made pages into the navigation."""
    sys.path[:0] = [str(each) for each in (HOUSE, TOOLS) if str(each) not in sys.path]
    rooms = [
        {title: [{module.rsplit(".", 1)[-1]: page_of(module)} for module in modules(room)]}
        for room, (title, _) in ROOMS.items()
    ]
    pages = [{name: address} for name, address in (("Keys of a case file", "reference/case.md"),)]
    pages += [{"Commands": "reference/commands.md"}, {"Shelf of laws": "reference/shelf.md"}]
    for entry in config["nav"]:
        if entry == {"Reference": ["reference/index.md"]}:
            entry["Reference"] = ["reference/index.md", *pages, *rooms]
        elif entry == {"Gallery": ["gallery/index.md"]}:
            entry["Gallery"] = ["gallery/index.md", *(page for page, _ in gallery() if page != "gallery/index.md")]
    return config


def on_files(files: Any, config: Any) -> Any:
    """Add the made pages."""
    from mkdocs.structure.files import File

    made = [*reference(), *gallery(), ("changes.md", (HOUSE / "CHANGELOG.md").read_text())]
    for address, content in made:
        files.append(File.generated(config, address, content=content))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace `<!-- table: NAME -->` by the table of a validation, `<!-- source: NAME -->` by code as it stands."""
    markdown = re.sub(r"<!-- source: ([\w.]+) -->", lambda found: source(found[1]), markdown)
    return re.sub(r"<!-- table: ([\w-]+) -->", lambda found: validation_table(found[1]), markdown)


def source(name: str) -> str:
    """The source of a method, `package.module.Class.method`."""
    *module, owner, method = name.split(".")
    text = HOUSE.joinpath(*module).with_suffix(".py").read_text()
    home = next(each for each in ast.parse(text).body if isinstance(each, ast.ClassDef) and each.name == owner)
    found = next(each for each in home.body if isinstance(each, ast.FunctionDef) and each.name == method)
    lines = text.splitlines()[found.lineno - 1 : found.end_lineno]
    return "```python\n" + textwrap.dedent("\n".join(lines)) + "\n```"


def validation_table(name: str) -> str:
    """The rows of docs/tables/NAME.json, which `cfddem validate NAME` has written."""
    path = HOUSE / "docs" / "tables" / f"{name}.json"
    if not path.exists():
        return f"*The table is not kept here; `cfddem validate {name}` writes it.*"
    report = json.loads(path.read_text())
    lines = ["| quantity | here | reference | difference | limit | |", "|:--|--:|--:|--:|--:|:--|"]
    for row in report["rows"]:
        unit = "" if row["unit"] == "-" else f" [{row['unit']}]"
        numbers = (_short(row[key]) for key in ("value", "reference", "difference", "limit"))
        lines.append(f"| {_plain(row['quantity'])}{unit} | {' | '.join(numbers)} | {row['verdict']} |")
    judged = [row for row in report["rows"] if row["verdict"] != "report"]
    held = sum(row["verdict"] == "holds" for row in judged)
    lines += ["", f"{held} of {len(judged)} limits hold; {len(report['rows']) - len(judged)} rows are reported only."]
    return "\n".join(lines)


def _short(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def keep_tables(results: Path) -> None:
    """Take over the tables of a validation, without the points behind each row."""
    for path in sorted(results.glob("*/table.json")):
        report = json.loads(path.read_text())
        for row in report["rows"]:
            row.pop("points", None)
        (HOUSE / "docs" / "tables" / f"{path.parent.name}.json").write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    keep_tables(Path(sys.argv[1] if len(sys.argv) > 1 else "results/validation"))
