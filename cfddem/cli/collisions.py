"""Commands for collisions of a few spheres; loaded when one is called, because the scenarios load the compiler."""

from __future__ import annotations

import csv
import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np
from cyclopts import Parameter

from cfddem.backend.compile import announce_compilation
from cfddem.backend.errors import InputError, nearest
from cfddem.backend.law_choice import import_laws
from cfddem.backend.tables import table
from cfddem.case.materials import Material
from cfddem.cli.cases import LAWS
from cfddem.cli.explain_pages import descriptions
from cfddem.cli.json_output import print_json
from cfddem.io.files import require_folder
from scenarios.collisions import film_impact, immersed_pair, three_spheres, wet_pair, wet_wall
from scenarios.collisions.film_impact.figures import draw_moments
from scenarios.collisions.film_impact.figures import movie as write_movie
from scenarios.collisions.immersed_pair.measured import MeasuredCollisions, compare_points
from scenarios.collisions.immersed_pair.study import Collision
from scenarios.collisions.three_spheres.figures import MEANINGS, draw_map

SIMPLE = (float, int, bool, str)
"""Types that a command line can give."""

JSON = inspect.Parameter(
    "json",
    inspect.Parameter.KEYWORD_ONLY,
    default=False,
    annotation=Annotated[bool, Parameter(help="print the result as JSON", negative="")],
)


def command(
    function: Callable[..., Any],
    schema: str | Callable[[Any], str],
    *,
    units: Mapping[str, str] | None = None,
    options: Mapping[str, tuple[Any, Any, str]] | None = None,
    call: Callable[..., Any] | None = None,
    show_result: Callable[[Any], None] | None = None,
) -> Callable[..., None]:
    """Make a command that calls a function and prints the summary of its result.

    Arguments of the function that a command line can give become options, with their defaults; the help of each is its
    line in the docstring. Other arguments keep their defaults.

    function     returns a result that has a method `summary`
    units        of the printed values, by name
    options      further options, or replacements: name -> (type, default, help)
    call         takes all options and returns the result; the function itself if not given
    show_result  prints the result as text; prints the summary if not given
    schema       name of that of the summary in :data:`cfddem.cli.json_output.SCHEMAS`, or a function of the result
    """
    lines = descriptions(function)
    parameters: dict[str, inspect.Parameter] = {}
    for name, parameter in inspect.signature(function, eval_str=True).parameters.items():
        kind = _simple(parameter.annotation)
        if kind is not None and parameter.default is not inspect.Parameter.empty:
            parameters[name] = _option(name, kind, parameter.default, lines.get(name, ""))
    for name, (kind, default, text) in (options or {}).items():
        parameters[name] = _option(name, kind, default, text)

    defaults = {name: option.default for name, option in parameters.items()}

    def run(**arguments: Any) -> None:
        as_json = arguments.pop("json", False)
        if not as_json:
            announce_compilation()
        result = (call or function)(**defaults | arguments)
        if as_json:
            print_json(schema if isinstance(schema, str) else schema(result), result.summary())
        elif show_result is None:
            show(result.summary(), dict(units or {}))
        else:
            show_result(result)

    run.__signature__ = inspect.Signature([*parameters.values(), JSON])  # type: ignore[attr-defined]
    return run


def show(values: Mapping[str, Any], units: Mapping[str, str]) -> None:
    """Print a result as aligned lines."""
    shown = {name: "" if value is None else units.get(name, "") for name, value in values.items()}
    print("\n".join(table([(name, f"{_readable(values[name])} {unit}") for name, unit in shown.items()], gap=2)))


def _readable(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return ", ".join(_readable(element) for element in value) or "-"
    return str(value)


def _simple(annotation: Any) -> Any:
    """The part of an annotation that a command line can give; None where there is none."""
    parts = get_args(annotation) if get_origin(annotation) in (UnionType, Union) else (annotation,)
    words = [str if get_origin(part) is Literal else part for part in parts]  # refused by name, as other values are
    kept = [part for part in words if part in SIMPLE]
    if not kept:
        return None
    return kept[0] | None if type(None) in parts else kept[0]


def _option(name: str, kind: Any, default: Any, text: str) -> inspect.Parameter:
    option = Annotated[kind, Parameter(help=text, negative="")]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=option)


# ---------------------------------------------------------------- collisions over a range of Stokes numbers


UNITS = {
    "velocity": "m/s",
    "viscosity": "Pa s",
    "rebound_angle_striker": "deg",
    "rebound_angle_relative": "deg",
    "minimum_gap": "m",
    "stop_gap": "m",
    "spin": "rad/s",
}
"""Units of the values of a collision; the others have none."""

IN_A_RANGE = 20
"""Stokes numbers of `LOW..HIGH`, in even ratios."""

NUMBERS = {
    "stokes", "restitution", "restitution_tangential", "friction_used", *UNITS,
}  # fmt: skip
"""Values of a collision that are numbers."""

MOST = 1000
"""Largest number of collisions of one command."""


@dataclass(frozen=True)
class CollisionRange:
    """Collisions that differ in their Stokes number."""

    collisions: Sequence[Collision]

    def summary(self) -> dict[str, Any]:
        """Plain values of all collisions."""
        return {"collisions": [collision.summary() for collision in self.collisions]}


def stokes_numbers(text: str) -> list[float]:
    """Stokes numbers of a text: one, several with commas, or a range in even ratios.

    errors  InputError

    >>> stokes_numbers("30"), stokes_numbers("1,10"), [round(each, 2) for each in stokes_numbers("1..100")[:3]]
    ([30.0], [1.0, 10.0], [1.0, 1.27, 1.62])
    """
    limit = "a number, numbers with commas, or LOW..HIGH above 0, such as 1..1000"
    span = re.fullmatch(r"(.+?)\.\.(.+)", text)
    try:
        numbers = [float(number) for number in (span.groups() if span else text.split(","))]
    except ValueError:
        raise InputError("stokes", text, limit) from None
    if span:
        low, high = numbers
        if not 0.0 < low < high < np.inf:
            raise InputError("stokes", text, limit, "the smaller one first")
        return [float(number) for number in np.geomspace(low, high, IN_A_RANGE)]
    if len(numbers) > MOST:
        raise InputError("stokes", len(numbers), f"at most {MOST} numbers")
    return numbers


def write_csv(collisions: Sequence[Collision], path: Path) -> None:
    """Write one row for each collision; values that are not known are empty."""
    rows = [collision.summary() for collision in collisions]
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(f"{name} [{UNITS.get(name, '-')}]" if name in NUMBERS else name for name in rows[0])
        table.writerows([_cell(number) for number in row.values()] for row in rows)


def _cell(value: Any) -> Any:
    return "" if value is None else " ".join(map(str, value)) if isinstance(value, list) else value


def _collide(
    *,
    material: str,
    target: str | None,
    roughness: float | None,
    stokes: str | None,
    data: Path | None,
    figure: Path,
    csv: Path | None,
    laws: list[Path] | None,
    **arguments: Any,
) -> immersed_pair.Collision | CollisionRange | MeasuredCollisions:
    """Collide two spheres of named materials: once, over a range of Stokes numbers, or at each measured point."""
    import_laws(laws or ())
    materials, spin = immersed_pair.MATERIALS, arguments.pop("spin")
    own, other = arguments.pop("diameter"), arguments.pop("target_diameter")
    diameters = own, own if other is None else other
    numbers = None if stokes is None else stokes_numbers(stokes)
    for key, name in (("material", material), ("target", target)):
        if name is not None and name not in materials:
            remedy = "for another solid, call collide(Material(...), ...) in Python, as in the README"
            raise InputError(key, name, nearest(name, materials), remedy)
    pair = materials[material], materials[target or material]
    if roughness is not None:
        rough = [Material(**material_of_sphere.model_dump() | {"roughness": roughness}) for material_of_sphere in pair]
        pair = rough[0], rough[1]
    if data is not None and csv is not None:
        raise InputError("--csv", str(csv), "left out with --data", "the points of a figure are those of the data")
    require_folder(csv)

    def once(**point: float) -> immersed_pair.Collision:
        return immersed_pair.collide(pair, diameter=diameters, spin=(spin, 0.0), **arguments | point)

    if data is not None:
        return compare_points(data, once, figure)
    collisions = [once(**({} if numbers is None else {"stokes": number})) for number in numbers or [0.0]]
    if csv is not None:
        write_csv(collisions, csv)
    return collisions[0] if len(collisions) == 1 else CollisionRange(collisions)


SCHEMA_OF: dict[type, str] = {
    immersed_pair.Collision: "collide", CollisionRange: "collide-range", MeasuredCollisions: "collide-data",
}  # fmt: skip


def _show_collision(result: immersed_pair.Collision | CollisionRange | MeasuredCollisions) -> None:
    if not isinstance(result, CollisionRange):
        show(result.summary(), UNITS)
        return
    rows = [
        (
            f"{collision.stokes:.4g}",
            collision.outcome,
            f"{collision.restitution:.4f}",
            f"{collision.minimum_gap:.4g} m",
            collision.mechanism,
        )
        for collision in result.collisions
    ]
    print("\n".join(table(rows, ("stokes", "outcome", "restitution", "minimum gap", "mechanism"), gap=2)))


collide = command(
    immersed_pair.collide,
    lambda result: SCHEMA_OF[type(result)],
    options={
        "material": (str, "delrin", "steel_smooth, steel_rough, glass or delrin"),
        "target": (str | None, None, "material of the target or wall; the same if not given"),
        "diameter": (float, 12.7e-3, "of the striker [m]"),
        "target_diameter": (float | None, None, "of the target; the same if not given [m]"),
        "roughness": (float | None, None, "of both; that of the material if not given [m]"),
        "stokes": (str | None, None, "of the normal approach: a number, LOW..HIGH, or numbers with commas [-]"),
        "csv": (Path | None, None, "CSV file with one row for each collision"),
        "laws": (list[Path] | None, None, LAWS),
        "spin": (float, 0.0, "of the striker before the collision [rad/s]"),
        "data": (Path | None, None, "CSV file of measured points, restitution over stokes or rebound angle over angle"),
        "figure": (Path, Path("collide.png"), "PNG file that shows the measured points"),
    },
    call=_collide,
    show_result=_show_collision,
)


def _show_impact(result: wet_wall.Impact) -> None:
    values = result.summary()
    units = {
        "spin": "rad/s",
        "half_filling_angle": "deg",
        "contact_speed": "m/s",
        "bridge_volume": "m3",
        "rupture_length": "m",
        "duration": "s",
    }
    lost = {f"{name}_lost": energy for name, energy in values.pop("energy_lost").items()}
    show(values | lost, units | dict.fromkeys(lost, "J/kg"))


impact = command(wet_wall.impact, "wet-wall", show_result=_show_impact)


def _three_spheres(*, map: Path | None, **arguments: Any) -> three_spheres.Triplet:
    """Simulate three spheres, and draw the map of outcomes if asked for."""
    require_folder(map)
    if map is not None:
        draw_map(map, arguments)
    return three_spheres.simulate_three_spheres(**arguments)


def _show_triplet(result: three_spheres.Triplet) -> None:
    values = result.summary()
    events, contacts = values.pop("events"), values.pop("contacts")
    values["outcome"] = MEANINGS[values["outcome"]]
    show(values | {f"contacts{pair}": count for pair, count in contacts.items()}, {})
    print("\nt: time over (film / impact speed); t*: time over (diameter / impact speed)")
    print("speeds: over the impact speed")
    for event in events:
        print("t = {time:<9.4f} t* = {time_star:<8.4f} {pair} {kind:<8} at {speed:.4f}".format(**event))


simulate_three_spheres = command(
    three_spheres.simulate_three_spheres,
    "three-spheres",
    options={"map": (Path | None, None, "PNG file for a map of the outcomes at all St and angles, by the equations")},
    call=_three_spheres,
    show_result=_show_triplet,
)

collide_wet = command(
    wet_pair.collide_wet,
    "wet-pair",
    units={"spin": "rad/s", "separation_time": "s", "minimum_gap": "m", "velocity": "m/s", "turned": "deg"},
)


def _strike_film(*, figure: Path | None, movie: Path | None, **arguments: Any) -> film_impact.FilmImpact:
    """Let the bead fall, and draw the impact if asked for."""
    require_folder(figure)
    require_folder(movie)
    result = film_impact.impact(**arguments) if movie is None else write_movie(movie, **arguments)
    if figure is not None:
        draw_moments(figure, result, arguments["diameter"])
    return result


def _show_film_impact(result: film_impact.FilmImpact) -> None:
    values = result.summary()
    units = dict.fromkeys(("minimum_gap", "wetted_radius"), "m") | dict.fromkeys(("turned_speed", "fastest"), "m/s")
    units |= dict.fromkeys(("lowest_pressure", "highest_pressure"), "Pa") | {"mass_carried": "kg", "seconds": "s"}
    for name in ("p1", "p2", "p3", "p4"):
        time, velocity = values.pop(name).values()
        values |= {f"{name}_time": time, f"{name}_velocity": velocity}
        units |= {f"{name}_time": "s", f"{name}_velocity": "m/s"}
    values |= {f"{name}_energy": share for name, share in values.pop("energies").items()}
    show(values, units)


strike_film = command(
    film_impact.impact,
    "film-impact",
    options={
        "figure": (Path | None, None, "PNG file of the bead in the film at P1 to P4"),
        "movie": (Path | None, None, "GIF file of the impact"),
    },
    call=_strike_film,
    show_result=_show_film_impact,
)
