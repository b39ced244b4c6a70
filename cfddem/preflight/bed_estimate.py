"""Estimates of the bed from correlations: velocities, expansion, pressure drop, drag on mixtures."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from functools import wraps

import numpy as np

from cfddem.case.bed import POURED_SOLID_FRACTION, Jet
from cfddem.case.materials import NO_FLUID
from cfddem.case.patches import open_area_of
from cfddem.case.schema import Case
from cfddem.case.vessel import Vessel, floor_places, vessel_of
from cfddem.model.triangles import Array
from closures import balance, drag_single, numbers
from closures.balance import Drag
from closures.drag import ergun

EXPANSIONS = 20
"""Most repetitions until velocity and height of a bed in a vessel fit each other."""


@dataclass(frozen=True)
class BedEstimate:
    """The bed in its flow, from correlations; NaN where none applies."""

    count: int
    solid_volume: float  # total particle volume [m3]
    weight: float  # buoyant weight over the floor area, or over the mean cross-section of the bed in a vessel [Pa]
    archimedes: float
    inlet: float  # mean superficial velocity over that area, highest in time [m/s]
    reynolds: float  # with the superficial velocity; without inflow, with the terminal velocity
    onset: float  # minimum fluidisation velocity u_mf by the drag law, at the voidage of a poured bed [m/s]
    terminal: float  # terminal velocity u_t of a single particle of the slowest species [m/s]
    terminal_by_law: float  # the same by the drag law of the case; NaN where the law is not for single particles [m/s]
    voidage: float  # in the flow
    height: float  # in the flow [m]
    pressure_drop: float  # [Pa]
    drag_factor: float  # F at this voidage
    poured_height: float  # of the bed at rest [m]
    inflow: float  # volume of fluid that enters per time [m3/s]


def estimate_bed(case: Case) -> BedEstimate:
    """Estimate the bed of a case.

    The bed is packed below minimum fluidisation. Above it, a liquid bed expands to the voidage at which drag
    balances the buoyant weight; for a gas bed, which bubbles, the voidage of the poured bed is returned. In a vessel
    that walls form, velocity and weight are over the mean cross-section of the bed.
    """
    vessel, solids = vessel_of(case), sum(case.volumes.values())
    if vessel is None:
        return _estimate(case, case.floor_area, None)
    height = vessel.height_of(solids / POURED_SOLID_FRACTION)
    for _ in range(EXPANSIONS):
        bed = _estimate(case, vessel.below(height) / height, vessel)
        if abs(bed.height - height) <= 1e-3 * height:
            break
        height = bed.height
    return bed


def _estimate(case: Case, floor: float, vessel: Vessel | None) -> BedEstimate:
    """The bed over a cross-section [m2], that of the column or the mean one of a bed in a vessel."""
    diameter = case.bed.diameter
    count, solids, density = case.particle_count, sum(case.volumes.values()), case.solid_density
    packed, nan = 1.0 - POURED_SOLID_FRACTION, math.nan
    poured = _height(solids, POURED_SOLID_FRACTION, floor, vessel)
    gravity, fluid = math.hypot(*case.laws.gravity), case.around
    weight = solids * abs(density - fluid.density) * gravity / floor
    opening = floor if vessel is None else vessel.floor
    inflow = mean_inlet_velocity(case) * opening
    inlet = inflow / floor
    if fluid.viscosity == 0.0:
        return BedEstimate(
            count, solids, weight, nan, inlet, nan, nan, nan, nan, packed, poured, nan, nan, poured, inflow
        )
    number = abs(numbers.archimedes(diameter, density, fluid.density, fluid.viscosity, gravity))
    scale = fluid.viscosity / (fluid.density * diameter)
    drag = bed_drag(case)
    terminal = min(
        balance.terminal_velocity(
            species.diameter, case.material_of(species).density, fluid.density, fluid.viscosity,
            drag_single.brown_lawler, gravity,
        )
        for species in case.species.values()
    )  # fmt: skip
    onset = balance.reynolds_in_balance(number, packed, drag) * scale
    reynolds = (inlet or terminal) / scale
    voidage = packed
    if case.bed.start != "poured" and (case.stands_still or inlet == 0.0):
        space = floor * case.column.height if vessel is None else float(vessel.volumes[-1])
        voidage = 1.0 - solids / space
    elif case.stands_still:
        voidage = packed
    elif inlet > 0.0 and number > 0.0 and fluid.is_liquid:
        voidage = balance.voidage_in_balance(number, inlet / scale, drag, packed)
    height = case.column.height if voidage >= 1.0 else _height(solids, 1.0 - voidage, floor, vessel)
    fits = 0.0 < voidage <= 1.0  # the voidage is negative where the particles do not fit
    drop = _pressure_drop(case, inlet, onset, weight, voidage, height, floor, vessel) if fits else weight
    factor = drag(reynolds, voidage) if fits else nan
    return BedEstimate(
        count, solids, weight, number, inlet, reynolds, onset, terminal, _terminal_by_law(case, gravity),
        voidage, height, drop, factor, poured, inflow,
    )  # fmt: skip


def _height(solids: float, fraction: float, floor: float, vessel: Vessel | None) -> float:
    """Height of a bed of a solid fraction [m]."""
    return solids / (floor * fraction) if vessel is None else vessel.height_of(solids / fraction)


def _pressure_drop(
    case: Case, inlet: float, onset: float, weight: float, voidage: float, height: float, floor: float,
    vessel: Vessel | None,
) -> float:  # fmt: skip
    """Pressure drop of the bed [Pa]: the weight of a bed that the flow carries, the drag law of one that is packed.

    In a vessel, each level that is wider than the floor has less drag, and carries no more than its weight.
    """
    fluid, drag = case.required_fluid, bed_drag(case)

    def gradient(velocity: float) -> float:
        flow = case.bed.diameter, fluid.density, fluid.viscosity, min(voidage, 0.999)
        return balance.pressure_gradient(velocity, *flow, drag) if velocity > 0.0 else 0.0

    if vessel is None:
        return gradient(inlet) * height if case.stands_still or inlet < onset else weight
    most = math.inf if case.stands_still else weight / height
    if not case.stands_still and fluid.is_liquid and inlet >= onset:
        return weight
    thickness, areas = vessel.layers(height)
    return float(sum(dz * min(gradient(inlet * floor / area), most) for dz, area in zip(thickness, areas)))


def bubbles(case: Case, bed: BedEstimate) -> bool:
    """Whether the bed bubbles: a gas bed above minimum fluidisation. Correlations for homogeneous beds then fail."""
    return not case.in_liquid and not case.stands_still and bed.inlet > bed.onset


def _terminal_by_law(case: Case, gravity: float) -> float:
    """Terminal velocity of the slowest species alone by the drag law of the case; NaN if it has none for voidage 1."""
    law, fluid, velocities = case.laws.drag_law, case.around, []
    if law is None or law.ranges.get("voidage", (0.0, 1.0))[1] < 1.0:
        return math.nan
    for species in case.species.values():
        drag = case.laws.drag_function(species.sauter_diameter / case.bed.diameter)
        assert drag is not None
        flow = species.diameter, case.material_of(species).density, fluid.density, fluid.viscosity
        with suppress(ArithmeticError, ValueError):  # a law of a user may have no value at voidage 1
            velocities.append(balance.terminal_velocity(*flow, drag, gravity))
    return min(velocities, default=math.nan)


def mean_inlet_velocity(case: Case) -> float:
    """Mean superficial velocity over the floor including jet and inlets, highest in time [m/s]."""
    if (case.column.ends != "flow" and not case.patch) or case.around is NO_FLUID:
        return 0.0
    on_floor = [patch for patch in case.patches.values() if patch.side == "floor"]
    closed = case.column.ends != "flow" or any(not patch.brings and patch.shape == "whole" for patch in on_floor)
    inlet = 0.0 if closed else case.bed.highest_inlet_velocity
    of_floor = [patch for patch in on_floor if patch.brings]
    if of_floor:
        shares = [open_area_of(case, patch) / max(case.floor_area, 1e-300) for patch in of_floor]
        entering = sum(patch.highest * share for patch, share in zip(of_floor, shares))
        return entering + max(0.0, 1.0 - sum(shares)) * inlet
    return inlet + sum(share_of_jet(case, jet) * (jet.velocity - inlet) for jet in case.bed.jets)


def share_of_jet(case: Case, jet: Jet) -> float:
    """Share of the open floor through which the jet enters [-]."""
    vessel = vessel_of(case)
    width, depth, _ = case.column.size
    opening = 0.25 * math.pi * jet.width**2 if jet.round else min(jet.width, width) * min(jet.depth or depth, depth)

    def covered(places: Array) -> int:
        """Number of places (2, m) that the jet covers."""
        return int(np.count_nonzero(jet.covers(places[0] - 0.5 * width, places[1] - 0.5 * depth)))

    is_open, area = (vessel.floor_places, vessel.floor) if vessel else (floor_places(case), case.floor_area)
    every = covered(floor_places(case, within=False))
    return min(1.0, opening * (covered(is_open) / every if every else 1.0) / area)


# ---------------------------------------------------------------- drag on mixtures


def bed_drag(case: Case) -> Drag:
    """Drag law for estimates of the bed.

    The drag law of the case; for a mixture, its mean over the species (:func:`mean_drag`). Ergun's law replaces
    it where the case has no drag, or a law for single spheres that ignores voidage.
    """
    law = case.laws.drag_function()
    if law is None or law(1.0, 0.42) == law(1.0, 1.0):
        return ergun
    if not case.bed.species:
        return law
    return mean_drag(case)


def mean_drag(case: Case) -> Drag:
    r"""Drag factor of equal spheres of the Sauter mean diameter with the same total drag as the mixture.

    .. math:: F = \sum_i x_i\,F_i / y_i^2,\qquad Re_i = y_i Re

    x is the volume share of a species and y its diameter over the Sauter mean.
    """
    total, parts = sum(case.volumes.values()), []
    for name, species in case.species.items():
        ratio = species.sauter_diameter / case.bed.diameter
        law = case.laws.drag_function(ratio)
        assert law is not None
        parts.append((case.volumes[name] / total, ratio, law))

    @wraps(parts[0][2])
    def mean(reynolds: float, voidage: float) -> float:
        return sum(share / ratio**2 * law(ratio * reynolds, voidage) for share, ratio, law in parts)

    return mean


def net_downward_forces(case: Case, inlet: float, voidage: float) -> dict[str, float]:
    """Net downward force on each species in the homogeneous mixture, over its own buoyant weight [-].

    The weight of a sphere is carried by its own drag and by the pressure gradient, which carries the weight of
    the mixture.

    inlet    superficial velocity [m/s]
    voidage  at which the flow carries the mixture [-]
    returns  by name: above 0 the species sinks, below 0 it rises; empty without drag
    """
    fluid, gravity = case.around, math.hypot(*case.laws.gravity)
    forces: dict[str, float] = {}
    if fluid.viscosity == 0.0 or gravity == 0.0:
        return forces
    bulk = (1.0 - voidage) * (case.solid_density - fluid.density)
    for name, species in case.species.items():
        diameter = species.sauter_diameter
        law = case.laws.drag_function(diameter / case.bed.diameter)
        excess = case.material_of(species).density - fluid.density
        if law is not None and excess != 0.0:
            reynolds = fluid.density * inlet * diameter / fluid.viscosity
            drag = 18.0 * fluid.viscosity * inlet * law(reynolds, voidage) / (diameter**2 * gravity)
            forces[name] = (excess - bulk - drag) / abs(excess)
    return forces
