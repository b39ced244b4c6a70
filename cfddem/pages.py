"""The page of a law: sentence, equation, arguments, range, reference; and a small plot of it."""

from __future__ import annotations

import inspect
import math
import re
import textwrap
from pathlib import Path
from typing import Any

from cfddem.errors import InputError, nearest
from closures import shelf
from closures.law import Law

WIDTH = 100
"""Columns of a terminal."""

CURVES = 4
"""Curves of a plot, one for each value of a second argument."""


def laws() -> dict[str, dict[str, Law]]:
    """All laws by kind and name, those of installed packages too."""
    shelf.fill()
    shelf.fill_from_packages()
    return shelf.SHELF


def find(name: str) -> Law:
    """A law by its name.

    >>> find("di_felice").kind
    'drag'
    """
    known = {law.name: law for kind in laws().values() for law in kind.values()}
    word = name.replace("-", "_")
    if word not in known:
        raise InputError("law", name, f"a name that `cfddem explain` lists, such as {_alike(word, list(known))}")
    return known[word]


def _alike(word: str, known: list[str]) -> str:
    """The nearest known names."""
    found = nearest(word, known).partition("did you mean ")[2]
    return found.rstrip("?)").strip("'") or "di_felice"


def summary(law: Law) -> dict[str, Any]:
    """Plain values of a page."""
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
    """The page of a law as text, at most 100 columns wide."""
    out = [f"{law.name}, {law.kind}   ({law.function.__module__})", ""]
    text = inspect.getdoc(law.function) or ""
    paragraphs: list[str] = [each for each in text.split("\n\n") if not each.lstrip().startswith(">>>")]
    for paragraph in paragraphs:
        if paragraph.startswith(".. math::"):
            equation = plain(" ".join(paragraph.removeprefix(".. math::").split()))
            out += textwrap.wrap(equation, WIDTH - 4, initial_indent="    ", subsequent_indent="        ")
        elif re.match(r"\w+(, \w+)*  +\S", paragraph):
            for line in plain_words(paragraph).split("\n"):
                indent = len(line) - len(re.sub(r"^(\w+(, \w+)*)?  +", "", line))
                out += textwrap.wrap(line, WIDTH, subsequent_indent=" " * indent, drop_whitespace=True) or [""]
        else:
            out += textwrap.wrap(" ".join(plain_words(paragraph).split()), WIDTH)
        out.append("")
    for name, (low, high) in law.ranges.items():
        out.append(f"fitted for {name} from {low:g} to {high:g}")
    out += textwrap.wrap(f"reference: {law.reference}", WIDTH, subsequent_indent="  ")
    return out


def listing() -> list[str]:
    """The shelf: all laws by kind, a line each and one more for what it was fitted to, at most 100 columns wide."""
    out: list[str] = []
    for kind, those in sorted(laws().items()):
        out += ["", kind.replace("_", " ")]
        for law in those.values():
            sentence = plain_words(summary(law)["sentence"])
            out.append(textwrap.shorten(f"{law.name:.<36} {sentence}", WIDTH - 2, placeholder=" ..."))
            out[-1] = "  " + re.sub(r"\.{2,}(?= )", lambda dots: " " * len(dots[0]), out[-1], count=1)
            if law.ranges:
                out += textwrap.wrap(
                    f"for {law.fitted_for}", WIDTH, initial_indent=" " * 39, subsequent_indent=" " * 43
                )
    return out[1:]


# ---------------------------------------------------------------- equations on a terminal

_LETTERS = """alpha α beta β gamma γ delta δ epsilon ε varepsilon ε zeta ζ eta η theta θ kappa κ lambda λ mu μ nu ν xi ξ
pi π rho ρ sigma σ tau τ phi φ varphi φ chi χ psi ψ omega ω Gamma Γ Delta Δ Lambda Λ Phi Φ Psi Ψ Omega Ω cdot · times ×
le ≤ leq ≤ ge ≥ geq ≥ ll ≪ gg ≫ neq ≠ approx ≈ propto ∝ pm ± infty ∞ to → sum Σ int ∫ partial ∂ nabla ∇ sqrt √ prime '
langle ⟨ rangle ⟩ dots ... ldots ... ell l"""
_WORDS = _LETTERS.split()
_SILENT = ("left", "right", "mathrm", "text", "mathbf", "operatorname", "big", "Big", "displaystyle")
_SIGNS = dict(zip(_WORDS[::2], _WORDS[1::2])) | dict.fromkeys(("quad", "qquad"), "  ") | dict.fromkeys(_SILENT, "")

_TOKEN = r"(\{(?:[^{}]|\{(?:[^{}]|\{(?:[^{}]|\{[^{}]*\})*\})*\})*\}|\\[A-Za-z]+|[^\s{}\\])"
_FRACTION = re.compile(rf"\\[td]?frac\s*{_TOKEN}\s*{_TOKEN}")
_GROUP = r"\{((?:[^{}]|\{(?:[^{}]|\{(?:[^{}]|\{[^{}]*\})*\})*\})*)\}"


def plain(equation: str) -> str:
    r"""An equation in LaTeX as one reads it on a terminal.

    >>> plain(r"h_\varepsilon = 0.37\,(\eta v / E^*)^{2/5}\,R^{*\,3/5}")
    'h_ε = 0.37 (η v / E*)^(2/5) R*^(3/5)'
    >>> plain(r"Ar = \frac{g\,\rho_f(\rho_p-\rho_f)d^3}{\eta^2}")
    'Ar = [g ρ_f(ρ_p-ρ_f)d^3]/η^2'
    """
    text = re.sub(r"\\[,;:! ]", " ", equation.replace(r"^\circ", "°"))
    while found := _FRACTION.search(text):
        over, under = (_bracketed(each) for each in found.groups())
        text = f"{text[: found.start()]} {over}/{under} {text[found.end() :]}"
    text = re.sub(r"\\([A-Za-z]+)", lambda word: _SIGNS.get(word[1], word[1]), text)
    while found := re.search(rf"([\^_√]?){_GROUP}", text):
        inner = found[2].strip()
        short = len(inner) == 1 or not found[1] or (inner.isalnum() if found[1] == "_" else inner.isdigit())
        text = text[: found.start()] + found[1] + (inner if short else f"({inner})") + text[found.end() :]
    text = re.sub(r"\^\(\* ?(\w)\)", r"*^\1", text)
    text = re.sub(r"\^\(\* ?([^()]*)\)", r"*^(\1)", text).replace("^*", "*")
    return re.sub(r"(?<=[\[(]) | (?=[\]),])", "", " ".join(text.replace("\\", "").split()))


def _bracketed(part: str) -> str:
    """A part of a fraction, in brackets where it is a sum or a product."""
    part = part.strip()
    if part.startswith("{") and part.endswith("}"):
        part = part[1:-1].strip()
    single = re.fullmatch(r"\\?[\w.]+(_\\?\w+|_\{\w+\})?(\^[\w*]|\^\{\w+\})?", part)
    return part if single and not re.match(r"[\d.]+[^\d.]", part) else f"[{part}]"


def plain_words(text: str) -> str:
    """Prose of a docstring without its markup."""
    text = re.sub(r":\w+:`~?([^`]*)`", r"\1", text)
    return text.replace("``", "").replace("`", "")


# ---------------------------------------------------------------- plot


def plot(law: Law, output: Path) -> Path:
    """Draw a law over its first argument, a curve for each value of the second.

    output   PNG to write
    returns  the file
    """
    from cfddem.view import plots

    names = list(inspect.signature(law.function).parameters)
    spans = {name: _span(law, name) for name in names}
    middle = {name: values[len(values) // 2] for name, values in spans.items()}
    figure, axes = plots.panels(width=6.4, height=4.4)
    others = spans[names[1]] if len(names) > 1 else [math.nan]
    chosen = [others[round(k * (len(others) - 1) / (CURVES - 1))] for k in range(CURVES)] if len(names) > 1 else others
    for value, colour in zip(chosen, plots.shades(len(chosen))):
        fixed = middle | ({names[1]: value} if len(names) > 1 else {})
        curve = [_value(law, fixed | {names[0]: x}) for x in spans[names[0]]]
        axes.plot(spans[names[0]], curve, color=colour, label=f"{names[1]} = {value:.3g}" if len(names) > 1 else None)
    if spans[names[0]][-1] > 100.0 * spans[names[0]][0] > 0.0:
        axes.set_xscale("log")
    low, high = axes.dataLim.intervaly
    if high > 100.0 * low > 0.0:
        axes.set_yscale("log")
    axes.set_xlabel(names[0].replace("_", " "))
    axes.set_ylabel(law.name.replace("_", " "))
    if len(names) > 1:
        plots.legend(axes)
    rest = [f"{name} = {middle[name]:.3g}" for name in names[2:]]
    axes.set_title("\n".join(textwrap.wrap(", ".join(rest), 70)) or law.kind, loc="left", fontsize=9)
    plots.save(figure, output)
    return output


def _span(law: Law, name: str) -> list[float]:
    """Values over which an argument is drawn."""
    from closures.check import samples

    return samples(law, name, 121)


def _value(law: Law, arguments: dict[str, float]) -> float:
    try:
        return float(law.function(**arguments))
    except (ArithmeticError, ValueError):
        return math.nan
