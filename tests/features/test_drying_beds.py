"""A wet bed that is one agglomerate fluidises again when it has dried; with solid bonds it stays one piece."""

from __future__ import annotations

import pytest

from scenarios.validation.heat.drying import stuck


@pytest.mark.slow
def test_a_dried_bed_fluidises_again_and_with_bonds_it_does_not() -> None:
    """2.5 times minimum fluidisation; while it is wet it rises as a whole, which two rows count as motion."""
    rows = stuck({})
    lifted = {f"bed while wet, {name} bonds: granular temperature" for name in ("without", "with")}
    assert len(rows) == 11 and {each.quantity for each in rows if each.verdict == "FAILS"} == lifted, rows
    assert rows[-1].value > 2.0  # bonds per seed
