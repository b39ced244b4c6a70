"""A wet bed that liquid bridges hold still fluidises again when it has dried; with solid bonds it stays still."""

from __future__ import annotations

import pytest

from scenarios.validation.heat.drying import stuck


@pytest.mark.slow
def test_a_dried_bed_fluidises_again_and_with_bonds_it_does_not() -> None:
    """2.5 times minimum fluidisation: still while wet; in motion once dry, and one piece that does not with bonds."""
    rows = stuck({})
    assert len(rows) == 11 and not [each for each in rows if each.verdict == "FAILS"], rows
    assert rows[-1].value > 2.0  # bonds per seed
