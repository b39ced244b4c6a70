"""A bed is fluidised and let down again: where the pressure drop reaches the weight, on the way up and on the way down.

Minimum fluidisation is where the pressure drop of the packed bed, continued, meets the weight of the bed. It is
compared with the balance of weight and drag by the drag law itself at the voidage that the bed really has.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cfddem.case import Case
from cfddem.errors import InputError
from cfddem.report import buoyant_weight
from closures.balance import fluidising_velocity

PACKED = (0.2, 0.8)
"""Pressure drop over weight between which the bed is taken for packed."""


@dataclass(frozen=True)
class Onset:
    """Minimum fluidisation on one branch of the ramp."""

    velocity: float  # superficial, where the packed bed's pressure drop meets the weight [m/s]
    voidage: float  # of the packed bed
    balance: float  # velocity by the drag law at that voidage [m/s]


def onsets(case: Case, history: Mapping[str, np.ndarray]) -> tuple[Onset, Onset]:
    """Minimum fluidisation on the way up and on the way down.

    case     whose inlet velocity is a list of [time, velocity] that rises and falls
    history  of its run
    """
    inlet = case.bed.inlet_velocity
    if isinstance(inlet, float):
        raise InputError("bed.inlet_velocity", inlet, "a list of [time, velocity] that rises and falls")
    times, speeds = np.array(inlet).T
    velocity = np.interp(history["time"], times, speeds)
    share = history["pressure_drop"] * case.column.floor_area / buoyant_weight(case)
    rising = history["time"] < times[int(np.argmax(speeds))]
    return tuple(_onset(case, velocity[b], share[b], history["bed_voidage"][b]) for b in (rising, ~rising))  # type: ignore[return-value]


def _onset(case: Case, velocity: np.ndarray, share: np.ndarray, voidage: np.ndarray) -> Onset:
    packed = (share > PACKED[0]) & (share < PACKED[1])
    if packed.sum() < 4:
        raise InputError("history", int(packed.sum()), "at least 4 rows with a packed bed", "record more often")
    powers = np.stack([velocity[packed], velocity[packed] ** 2], axis=1)
    (viscous, inertial), *_ = np.linalg.lstsq(powers, share[packed], rcond=None)
    found = 2.0 / (viscous + np.sqrt(viscous**2 + 4.0 * inertial))
    own = float(voidage[packed].mean())
    assert case.fluid is not None and case.laws.drag_law is not None
    balance = fluidising_velocity(
        case.bed.diameter, case.solid.density, case.fluid.density, case.fluid.viscosity, own,
        case.laws.drag_law.function, abs(case.laws.gravity[2]),
    )  # fmt: skip
    return Onset(float(found), own, balance)
