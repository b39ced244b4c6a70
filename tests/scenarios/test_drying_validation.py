"""The rows of `cfddem validate drying` from made-up runs: which limits hold, and which fail."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from scenarios.validation.heat import drying
from scenarios.validation.table import Row

TIME = np.linspace(0.02, 0.5, 25)


def made_up(bonded_motion: float) -> object:
    """A bed that is wet up to 0.3 s and then moves, or, with bonds, as much as is said [m2/s2]."""

    def history(case: object) -> dict[str, np.ndarray]:
        wet, bonds = TIME < 0.3, case.liquid.bond is not None  # type: ignore[attr-defined]
        return {
            "time": TIME,
            "granular_temperature": np.where(wet, 1e-9, bonded_motion if bonds else 1e-3),
            "liquid_in_bridges": np.where(wet, 1e-10 * (0.3 - TIME), 0.0),
            "largest_agglomerate": np.where(wet | bonds, 1500.0, 3.0),
            "liquid_imbalance": np.full(25, 1e-15),
            "bond_count": np.where(wet, 0.0, 4500.0 * bonds),
        }

    return history


@pytest.mark.parametrize("motion", [1e-6, 1e-3])
def test_a_bed_with_bonds_fails_where_it_moves_and_a_late_end_fails(
    motion: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    time = np.linspace(0.1, 1.8, 18)
    run = drying.drying_bed.Drying(
        time, np.minimum(time / 1.7, 1.0), np.full(18, 311.0), *np.full((3, 18), 4e-6), imbalance=1e-12
    )
    monkeypatch.setattr(drying, "history", made_up(motion))
    monkeypatch.setattr(
        drying.drying_bed, "drying", lambda case: (run, SimpleNamespace(rate=4e-6, temperature=311.1, end=1.44))
    )
    rows: list[Row] = drying.study(tmp_path, print)
    failed = [each.quantity for each in rows if each.verdict == "FAILS"]
    late = "drying bed: end of drying over that of the balance"
    with_bonds = "bed when dry: granular temperature with bonds over that without"
    assert failed == ([late] if motion < 1e-4 else [with_bonds, late])
    assert len(rows) == 16 and (tmp_path / "drying.png").exists() and (tmp_path / "histories.h5").exists()
