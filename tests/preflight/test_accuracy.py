"""What `check` says about surfaces of beds, and about the accuracy of cells, kernel and fluid step."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest

from cfddem.case.schema import Case
from cfddem.coupling.kernel import FilterKernel
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver
from cfddem.preflight import accuracy
from cfddem.preflight.accuracy import BY_KERNEL, GAS, LIQUID, between, widening
from cfddem.preflight.summary import preflight
from cfddem.run import build
from scenarios.beds.gas_bed.study import mueller
from scenarios.beds.liquid_bed.study import alginate, alumina, glass

TABLES = Path(__file__).parents[2] / "docs" / "tables"


def shown(case: Case) -> dict[str, tuple[float, str]]:
    """Value and note of each row of the overview, by its name."""
    return {each.name: (each.value, each.note) for each in preflight(case).rows}


@pytest.mark.parametrize(
    ("case", "changes", "surface", "words"),
    [
        (glass(0.037), {}, "sharp", "sharp, the default where agitation acts"),
        (glass(0.024), {}, "smeared", "smeared, the default without agitation"),
        (glass(0.037), {"laws.agitation": "none"}, "smeared", "smeared, the default without agitation"),
        (glass(0.037), {"laws.model": "B"}, "smeared", "smeared, the default in model B"),
        (glass(0.037), {"laws.surface": "smeared"}, "smeared", "smeared"),
        (alumina(0.157), {}, "smeared", "smeared, the default without agitation"),
        (alumina(0.157), {"laws.agitation": "free_spheres"}, "sharp", "sharp, the default where agitation acts"),
        (alginate(0.009), {"laws.surface": "sharp"}, "sharp", "sharp"),
        (mueller(), {}, "smeared", None),
    ],
)
def test_surfaces_are_sharp_by_default_where_agitation_acts(
    case: Case, changes: dict[str, Any], surface: str, words: str | None
) -> None:
    """The same in the run; the check says why. In a gas, where no agitation acts, it says nothing."""
    case = case.with_(**changes)
    assert case.surface == surface
    assert shown(case).get("surface of the bed", (math.nan, None))[1] == words
    assert Case.from_text(case.to_toml()).surface == surface


@pytest.mark.parametrize("agitation", ["auto", "none"])
def test_a_run_has_the_surfaces_of_its_case(agitation: str) -> None:
    case = glass(0.037).with_(**{"laws.agitation": agitation})
    grid = Grid((4, 4, 16), (2.5e-3,) * 3)
    fluid = FluidSolver(grid, build.boundaries_of(case), density=998.0, viscosity=1e-3)
    forces = build.forces_of(case, fluid, FilterKernel(grid, (False,) * 3, smoothing=1.5e-3))
    assert any(force.sharp for force in forces) == (agitation == "auto")


@pytest.mark.parametrize("change", [*LIQUID, *GAS], ids=lambda each: each.row)
def test_changes_are_those_of_the_stored_tables(change: accuracy.Change) -> None:
    rows = {each["quantity"]: each for each in json.loads((TABLES / f"{change.table}.json").read_text())["rows"]}
    value = rows[change.row]["value"]
    error = float(re.findall(r"standard error (?:of the paired difference )?(\S+)", rows[change.row]["note"])[0])
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
    assert found["this kernel: granular temperature"][0] == between(BY_KERNEL, 2.0) == 0.90


def test_packed_beds_have_what_was_measured_in_fixed_ones() -> None:
    """Smeared surfaces by the height of the bed in cells, sharp ones by the cell in diameters."""
    case = glass(0.03).with_(**{"bed.fixed": True, "bed.start": "poured", "bed.count": 620})
    value, note = shown(case.with_(**{"laws.surface": "smeared"}))["packed bed: pressure drop / law"]
    assert 0.69 < value < 0.89 and "fixed beds" in note
    assert shown(case)["packed bed: pressure drop / law"][0] == 0.976
