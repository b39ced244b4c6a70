"""A wet bed that is one agglomerate fluidises again when it has dried; with solid bonds it stays one piece."""

from __future__ import annotations

import pytest

from scenarios.validation.heat.drying import stuck


@pytest.mark.slow
def test_a_dried_bed_fluidises_again_and_with_bonds_it_does_not() -> None:
    """At 2.5 times minimum fluidisation; one piece that rises as a whole counts as motion in three rows."""
    rows = stuck({})
    lifted = {f"bed while wet, {name} bonds: granular temperature" for name in ("without", "with")}
    lifted.add("bed when dry: granular temperature with bonds over that without")
    assert len(rows) == 11 and {each.quantity for each in rows if each.verdict == "FAILS"} == lifted, rows
    assert rows[-1].value > 2.0  # bonds per seed
