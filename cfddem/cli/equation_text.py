"""Equations in LaTeX as plain text for a terminal."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

from pylatexenc.latex2text import LatexNodes2Text, MacroTextSpec
from pylatexenc.latex2text import get_default_latex_context_db as text_of_macros
from pylatexenc.latexwalker import LatexWalker
from pylatexenc.latexwalker import get_default_latex_context_db as arguments_of_macros
from pylatexenc.macrospec import MacroSpec

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
    over, under = (_bracketed(l2tobj.nodelist_to_text([each])) for each in node.nodeargd.argnlist)
    return f" {over}/{under} "


def _bracketed(part: str) -> str:
    """Numerator or denominator, in brackets unless it is a single symbol or number."""
    part = part.strip()
    if part.startswith("{") and part.endswith("}"):
        part = part[1:-1].strip()
    return part if _ATOM.fullmatch(part) else f"[{part}]"


def _plain_indices(text: str) -> str:
    """Text with braces after ^ and _ replaced by round brackets, or by nothing around a word or a number."""
    while found := re.search(r"([\^_]?)\{([^{}]*)\}", text):
        mark, inner = found[1], found[2].strip()
        bare = not mark or len(inner) == 1 or (inner.isalnum() if mark == "_" else inner.isdigit())
        text = text[: found.start()] + mark + (inner if bare else f"({inner})") + text[found.end() :]
    text = re.sub(r"\^\(\* ?(\w)\)", r"*^\1", text)
    text = re.sub(r"\^\(\* ?([^()]*)\)", r"*^(\1)", text).replace("^*", "*")
    return re.sub(r"(?<=[\[(]) | (?=[\]),])", "", " ".join(text.split()))
