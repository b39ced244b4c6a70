"""The page of the map of films from its data: its numbers, its figure, and its row in the list of cases.

`python docs/tools/film_map.py RESULTS` takes the finished beds of `cfddem validate film-map -o RESULTS`, runs none, and
stores data, table and figure in docs. Without a folder it writes the page from the stored data.
"""

from __future__ import annotations

import json
import math
import re
import shutil
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from scipy.stats import t as student

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT)] * (str(ROOT) not in sys.path)

from scenarios.validation.film_map import effects  # noqa: E402
from scenarios.validation.film_map.design import (  # noqa: E402
    CORNERS,
    DRY,
    SEEDS,
    SOLID_FRACTIONS,
    STILL,
    Point,
    Run,
    is_corner,
    is_end,
    plan,
)
from scenarios.validation.film_map.effects import Beds, Estimate  # noqa: E402

LIST = ROOT / "scenarios" / "README.md"
DATA = ROOT / "docs" / "tables" / "film-map.csv"
PAGE = ROOT / "scenarios" / "validation" / "film_map" / "README.md"
BEGIN, END = "<!-- from the data: begin -->", "<!-- from the data: end -->"

AGITATED = STILL._replace(agitated=True)

Pair = tuple[Point, str]
COLUMNS: dict[str, tuple[str, float, bool]] = {
    "bed_height": ("bed height [%]", 100.0, True),
    "granular_temperature": ("granular temperature [%]", 100.0, True),
    "collisions": ("collisions [%]", 100.0, True),
    "dissipation": ("dissipation [%]", 100.0, True),
    "stokes": ("median St", 1.0, False),
    "solids_meet": ("solids meet [%]", 100.0, False),
    "dissipated": ("share of films and contacts [%]", 100.0, False),
}
"""Heading of each column of the tables, factor to its unit, and whether it is a change by films."""


def store(results: Path) -> None:
    """Make table, data and figure of the finished beds, and store them in docs."""
    from scenarios.validation.targets import measure

    report = measure("film-map", results, hours=0.0)
    made = results / "film-map"
    shutil.copyfile(made / "beds.csv", DATA)
    shutil.copyfile(made / "map.png", ROOT / "docs" / "images" / "film_map.png")
    for row in report["rows"]:
        row.pop("points", None)
    DATA.with_suffix(".json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")


def write() -> None:
    """Write the page and its row in the list of cases from the stored data."""
    beds = stored()
    PAGE.write_text(page_of(beds), encoding="utf-8")
    row = r"(\(validation/film_map/README\.md\) \| [^|]+ \| )[^|]+( \|)"
    listed = re.sub(row, lambda found: f"{found[1]}{headline(beds)}{found[2]}", LIST.read_text(encoding="utf-8"))
    LIST.write_text(listed, encoding="utf-8")


def stored() -> Beds:
    """The beds of the stored data; none before there are any."""
    return {} if not DATA.exists() else effects.read_beds(DATA.read_text(encoding="utf-8").splitlines())


def page_of(beds: Beds) -> str:
    """The page with the numbers of some beds."""
    page, said = PAGE.read_text(encoding="utf-8"), headline(beds)
    page = re.sub(r"\n\n\*\*.*?\*\*\n\n", lambda _: f"\n\n**{wrapped(said, 116)}**\n\n", page, count=1, flags=re.DOTALL)
    inner = "\n\n".join([f"**{wrapped(said, 116)}**", *(sections(beds) if is_known(beds) else ())])
    before, after = page.split(BEGIN)[0], page.split(END)[1]
    return f"{before}{BEGIN}\n\n{inner}\n\n{END}{after}"


def is_known(beds: Beds) -> bool:
    """Whether the first part has run with one seed: fewer beds say nothing about the map."""
    return set(needed()) <= set(beds)


def needed() -> list[Run]:
    """Beds at the lowest and highest Stokes numbers with one seed."""
    return [each for each in plan() if is_end(each.point) and each.seed == SEEDS[0] and each.film != "soft"]


# ---------------------------------------------------------------- numbers


def shown(found: Estimate | None, factor: float, signed: bool) -> str:
    """A mean with its error in two digits, or with three digits where there is one seed.

    >>> shown(Estimate(-0.1234, 0.021, 3), 100.0, True), shown(Estimate(0.1234, math.nan, 1), 100.0, False)
    ('-12.3 ± 2.1', '12.3')
    """
    if found is None:
        return ""
    value, error = factor * found.value, factor * found.error
    size = abs(value) if math.isnan(error) or error == 0.0 else error
    places = max(0, (2 if math.isnan(error) else 1) - math.floor(math.log10(size))) if size > 0.0 else 1
    text = f"{value:{'+' if signed else ''}.{places}f}"
    return text if math.isnan(error) else f"{text} ± {error:.{places}f}"


def of_pair(beds: Beds, pair: Pair, what: str) -> Estimate | None:
    """The value of a column of a bed with a film."""
    return (effects.change if COLUMNS[what][2] else effects.mean)(beds, *pair, what)


def mean_of(beds: Beds, pairs: Iterable[Pair], what: str) -> Estimate | None:
    """Mean over several beds; its error is that by the seeds, not by the difference between the beds."""
    found = [each for pair in pairs if (each := of_pair(beds, pair, what)) is not None]
    if not found:
        return None
    error = math.sqrt(sum(each.error**2 for each in found)) / len(found)
    return Estimate(float(np.mean([each.value for each in found])), error, min(each.seeds for each in found))


def clear(beds: Beds, pairs: Sequence[Pair], what: str) -> str:
    """How many changes are up and down beyond the interval that holds 95 % of them, by Student's t."""
    known = [each for pair in pairs if (each := of_pair(beds, pair, what)) is not None and not math.isnan(each.error)]
    if not known:
        return "errors are not known yet"
    limits = [float(student.ppf(0.975, each.seeds - 1)) * each.error for each in known]
    up, down = (sum(way * each.value > limit for each, limit in zip(known, limits)) for way in (1.0, -1.0))
    return f"up in {up} and down in {down} of {len(known)} beds, with 95 % confidence by Student's t"


def between(values: Sequence[float], unit: str = " %") -> str:
    """Lowest to highest of some values.

    >>> between([0.5, -1.25, 3.0])
    '-1.25 to 3 %'
    """
    return f"{min(values):.3g} to {max(values):.3g}{unit}" if values else "not known yet"


def values(beds: Beds, pairs: Iterable[Pair], what: str) -> list[float]:
    """The values of a column in its unit."""
    return [COLUMNS[what][1] * each.value for pair in pairs if (each := of_pair(beds, pair, what)) is not None]


# ---------------------------------------------------------------- text


def headline(beds: Beds) -> str:
    """The main result: what films of smooth and rough spheres change at the lowest and at the highest Stokes number."""
    if not is_known(beds):
        return f"The map has not been computed yet: {len(needed())} beds make its first part."
    asked = list(plan())
    part = "" if len(beds) == len(asked) else f" ({len(beds)} of {len(asked)} beds so far)"
    stokes, collisions, temperature, height = (
        [f"{COLUMNS[what][1] * found.value:{form}}" for each in ends(beds) if (found := mean_of(beds, each, what))]
        for what, form in (
            ("stokes", ".3g"), ("collisions", "+.0f"), ("granular_temperature", "+.0f"), ("bed_height", "+.2f")
        )
    )  # fmt: skip
    return (
        f"At median Stokes numbers of {' and '.join(stokes)}, films change collisions by {' and '.join(collisions)} %, "
        f"granular temperature by {' and '.join(temperature)} %, and bed height by {' and '.join(height)} %{part}."
    )


def hard(beds: Beds) -> list[Pair]:
    """Beds of the coarse design, of smooth and rough spheres."""
    return [(point, film) for point, film in effects.compared(beds) if is_corner(point) and film != "soft"]


def ends(beds: Beds) -> list[list[Pair]]:
    """Those at the lowest and at the highest Stokes number of the superficial velocity."""
    return [[pair for pair in hard(beds) if is_end(pair[0]) and pair[0].reynolds == level] for level in CORNERS[0]]


def sections(beds: Beds) -> Iterator[str]:
    """The parts of the results."""
    pairs, asked = effects.compared(beds), list(plan())
    seeds = sorted({found.seeds for pair in pairs if (found := of_pair(beds, pair, "bed_height")) is not None})
    yield wrapped(
        f"{len(beds)} of {len(asked)} beds have run; {len(pairs)} beds with films are compared with the bed without, "
        f"from {' to '.join(f'{each}' for each in sorted({min(seeds), max(seeds)}))} seeds. "
        "Errors are standard errors over the seeds; numbers without an error are of one seed."
    )
    yield "### Means over the map"
    yield wrapped(
        "Beds of the coarse design; rows by Stokes number and solid fraction are of smooth and rough spheres. Changes "
        "are relative to the bed without films. The errors are those by the seeds."
    )
    yield table(beds, "beds", list(_groups(beds)))
    moved, still = (effects.mean(beds, point, DRY, "granular_temperature") for point in (AGITATED, STILL))
    if moved is not None and still is not None:
        yield wrapped(
            f"Without agitation and films, the bed of the last rows has a granular temperature of "
            f"{shown(still, 1e6, False)} mm2/s2, with agitation {shown(moved, 1e6, False)}."
        )
    yield "### What the papers say, and what the map says"
    yield "\n".join(["| paper | statement | the map |", "|:--|:--|:--|", *_statements(beds)])
    yield "### All beds"
    yield table(beds, "bed", [(f"{_named(point)}, {film}", [(point, film)]) for point, film in pairs])


def _groups(beds: Beds) -> Iterator[tuple[str, list[Pair]]]:
    """Groups of beds of the coarse design, by Stokes number, solid fraction and film, and those without agitation."""
    for point in sorted({pair[0]._replace(solid_fraction=0.0) for pair in hard(beds)}, key=lambda each: each.stokes):
        name = f"$St_U$ = {point.stokes:.3g}: $Re_m$ {point.reynolds:g}, density ratio {point.density_ratio:g}"
        yield name, [pair for pair in hard(beds) if pair[0]._replace(solid_fraction=0.0) == point]
    for level in SOLID_FRACTIONS:
        yield f"solid fraction {level:g}", [pair for pair in hard(beds) if pair[0].solid_fraction == level]
    pairs = effects.compared(beds)
    for film in effects.ROUGHNESS:
        yield f"{film} spheres", [pair for pair in pairs if is_corner(pair[0]) and pair[1] == film]
    if still := [pair for pair in pairs if pair[0] == STILL]:
        yield "one bed without agitation", still
        yield "the same with agitation", [pair for pair in hard(beds) if pair[0] == AGITATED]


def table(beds: Beds, first: str, rows: Sequence[tuple[str, list[Pair]]]) -> str:
    """A table with a row for each group of beds."""
    lines = [f"| {first} | {' | '.join(title for title, _, _ in COLUMNS.values())} |", "|:--|" + "--:|" * len(COLUMNS)]
    for name, pairs in rows:
        if pairs:
            cells = (shown(mean_of(beds, pairs, what), factor, is_a) for what, (_, factor, is_a) in COLUMNS.items())
            lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _named(point: Point) -> str:
    words = f"$Re_m$ {point.reynolds:g}, {point.solid_fraction:g} solids, ratio {point.density_ratio:g}"
    return words if point.agitated else f"{words}, without agitation"


def _statements(beds: Beds) -> Iterator[str]:
    """Statements of the papers beside the numbers of the coarse design."""
    pairs, (low, high) = hard(beds), ends(beds)
    rough, smooth = ([pair for pair in pairs if pair[1] == film] for film in ("rough", "smooth"))
    nijssen, davis, singh = "Nijssen et al. (2023)", "Davis (2023)", "Singh et al. (2026)"
    yield (
        f"| {nijssen} | films significantly influence liquid beds; experiments find that they raise or lower the bed | "
        f"height changes by {between(values(beds, pairs, 'bed_height'))}: {clear(beds, pairs, 'bed_height')} |"
    )
    temperature = values(beds, pairs, "granular_temperature")
    yield (
        f"| Liu et al. (2017), cited there | films lower the expansion and the granular temperature | granular "
        f"temperature changes by {between(temperature)}: {clear(beds, pairs, 'granular_temperature')} |"
    )
    along, across = (_changes(beds, pairs, f"temperature_{way}") for way in ("along", "across"))
    yield (
        "| Campos et al. (2021), Wang et al. (2012), cited there | films make the bed less, or more, homogeneous | "
        f"these beds are too low for layers; the motion along gravity, in which waves are, changes by "
        f"{between(along)}, that across by {between(across)} |"
    )
    yield (
        f"| {nijssen} | no rebound below a critical St of 5 to 20 | at a median St of "
        f"{between(values(beds, low, 'stokes'), '')} solids meet in {between(values(beds, low, 'solids_meet'))} of the "
        f"collisions; a pair alone would not touch below 3.9 (rough) to 9.2 (smooth) |"
    )
    yield (
        f"| {nijssen} | films are negligible above St = 2000 | at a median St of "
        f"{between(values(beds, high, 'stokes'), '')} the collision rate still changes by "
        f"{between(values(beds, high, 'collisions'))}; larger St are not on the map |"
    )
    rates = [shown(mean_of(beds, each, "collisions"), 100.0, True) or "?" for each in (smooth, rough)]
    yield (
        f"| {nijssen} | smoother spheres are damped more | the collision rate changes by {rates[0]} % (smooth) and "
        f"{rates[1]} % (rough), means over the same beds |"
    )
    lasting = [between(_changes(beds, each, "contacts")) for each in (low, high)]
    yield (
        f"| {davis} | wet spheres stay together up to a normal St of order 1, and separate above | contacts at one "
        f"time change by {lasting[0]} at the lowest St and by {lasting[1]} at the highest; immersed beds have no "
        "pull that holds spheres together |"
    )
    yield (
        "| Buck et al. (2018), Punch et al. (2023) | layers take the energy of normal motion; tangential forces matter "
        f"at low St | films and contacts take {between(values(beds, pairs, 'dissipated'))} of the dissipation of the "
        "bed, drag the rest; films on the map act along the line of centres alone |"
    )
    yield (
        f"| {singh} | most models take the Stokes number alone, yet a second number matters | {_spread(beds, pairs)} |"
    )


def _changes(beds: Beds, pairs: Iterable[Pair], what: str) -> list[float]:
    """Changes of a quantity by films [%]."""
    return [100.0 * each.value for pair in pairs if (each := effects.change(beds, *pair, what)) is not None]


def _spread(beds: Beds, pairs: Sequence[Pair]) -> str:
    """How much of the differences between collision rates a line in log St explains."""
    found = [
        (math.log(stokes.value), rate.value)
        for pair in pairs
        if (stokes := of_pair(beds, pair, "stokes")) is not None
        and (rate := of_pair(beds, pair, "collisions")) is not None
        and stokes.value > 0.0
    ]
    if len(found) < 4:
        return "not known yet"
    x, y = np.array(found).T
    left = y - np.polyval(np.polyfit(x, y, 1), x)
    share = 1.0 - float(np.var(left) / np.var(y))
    return (
        f"a line in the logarithm of the median St explains {100.0 * share:.0f} % of the variance of the change of the "
        f"collision rate over {len(found)} beds; a standard deviation of {100.0 * float(np.std(left)):.0f} % is left"
    )


def wrapped(text: str, width: int = 120) -> str:
    """Text in lines of a page."""
    import textwrap

    return "\n".join(textwrap.wrap(text, width, break_long_words=False, break_on_hyphens=False))


if __name__ == "__main__":
    if len(sys.argv) > 1:
        store(Path(sys.argv[1]))
    write()
