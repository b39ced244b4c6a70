"""Random changes of values, texts, words and files."""

from __future__ import annotations

import copy
import datetime
import json
import random
import string
import tomllib
from pathlib import Path
from typing import Any

import tomli_w

ODD_NUMBERS = (
    0.0, -0.0, -1.0, 1e-300, 1e300, -1e300, 5e-324, 1.7e308, 1e12, 1e-12, float("nan"), float("inf"), -float("inf"),
    10**40, 2**63, -(2**64), 10**400, 1e3, 0.5, 3, -7,
)  # fmt: skip
ODD_WORDS = (
    "", " ", "poured", "suspended", "placed", "packed", "cylinder", "periodic", "closed", "flow", "linear", "none",
    "auto", "x" * 5000, "ä", "\u202e", "two\nlines", "nul\0", "../..", "'", '"', "[", "{", "%s", "{0}", "-1", "1e999",
    "nan", "$HOME", "\ud7ff", "\N{PILE OF POO}", "glass.x", "..", ".", "a/b", "null", "true",
)  # fmt: skip

RARE_ENDINGS = (
    "x = " + "[" * 5000, "x.y = {" * 500, "a." * 3000 + "a = 1", "#" * 300_000, "x = 0x" + "f" * 9000,
    "\n".join(f"k{k} = {k}" for k in range(20_000)), "x = [" + "1.5, " * 80_000 + "]", "x = '" + "ä" * 400_000,
)  # fmt: skip
"""Ends of case files that take long to read or break simple readers."""

Random = random.Random


def odd_value(chance: Random) -> Any:
    """A value that a key of a case file may not expect."""
    kind = chance.randrange(10)
    if kind < 5:
        return chance.choice(ODD_NUMBERS)
    if kind < 7:
        return chance.choice(ODD_WORDS).replace("\0", "")
    if kind == 7:
        return [chance.choice([*ODD_NUMBERS, *ODD_WORDS[:4], [1.0, 2.0]]) for _ in range(chance.randrange(5))]
    if kind == 8:
        return chance.choice([{}, {"a": 1.0}, True, False, [[0.02, 0.02, 0.1]] * 300, datetime.date(2020, 1, 1)])
    return odd_text(chance, 30)


def odd_text(chance: Random, most: int) -> str:
    """A short text of any characters."""
    letters = string.printable + "äß€\u200b\u202e\N{PILE OF POO}"
    return "".join(chance.choice(letters) for _ in range(chance.randrange(most)))


def mutated_case(chance: Random, texts: list[str], keys: list[str]) -> bytes:
    """A case file with a few changes of values, keys, text and bytes.

    texts  valid case files
    keys   names of keys that some table has
    """
    values = tomllib.loads(chance.choice(texts))
    for _ in range(chance.choice((0, 1, 1, 1, 2, 4))):
        tables = list(_tables(values))
        _change(chance, chance.choice(tables), keys)
    text = _toml(values)
    for _ in range(chance.choice((0, 0, 0, 1, 2))):
        text = mutated_text(chance, text)
    if chance.random() < 0.02:
        text += "\n" + chance.choice(RARE_ENDINGS)
    content = text.encode(chance.choice(["utf-8"] * 12 + ["utf-8-sig", "utf-16", "utf-7"]), "replace")
    return mutated_bytes(chance, content) if chance.random() < 0.1 else content


def _tables(values: dict[str, Any]) -> Any:
    """All tables of a case, at any depth."""
    yield values
    for each in values.values():
        for inner in each if isinstance(each, list) else [each]:
            if isinstance(inner, dict):
                yield from _tables(inner)


def _change(chance: Random, table: dict[str, Any], keys: list[str]) -> None:
    """Change, remove or add one key of a table, or nest tables in it."""
    known = sorted(table)
    kind = chance.choice(("set", "set", "scale", "scale", "scale", "delete", "add", "add", "nest"))
    if kind == "delete" and known:
        table.pop(chance.choice(known))
    elif kind == "set" and known:
        table[chance.choice(known)] = odd_value(chance)
    elif kind == "scale" and known:
        name = chance.choice(known)
        if isinstance(table[name], int | float) and abs(table[name]) < 1e300:
            table[name] = _scaled(chance, table[name])
    elif kind == "add":
        name = chance.choice(keys) if chance.random() < 0.8 else odd_text(chance, 10)
        table[name] = chance.choice([odd_value(chance), chance.uniform(0.0, 2.0), 10.0 ** chance.uniform(-9.0, 9.0)])
    else:
        for _ in range(chance.randrange(1, 30)):
            inner = table.setdefault(chance.choice(["bed", "fluid", "a"]), {})
            if not isinstance(inner, dict):
                break
            table = inner


def _scaled(chance: Random, value: float) -> float:
    """A number made larger or smaller by up to 12 decades, rarely by 300."""
    power = chance.uniform(-300.0, 300.0) if chance.random() < 0.2 else chance.uniform(-12.0, 12.0)
    return min(float(value) * 10.0**power, 1.7e308)


def _toml(values: dict[str, Any]) -> str:
    try:
        return tomli_w.dumps(values)
    except (RecursionError, ValueError, TypeError):
        return "until = 1"


def mutated_text(chance: Random, text: str) -> str:
    """A text with a few characters replaced."""
    where = chance.randrange(len(text) + 1)
    return text[:where] + odd_text(chance, 6) + text[where + chance.randrange(6) :]


def mutated_bytes(chance: Random, content: bytes) -> bytes:
    """A content with bytes changed, removed or repeated."""
    if not content:
        return bytes(chance.randrange(256) for _ in range(chance.randrange(20)))
    kind, where = chance.randrange(6), chance.randrange(len(content))
    if kind == 0:
        return content[:where]
    if kind == 1:
        return content[:where] + bytes(chance.randrange(256) for _ in range(chance.randrange(9))) + content[where:]
    if kind == 2:
        return content + content[: chance.randrange(2000)]
    if kind == 3:
        return content[:where] + bytes(chance.randrange(1, 5000)) + content[where:]
    changed = bytearray(content)
    for _ in range(chance.choice((1, 1, 3, 30))):
        changed[chance.randrange(len(changed))] = chance.randrange(256)
    return bytes(changed)


def mutated_table(chance: Random, texts: list[str]) -> bytes:
    """A CSV file with changed cells, lines, separators and bytes."""
    rows = [line.split(",") for line in chance.choice(texts).splitlines()]
    for _ in range(chance.choice((0, 1, 1, 2, 4))):
        row = chance.choice(rows)
        kind = chance.randrange(6)
        if kind < 3:
            row[chance.randrange(len(row))] = str(chance.choice([*ODD_NUMBERS[:-7], *ODD_WORDS, odd_text(chance, 8)]))
        elif kind == 3:
            row.append("1.0")
        elif kind == 4 and len(rows) > 1:
            rows.remove(row)
        else:
            rows.insert(chance.randrange(len(rows) + 1), copy.copy(row))
        rows = [row for row in rows if row] or [["x"]]
    sign, end = chance.choice(",,,;\t"), chance.choice(("\n", "\n", "\n", "\r\n", "\r"))
    text = end.join(sign.join(row) for row in rows)
    if chance.random() < 0.3:
        text = mutated_text(chance, text)
    content = text.encode(chance.choice(["utf-8"] * 8 + ["utf-16", "latin-1", "utf-8-sig"]), "replace")
    return mutated_bytes(chance, content) if chance.random() < 0.2 else content


def mutated_words(chance: Random, lines: list[list[str]], options: list[str], keys: list[str]) -> list[str]:
    """A command line with words changed, dropped, doubled, and options added.

    lines    valid command lines, without the name of the program
    options  names of options of some command
    keys     keys of a case, `table.key`
    """
    words = list(chance.choice(lines))
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        where, kind = chance.randrange(len(words) + 1), chance.randrange(7)
        if kind == 0 and words:
            words.pop(min(where, len(words) - 1))
        elif kind == 1 and words:
            words[min(where, len(words) - 1)] = _odd_word(chance)
        elif kind == 2 and words:
            words.insert(where, chance.choice(words))
        elif kind == 3 and words:
            place = min(where, len(words) - 1)
            words[place] = mutated_text(chance, words[place])
        elif kind == 4:
            words[where:where] = [chance.choice(options), _odd_word(chance)]
        else:
            value = chance.choice([_odd_word(chance), str(chance.choice(ODD_NUMBERS[:-7]))])
            words += ["--set", f"{chance.choice(keys)}={value}"]
    return [harmless(word) for word in words]


def _odd_word(chance: Random) -> str:
    return str(chance.choice([*ODD_WORDS, *map(str, ODD_NUMBERS[:12]), odd_text(chance, 12)]))


def harmless(word: str) -> str:
    """A word that an operating system passes on, and that names no file outside of the folder of a trial."""
    return word.replace("\0", "").replace("/", "_").replace("~", "_")[:20_000]


def mutate_folder(chance: Random, folder: Path) -> list[str]:
    """Damage a run folder; returns what was done."""
    done = []
    for _ in range(chance.choice((1, 1, 2, 3))):
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        if not files:
            break
        path = chance.choice(files)
        done.append(f"{path.relative_to(folder)}: {_damage(chance, path, files)}")
    return done


def _damage(chance: Random, path: Path, files: list[Path]) -> str:
    """Change one file of a run folder; returns how."""
    kind = chance.choice(("bytes", "bytes", "remove", "empty", "swap", "folder", "text", "hdf5", "hdf5"))
    if kind == "remove":
        path.unlink()
    elif kind == "empty":
        path.write_bytes(b"")
    elif kind == "swap":
        path.write_bytes(chance.choice(files).read_bytes())
    elif kind == "folder":
        path.unlink()
        path.mkdir()
    elif path.suffix == ".json" and kind != "bytes":
        path.write_text(json.dumps(_odd_json(chance, _json(path)), default=str))
    elif path.suffix == ".h5" and kind == "hdf5":
        return f"hdf5: {_damage_hdf5(chance, path)}"
    elif path.suffix == ".toml":
        path.write_text(mutated_text(chance, path.read_text(errors="replace")), errors="replace")
    else:
        path.write_bytes(mutated_bytes(chance, path.read_bytes()))
        kind = "bytes"
    return kind


def _json(path: Path) -> Any:
    """The values of a JSON file, unless it has been damaged before."""
    try:
        return json.loads(path.read_text())
    except ValueError:
        return {}


def _odd_json(chance: Random, values: Any) -> Any:
    """Nested values with one of them changed or removed."""
    if not isinstance(values, dict) or not values:
        return odd_value(chance)
    name = chance.choice(sorted(values))
    if isinstance(values[name], dict) and chance.random() < 0.7:
        return values | {name: _odd_json(chance, values[name])}
    if chance.random() < 0.3:
        return {key: each for key, each in values.items() if key != name}
    return values | {name: odd_value(chance)}


def _damage_hdf5(chance: Random, path: Path) -> str:
    """Remove or replace a dataset or an attribute of a file that remains valid HDF5."""
    import h5py
    import numpy as np

    try:
        with h5py.File(path, "r+") as file:
            names: list[str] = []
            file.visit(names.append)
            name = chance.choice(names) if names else "x"
            if chance.random() < 0.2 and len(file.attrs):
                attribute = chance.choice(sorted(file.attrs))
                file.attrs[attribute] = chance.choice(["text", np.nan, -1, np.zeros(3)])
                return f"attribute {attribute}"
            if name in file:
                del file[name]
            if chance.random() < 0.7:
                file[name] = chance.choice(
                    [0.0, np.zeros(0), np.zeros((2, 2)), np.full(3, np.nan), "text", np.arange(7), np.zeros((3, 3, 3))]
                )
            return name
    except (OSError, KeyError, RuntimeError, ValueError) as failure:
        return f"not changed: {failure}"
