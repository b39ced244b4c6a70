"""A bed is fluidised and defluidised: minimum fluidisation on the way up and on the way down.

Minimum fluidisation is where the extrapolated pressure drop of the packed bed equals the weight of the bed. It is
compared with the balance of weight and drag by the drag law, at the voidage that the height of the bed gives. A voidage
that is wrong by 0.01 changes this velocity by a tenth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from cfddem.analysis.bed_laws import buoyant_weight
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from closures.balance import fluidising_velocity

PACKED = (0.2, 0.8)
"""Range of pressure drop over weight in which the bed counts as packed."""


@dataclass(frozen=True)
class Onset:
    """Minimum fluidisation on one branch of the ramp."""

    velocity: float  # superficial, where the pressure drop of the packed bed equals the weight [m/s]
    voidage: float  # of the packed bed, from its height
    balance: float  # velocity by the drag law at this voidage [m/s]


def onsets(case: Case, history: Mapping[str, np.ndarray]) -> tuple[Onset, Onset]:
    """Minimum fluidisation on the way up and on the way down; arguments as of `onset`."""
    return onset(case, history, rising=True), onset(case, history, rising=False)


def onset(case: Case, history: Mapping[str, np.ndarray], *, rising: bool) -> Onset:
    """Minimum fluidisation on one branch of a ramp.

    case     whose inlet velocity is a list of [time, velocity] that rises and falls
    history  of its run
    rising   the way up, else the way down
    """
    inlet = case.bed.inlet_velocity
    if isinstance(inlet, float):
        raise InputError("bed.inlet_velocity", inlet, "a list of [time, velocity] that rises and falls")
    times, speeds = np.array(inlet).T
    share = history["pressure_drop"] * case.column.floor_area / buoyant_weight(case)
    packed = _packed(share, (history["time"] < times[int(np.argmax(speeds))]) == rising, rising)
    if packed.sum() < 4:
        raise InputError("history", int(packed.sum()), "at least 4 rows with a packed bed", "record more often")
    velocity = np.interp(history["time"], times, speeds)
    return _onset(case, velocity[packed], share[packed], float(history["bed_voidage"][packed].mean()))


def _packed(share: np.ndarray, branch: np.ndarray, rising: bool) -> np.ndarray:
    """Rows of one branch before the bed is fluidised for the first time, or after it was for the last time.

    Bubbles make the pressure drop of a fluidised bed fall below the weight for a moment; a single row says nothing.
    """
    places, steady = np.arange(len(share)), median_filter(share, 5, mode="nearest")
    fluidised = places[branch & (steady >= PACKED[1])]
    still = places < fluidised.min(initial=len(share)) if rising else places > fluidised.max(initial=-1)
    return np.asarray(branch & still & (steady > PACKED[0]))


def _onset(case: Case, velocity: np.ndarray, share: np.ndarray, voidage: float) -> Onset:
    powers = np.stack([velocity, velocity**2], axis=1)
    (viscous, inertial), *_ = np.linalg.lstsq(powers, share, rcond=None)
    onset_velocity = 2.0 / (viscous + np.sqrt(viscous**2 + 4.0 * inertial))
    assert case.laws.drag_law is not None
    balance = fluidising_velocity(
        case.bed.diameter, case.solid.density, case.required_fluid.density, case.required_fluid.viscosity, voidage,
        case.laws.drag_law.function, abs(case.laws.gravity[2]),
    )  # fmt: skip
    return Onset(float(onset_velocity), voidage, balance)
