"""What `cfddem explain` shows: laws with equation, arguments, range, reference and plot, and keys of a case."""

from __future__ import annotations

import inspect
import json
import math
import re
import textwrap
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from pydantic.fields import FieldInfo
from pylatexenc.latex2text import LatexNodes2Text, MacroTextSpec
from pylatexenc.latex2text import get_default_latex_context_db as text_of_macros
from pylatexenc.latexwalker import LatexWalker
from pylatexenc.latexwalker import get_default_latex_context_db as arguments_of_macros
from pylatexenc.macrospec import MacroSpec

from cfddem.backend.errors import InputError, nearest
from cfddem.backend.tables import line_width
from cfddem.case.input_errors import TABLES, absent, sections_of
from cfddem.case.schema import Case
from cfddem.particles.interactions.contact_law import ContactLaw, all_contact_laws, contact_named
from closures import registry
from closures.registry import Law

NO_BREAK = "\N{NO-BREAK SPACE}"

CONTACT_LAW = "contact_law"
"""Kind of the contact laws that a run can use."""

OF_CFDEM = {
    "meilift": "laws.lift",
    "virtualmassforce": "laws.added_mass",
    "viscforce": "laws.viscous_stress",
    "gradpforce": "laws.model: the force of the pressure is always included",
    "archimedes": "laws.gravity: buoyancy is always included",
}
"""Key for each force model of CFDEM that is not a law."""

CURVES = 4
"""Curves in a plot, one for each value of the second argument."""


def laws() -> dict[str, dict[str, Law]]:
    """All laws by kind and name, including those of installed packages; a contact law by its force."""
    registry.load_built_in_laws()
    registry.load_package_laws()
    contacts = {law.name: Law(law.name, CONTACT_LAW, law.reference, function=law.force) for law in all_contact_laws()}
    return {**registry.REGISTRY, CONTACT_LAW: contacts}


def of_kind(name: str) -> dict[str, dict[str, Law]]:
    """The laws of a kind; empty if there is no such kind.

    >>> "di_felice" in of_kind("drag")["drag"], of_kind("di_felice")
    (True, {})
    """
    kind = name.replace("-", "_")
    return {kind: laws_of_kind} if (laws_of_kind := laws().get(kind)) else {}


def is_law(name: str) -> bool:
    """Whether a law has a name, which may begin with its kind."""
    name = name.replace("-", "_")
    return any(name in (law.name, f"{law.kind}.{law.name}") for those in laws().values() for law in those.values())


def is_table(name: str) -> bool:
    """Whether a case has a table of this name.

    >>> is_table("fluid"), is_table("di_felice")
    (True, False)
    """
    return bool(sections_of(Case.model_fields[name.lower()])) if name.lower() in Case.model_fields else False


def containing(word: str) -> dict[str, dict[str, Law]]:
    """The laws whose name, first sentence or reference contains a word, by kind.

    >>> "exponent_richardson_zaki" in containing("richardson")["bed"]
    True
    """
    by_kind: dict[str, dict[str, Law]] = {}
    for law in (law for those in laws().values() for law in those.values()):
        if word.lower() in f"{law.name} {summary(law)['sentence']} {law.reference}".lower():
            by_kind.setdefault(law.kind, {})[law.name] = law
    return by_kind


def find(name: str) -> Law:
    """A law by its name, or by its kind and name where two laws share the name.

    >>> find("di_felice").kind, find("drag.stokes").kind
    ('drag', 'drag')
    """
    kind, _, word = name.replace("-", "_").rpartition(".")
    every = [law for those in laws().values() for law in those.values()]
    matching_laws = [law for law in every if law.name == word and kind in ("", law.kind)]
    if not matching_laws:
        authors = sorted({author.lower() for law in every for author in re.findall(r"[^\W\d_]{4,}", law.reference)})
        closest = (
            _closest(word, [law.name for law in every])
            or _closest(name, list(dict(_keys())))
            or _closest(name, authors)
        )
        raise InputError("law", name, f"a name listed by `cfddem explain`{closest}", absent(name))
    if len(matching_laws) > 1:
        raise InputError("law", name, f"unambiguous: {' or '.join(f'{law.kind}.{law.name}' for law in matching_laws)}")
    return matching_laws[0]


def _closest(word: str, names: list[str]) -> str:
    """A question for the closest known name, or the key that stands for a force of CFDEM; empty without one."""
    if word.lower() in OF_CFDEM:
        return f"; see {OF_CFDEM[word.lower()]}"
    suggestion = nearest(word, names).partition("did you mean ")[2]
    return f" (did you mean {suggestion}" if suggestion else ""


def summary(law: Law) -> dict[str, Any]:
    """Documentation of a law as plain values."""
    text = inspect.getdoc(law.function) or ""
    equation = re.search(r"\.\. math:: (.*?)\n\n", text + "\n\n", re.DOTALL)
    return {
        "name": law.name,
        "kind": law.kind,
        "sentence": text.split("\n\n")[0].replace("\n", " "),
        "equation": " ".join(equation[1].split()) if equation else None,
        "arguments": list(inspect.signature(law.function).parameters),
        "ranges": {name: [low, high] for name, (low, high) in law.ranges.items()},
        "reference": law.reference,
        "module": law.function.__module__,
    }


def page(law: Law) -> list[str]:
    """Documentation of a law as text, at most 100 columns wide."""
    out = [f"{law.name}, {law.kind}   ({law.function.__module__})", ""]
    text = inspect.getdoc(law.function) or ""
    paragraphs: list[str] = [paragraph for paragraph in text.split("\n\n") if not paragraph.lstrip().startswith(">>>")]
    for paragraph in paragraphs:
        if paragraph.startswith(".. math::"):
            out += _equation_lines(" ".join(paragraph.removeprefix(".. math::").split()))
        elif re.match(r"\w+(, \w+)*  +\S", paragraph):
            for line in plain_words(paragraph).split("\n"):
                indent = len(line) - len(re.sub(r"^(\w+(, \w+)*)?  +", "", line))
                out += textwrap.wrap(line, line_width(), subsequent_indent=" " * indent, drop_whitespace=True) or [""]
        else:
            out += textwrap.wrap(" ".join(plain_words(paragraph).split()), line_width())
        out.append("")
    if law.kind == CONTACT_LAW:
        out += _contact_lines(contact_named(law.name))
    for name, (low, high) in law.ranges.items():
        out.append(f"range of {name}: {low:g} to {high:g}")
    out += textwrap.wrap(f"reference: {law.reference}", line_width(), subsequent_indent="  ")
    return out


def _contact_lines(law: ContactLaw) -> list[str]:
    """Parameters and memory of a contact law."""
    parameters = ", ".join(f"{name} = {value:g}" for name, value in law.parameters.items())
    memory = ", ".join(f"{field.name} [{field.unit}]" for field in law.memory)
    lines = [f"in a case: [laws] contact = {law.name!r}".replace("'", '"')]
    lines += [f"parameters, in [laws.contact_parameters]: {parameters}"] * bool(parameters)
    lines += [f"memory of a pair: {memory}"] * bool(memory)
    return [part for line in lines for part in textwrap.wrap(line, line_width(), subsequent_indent="  ")]


def _equation_lines(equation: str) -> list[str]:
    """An equation in LaTeX as lines of text: one for each part between wide spaces."""
    out = []
    for part in re.split(r"\\q?quad|\\\\", equation):
        text = _solid_brackets(equation_text(part.strip()))
        out += textwrap.wrap(text, line_width() - 4, initial_indent="    ", subsequent_indent="        ")
    return [line.replace(NO_BREAK, " ") for line in out]


def _solid_brackets(equation: str) -> str:
    """An equation without places for a line break inside brackets."""
    depth, out = 0, ""
    for letter in equation:
        depth += (letter in "([") - (letter in ")]")
        out += NO_BREAK if letter == " " and depth > 0 else letter
    return out


def listing(laws_by_kind: Mapping[str, Mapping[str, Law]]) -> list[str]:
    """Laws by kind: one line each, and one for the range if there is one, at most 100 columns wide."""
    out: list[str] = []
    for kind, those in sorted(laws_by_kind.items()):
        out += ["", kind.replace("_", " ")]
        for law in those.values():
            sentence = plain_words(summary(law)["sentence"])
            out.append(textwrap.shorten(f"{law.name:.<36} {sentence}", line_width() - 2, placeholder=" ..."))
            out[-1] = "  " + re.sub(r"\.{2,}(?= )", lambda dots: " " * len(dots[0]), out[-1], count=1)
            if law.ranges:
                out += textwrap.wrap(
                    f"for {law.range_in_words}", line_width(), initial_indent=" " * 39, subsequent_indent=" " * 43
                )
    return out[1:]


def plain_words(text: str) -> str:
    """Text of a docstring without markup."""
    text = re.sub(r":\w+:`~?([^`]*)`", r"\1", text)
    return text.replace("``", "").replace("`", "")


# ---------------------------------------------------------------- plot


def plot(law: Law, output: Path) -> Path:
    """Plot a law over its first argument, with one curve for each value of the second.

    output   PNG file
    returns  the file
    """
    from cfddem.plotting import curves as plots

    names = list(inspect.signature(law.function).parameters)
    spans = {name: _span(law, name) for name in names}
    middle = {name: values[len(values) // 2] for name, values in spans.items()}
    figure, axes = plots.panels(width=6.4, height=4.4)
    others = spans[names[1]] if len(names) > 1 else [math.nan]
    chosen = [others[round(k * (len(others) - 1) / (CURVES - 1))] for k in range(CURVES)] if len(names) > 1 else others
    for value, colour in zip(chosen, plots.shades(len(chosen))):
        fixed = middle | ({names[1]: value} if len(names) > 1 else {})
        curve = [_value(law, fixed | {names[0]: x}) for x in spans[names[0]]]
        named = _setting(law, names[1], value) if len(names) > 1 else None
        axes.plot(spans[names[0]], curve, color=colour, label=named)
    if spans[names[0]][-1] > 100.0 * spans[names[0]][0] > 0.0:
        axes.set_xscale("log")
    low, high = axes.dataLim.intervaly
    if high > 100.0 * low > 0.0:
        axes.set_yscale("log")
    plots.label(axes, names[0].replace("_", " "), unit(law, names[0]), law.name.replace("_", " "), unit(law, "returns"))
    if len(names) > 1:
        plots.legend(axes)
    rest = [_setting(law, name, middle[name]) for name in names[2:]]
    axes.set_title("\n".join(textwrap.wrap(", ".join(rest), 70)) or law.kind, loc="left", fontsize=9)
    plots.save(figure, output)
    return output


def descriptions(function: Callable[..., Any]) -> dict[str, str]:
    """Description of each argument, from the docstring; arguments on one line share it.

    >>> def area(width: float, height: float) -> float:
    ...     '''Area of a rectangle.
    ...
    ...     width, height  of one side,
    ...                    without the rim [m]
    ...     returns        [m2]
    ...     '''
    >>> descriptions(area)["height"]
    'of one side, without the rim [m]'
    """
    texts: dict[str, str] = {}
    names: list[str] = []
    for line in (inspect.getdoc(function) or "").splitlines():
        if match := re.fullmatch(r"(\w+(?:, \w+)*) {2,}(\S.*)", line):
            names = match[1].split(", ")
            texts |= dict.fromkeys(names, match[2])
        elif names and line.startswith("  "):
            texts |= dict.fromkeys(names, f"{texts[names[0]]} {line.strip()}")
        else:
            names = []
    return texts


def unit(law: Law, name: str) -> str:
    """Unit of an argument, or of what a law returns, from the docstring of the law.

    >>> unit(find("reduced_modulus"), "modulus_j"), unit(find("reduced_modulus"), "returns")
    ('Pa', 'Pa')
    """
    return " or ".join(re.findall(r"\[([^\]]*)\]", descriptions(law.function).get(name, ""))) or "unit not given"


def _setting(law: Law, name: str, value: float) -> str:
    """An argument that is held at a value, as in `viscosity = 0.001 Pa s`."""
    of = unit(law, name)
    return f"{name.replace('_', ' ')} = {value:.3g}" + f" {of}" * (of not in ("-", "unit not given"))


def _span(law: Law, name: str) -> list[float]:
    """Values at which an argument is plotted."""
    from closures.check import samples

    return samples(law, name, 121)


def _value(law: Law, arguments: dict[str, float]) -> float:
    try:
        return float(law.function(**arguments))
    except (ArithmeticError, ValueError):
        return math.nan


# ---------------------------------------------------------------- equations on a terminal


_FRACTIONS = ("frac", "tfrac", "dfrac")
_NAME = r"(?:\d+(?:\.\d+)?|[A-Z][a-z]+|\w)"
_ATOM = re.compile(rf"{_NAME}(?:\^\*)?(?:_\w|_\{{\w+\}})?(?:\^[\w*]|\^\{{\w+\}})?")
"""Text that needs no brackets in a fraction: a number or symbol with its indices."""


def equation_text(equation: str) -> str:
    r"""An equation in LaTeX as plain text; fractions of sums and products get square brackets.

    >>> equation_text(r"h_\varepsilon = 0.37\,(\eta v / E^*)^{2/5}\,R^{*\,3/5}")
    'h_ε = 0.37 (η v / E*)^(2/5) R*^(3/5)'
    >>> equation_text(r"Ar = \frac{g\,\rho_f(\rho_p-\rho_f)d^3}{\eta^2} + \tfrac12")
    'Ar = [g ρ_f(ρ_p-ρ_f)d^3]/η^2 + 1/2'
    """
    source = re.sub(r"\\[,;: ]", "~", equation.replace(r"^\circ", "°").replace("&", ""))
    nodes, _, _ = LatexWalker(source, latex_context=_parser_macros()).get_latex_nodes()
    return _plain_indices(_converter().nodelist_to_text(nodes))


@cache
def _parser_macros() -> Any:
    macros = arguments_of_macros()
    macros.add_context_category("fractions", macros=[MacroSpec(name, "{{") for name in _FRACTIONS], prepend=True)
    return macros


@cache
def _converter() -> LatexNodes2Text:
    macros = text_of_macros()
    specs = [MacroTextSpec(name, simplify_repl=_fraction) for name in _FRACTIONS]
    specs += [MacroTextSpec(name, simplify_repl="") for name in ("bigl", "bigr", "Bigl", "Bigr", "!")]
    macros.add_context_category("equations", macros=specs, prepend=True)
    return LatexNodes2Text(
        latex_context=macros,
        math_mode="text",
        strict_latex_spaces="based-on-source",
        keep_braced_groups=True,
        keep_braced_groups_minlen=2,
    )


def _fraction(node: Any, l2tobj: LatexNodes2Text) -> str:
    over, under = (_bracketed(l2tobj.nodelist_to_text([argument])) for argument in node.nodeargd.argnlist)
    return f" {over}/{under} "


def _bracketed(part: str) -> str:
    """Numerator or denominator, in brackets unless it is a single symbol or number."""
    part = part.strip()
    if part.startswith("{") and part.endswith("}"):
        part = part[1:-1].strip()
    return part if _ATOM.fullmatch(part) else f"[{part}]"


def _plain_indices(text: str) -> str:
    """Text with braces after ^ and _ replaced by round brackets, or by nothing around a word or a number."""
    while braces := re.search(r"([\^_]?)\{([^{}]*)\}", text):
        mark, inner = braces[1], braces[2].strip()
        bare = not mark or len(inner) == 1 or (inner.isalnum() if mark == "_" else inner.isdigit())
        text = text[: braces.start()] + mark + (inner if bare else f"({inner})") + text[braces.end() :]
    text = re.sub(r"\^\(\* ?(\w)\)", r"*^\1", text)
    text = re.sub(r"\^\(\* ?([^()]*)\)", r"*^(\1)", text).replace("^*", "*")
    return re.sub(r"(?<=[\[(]) | (?=[\]),])", "", " ".join(text.split()))


# ---------------------------------------------------------------- keys of a case


SEVERAL = {name: f"{name}.NAME" for name in ("material", "compare")} | {"pair": "pair.NAME.NAME"}
SEVERAL |= {name: f"{name}.NUMBER" for name in ("wall", "feed", "outlet")}
"""Tables that a case has several of, by the place of their keys."""


def matching(name: str) -> dict[str, FieldInfo]:
    """A key, all keys of a table, or those with a word: in their names, as a choice, or else in their descriptions.

    >>> key_lines(matching("bed.jet.velocity")), key_lines(matching("run.until"))[0][:34]
    (['bed.jet.velocity = (required)     superficial velocity, upward [m/s]'], 'run.until = (required)            ')
    """
    every, word = dict(_keys()), name.lower()
    plain = {key: re.sub(r"\.(NAME|NUMBER)\b", "", key).lower() for key in every}
    keys = [
        key for key in every if any(name == word or name.startswith(f"{word}.") for name in (key.lower(), plain[key]))
    ]
    keys = keys or [key for key in every if word in key.lower()]
    keys = keys or [key for key, field in every.items() if word in key_summary(key, field)["choices"]]
    keys = keys or [key for key, field in every.items() if word in re.findall(r"\w{4,}", field.description or "")]
    return {key: every[key] for key in keys}


def not_there(name: str) -> list[str]:
    """What the table of a name does not have, in lines of at most 100 columns; empty for other names."""
    words = TABLES.get(name.lower(), "")
    return ["", *textwrap.wrap(f"{words} The page Limits has more.", line_width())] if words else []


def _keys() -> Iterator[tuple[str, FieldInfo]]:
    """Every key with its table."""
    for name, field in Case.model_fields.items():
        parts = sections_of(field)
        if not parts:
            yield name, field
            continue
        for key, annotated in parts[0].model_fields.items():
            yield f"{SEVERAL.get(name, name)}.{key}", annotated
            below = f"{SEVERAL.get(name, name)}.{key}{'.NAME' * str(annotated.annotation).startswith('dict')}"
            for part in sections_of(annotated):
                yield from ((f"{below}.{inner}", rest) for inner, rest in part.model_fields.items())


def key_lines(keys: Mapping[str, FieldInfo]) -> list[str]:
    """Keys with default and meaning, in lines of at most 100 columns."""
    out: list[str] = []
    for key, field in keys.items():
        default, choices = _default(field), _choices(field)
        shown = " = (required)" if field.is_required() else "" if default is None else f" = {json.dumps(default)}"
        meaning = (field.description or "") + (f"; one of {choices[0]}" if choices else "")
        out += textwrap.wrap(f"{key + shown:<33} {meaning}", line_width(), subsequent_indent=" " * 34)
    return out


def key_summary(key: str, field: FieldInfo) -> dict[str, Any]:
    """Documentation of a key as plain values.

    >>> found = key_summary("run.until", dict(_keys())["run.until"])
    >>> found["required"], found["unit"]
    (True, 's')
    """
    meaning, choices = field.description or "", _choices(field)
    units = re.findall(r"\[([^\]]*)\]$", meaning)
    words = [choice.strip(" '\"") for choice in choices[0].split(",")] if choices else []
    return {
        "key": key, "required": field.is_required(), "default": _default(field), "meaning": meaning,
        "unit": units[0] if units else None, "choices": words,
    }  # fmt: skip


def _default(field: FieldInfo) -> Any:
    """Default of a key; None where it has none, or one that stands for a key that is left out."""
    default = None if field.is_required() else field.get_default()
    return None if any(getattr(rule, "gt", None) == default for rule in field.metadata) else default


def _choices(field: FieldInfo) -> list[str]:
    return re.findall(r"Literal\[([^\]]*)\]", str(field.annotation))
