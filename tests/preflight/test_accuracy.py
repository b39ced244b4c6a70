"""What `check` says about surfaces of beds, and about the accuracy of cells, kernel and fluid step."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest

from cfddem.case.gallery import gallery_files
from cfddem.case.schema import Case
from cfddem.coupling.kernel import FilterKernel
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver
from cfddem.preflight import accuracy
from cfddem.preflight.accuracy import BY_KERNEL, GAS, GAS_BY_KERNEL, LIQUID, PACKED_SHARP, PACKED_SMEARED, widening
from cfddem.preflight.summary import preflight
from cfddem.run import build
from scenarios.beds.gas_bed.study import mueller
from scenarios.beds.liquid_bed.study import alginate, alumina, glass

ROOT = Path(__file__).parents[2]
TABLES = ROOT / "docs" / "tables"


VESSEL = {"vessel": {"shape": "cylinder", "radius": 0.004}, "column.sides": "no_slip", "bed.start": "poured"}
THIN_WALL = {
    "wall": [{"shape": "cylinder", "point": [0.005, 0.005, 0.01], "radius": 0.003, "length": 0.01, "solid": "thin"}],
    "bed.start": "poured",
}


def shown(case: Case) -> dict[str, tuple[float, str]]:
    """Value and note of each row of the overview, by its name."""
    return {each.name: (each.value, each.note) for each in preflight(case).rows}


@pytest.mark.parametrize(
    ("case", "changes", "surface", "words"),
    [
        (glass(0.037), {}, "sharp", "sharp, the default"),
        (glass(0.024), {}, "sharp", "sharp, the default"),
        (glass(0.037), {"laws.agitation": "none"}, "sharp", "sharp, the default"),
        (alumina(0.157), {}, "sharp", "sharp, the default"),
        (alginate(0.009), {"laws.surface": "sharp"}, "sharp", "sharp"),
        (glass(0.037), {"laws.surface": "smeared"}, "smeared", "smeared"),
        (glass(0.037), {"laws.model": "B"}, "smeared", "smeared, the default in model B"),
        (glass(0.037), {"laws.kernel_width": 0.0}, "smeared", "smeared, the default without a kernel"),
        (glass(0.037), {"laws.drag": "none"}, "smeared", None),
        (glass(0.037), {"bed.count": 1}, "smeared", None),
        (glass(0.037), VESSEL, "sharp", "sharp, the default"),
        (glass(0.037), THIN_WALL, "sharp", "sharp, the default"),
        (mueller(), {}, "sharp", "sharp, the default"),
    ],
)
def test_surfaces_are_sharp_by_default(case: Case, changes: dict[str, Any], surface: str, words: str | None) -> None:
    """The same in the run; the check says why. Of one sphere and without drag it says nothing."""
    case = case.with_(**changes)
    assert case.surface == surface
    assert shown(case).get("surface of the bed", (math.nan, None))[1] == words
    assert Case.from_text(case.to_toml()).surface == surface


@pytest.mark.parametrize(("surface", "sharp"), [("auto", True), ("smeared", False)])
def test_a_run_has_the_surfaces_of_its_case(surface: str, sharp: bool) -> None:
    case = glass(0.037).with_(**{"laws.surface": surface})
    grid = Grid((4, 4, 16), (2.5e-3,) * 3)
    fluid = FluidSolver(grid, build.boundaries_of(case), density=998.0, viscosity=1e-3)
    forces = build.forces_of(case, fluid, FilterKernel(grid, (False,) * 3, smoothing=1.5e-3))
    assert any(force.sharp for force in forces) == sharp


@pytest.mark.parametrize("change", LIQUID + GAS, ids=lambda each: each.row)
def test_changes_are_those_of_the_stored_tables(change: accuracy.Change) -> None:
    """Value of a row over its reference, which is 1 for a row that is a ratio, with the error of both."""
    rows = {each["quantity"]: each for each in json.loads((TABLES / f"{change.table}.json").read_text())["rows"]}
    row = rows[change.row]
    ((own, other),) = re.findall(
        r"error (?:of the paired difference )?([\d.e-]+)(?:, of the reference ([\d.e-]+))?", row["note"]
    )
    value = row["value"] / row["reference"]
    error = value * math.hypot(float(own) / row["value"], float(other or 0.0) / row["reference"])
    inverse = "over a tenth" in change.row  # the table has the coarse step over the fine one
    assert change.value == pytest.approx(1.0 / value if inverse else value, abs=6e-4)
    assert change.error == pytest.approx(error / value**2 if inverse else error, abs=6e-4)


def test_the_check_says_what_cells_and_kernel_cost() -> None:
    """Cells of 3.3 diameters widen a smeared filter by 35 %, and sharp surfaces by nothing."""
    smeared = shown(glass(0.037).with_(**{"laws.surface": "smeared", "column.cell": 0.01 / 3.0}))
    assert smeared["filter width / kernel"][0] == pytest.approx(math.sqrt(1.0 + (10.0 / 3.0) ** 2 / 6.0 / 1.5**2))
    assert shown(glass(0.037))["filter width / kernel"][0] == 1.0
    assert widening(3.0, "smeared") == pytest.approx(math.sqrt(3.0)) and widening(10.0, "sharp") > 1.4
    found = shown(glass(0.037).with_(**{"laws.kernel_width": 2.0}))
    assert found["this kernel: granular temperature"] == (0.90, "over 1.5 d, glass beads, with smeared surfaces")


def test_what_was_measured_with_other_surfaces_says_so() -> None:
    """On the whole line: nothing of it is cut off."""
    name, bed = "cells finer by 1.5: bed height", "+- 0.0026, alginate bed"
    assert shown(glass(0.037))[name][1] == bed
    assert shown(glass(0.037).with_(**{"laws.surface": "smeared"}))[name][1] == f"{bed}, with sharp surfaces"
    case = glass(0.037).with_(**{"laws.kernel_width": 2.0})
    noted = [each for each in preflight(case).rows if each.note.endswith("smeared surfaces")]
    assert len(noted) == sum(figure.surface == "smeared" for figure in LIQUID) + 1
    assert all(" ".join(each.lines()).endswith("with smeared surfaces") for each in noted)


def numbers_of(page: str, begin: str, end: str) -> list[float]:
    """Numbers of a page between two texts."""
    text = " ".join((ROOT / page).read_text().split())
    return [float(each) for each in re.findall(r"\d+(?:\.\d+)?", text.split(begin)[1].split(end)[0])]


def test_numbers_without_a_table_are_those_of_the_pages() -> None:
    """Packed beds in the limits, widths of the kernel on the page of the agitation."""
    values = numbers_of("docs/limits.md", "Fixed poured beds of", "of the pressure drop of their law")
    assert tuple(zip(values[:4], values[4:])) == PACKED_SMEARED
    values = numbers_of("docs/limits.md", "a fixed cubic lattice of six layers has", "Random packings")
    assert {value for _, value in PACKED_SHARP} <= set(values)
    text = (ROOT / "scenarios" / "validation" / "agitation" / "README.md").read_text()
    rows = re.findall(r"(?m)^\| (?:filter of )?(\d\.\d) d[^|]*\| [\d.]+ \| ([\d.]+) \| [\d.]+ \|$", text)
    assert tuple((float(width), float(ratio)) for width, ratio in rows) == BY_KERNEL


def test_what_the_kernel_changes_in_gas_is_of_the_stored_table() -> None:
    """The mean height of the small gas bed, and the row of a case with another kernel."""
    rows = {row["quantity"]: row for row in json.loads((TABLES / "gas-bed-steps.json").read_text())["rows"]}
    for width, ratio in GAS_BY_KERNEL:
        if width != 1.5:
            row = rows[f"0.5 ms, 2.40 d, kernel of {width:g} d, 2.9 s: mean height"]
            assert round(row["value"] / row["reference"], 3) == ratio
    assert shown(mueller().with_(**{"laws.kernel_width": 2.0}))["this kernel: bed height"][0] == 0.944


def test_packed_beds_have_what_was_measured_in_fixed_ones() -> None:
    """Smeared surfaces by the height of the bed in cells, sharp ones by the cell in diameters."""
    case = glass(0.03).with_(**{"bed.fixed": True, "bed.start": "poured", "bed.count": 620})
    value, note = shown(case.with_(**{"laws.surface": "smeared"}))["packed bed: pressure drop / law"]
    assert 0.69 < value < 0.89 and "fixed beds" in note
    assert shown(case)["packed bed: pressure drop / law"][0] == 0.979


HOPPER = Case.from_toml(gallery_files()["hopper-with-air"])


@pytest.mark.parametrize(
    "case",
    [
        HOPPER,
        HOPPER.with_(**{"patch.orifice.particles": "stay"}),
        glass(0.037).with_(**{"bed.inlet_velocity": 0.0}),
        glass(0.037).with_(outlet=[{"corner": [0.0, 0.0, 0.0], "size": [0.01, 0.01, 0.002]}]),
        glass(0.008).with_(**{"patch.side": {"kind": "inlet", "side": "x_low", "velocity": 1e-3}}),
    ],
    ids=["particles leave", "no flow in a gas", "no flow in a liquid", "outlet", "inlet in a side"],
)
def test_nothing_is_said_of_beds_that_were_not_measured(case: Case) -> None:
    rows = [each.name for each in preflight(case).rows if each.group.startswith("accuracy")]
    assert rows == ["filter width / kernel"]
