"""Estimates of the bed from correlations: velocities, expansion, pressure drop."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from cfddem.case.bed import POURED_SOLID_FRACTION, Jet
from cfddem.case.schema import Case
from cfddem.case.vessel import Vessel, floor_places, vessel_of
from cfddem.case.wall_geometry import Array
from cfddem.preflight.mixture import bed_drag
from closures import balance, drag_single, numbers

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
        return _estimate(case, case.column.floor_area, None)
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
    gravity, fluid = math.hypot(*case.laws.gravity), case.fluid
    if fluid is None:
        weight = solids * density * gravity / floor
        return BedEstimate(count, solids, weight, nan, 0.0, nan, nan, nan, nan, packed, poured, nan, nan, poured, 0.0)
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
            each.diameter, case.material_of(each).density, fluid.density, fluid.viscosity, drag_single.brown_lawler,
            gravity,
        )
        for each in case.species.values()
    )  # fmt: skip
    onset = balance.reynolds_in_balance(number, packed, drag) * scale
    reynolds = (inlet or terminal) / scale
    voidage = packed
    if case.bed.start != "poured" and (case.bed.fixed or inlet == 0.0):
        space = floor * case.column.height if vessel is None else float(vessel.volumes[-1])
        voidage = 1.0 - solids / space
    elif case.bed.fixed:
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
        return gradient(inlet) * height if case.bed.fixed or inlet < onset else weight
    most = math.inf if case.bed.fixed else weight / height
    if not case.bed.fixed and fluid.is_liquid and inlet >= onset:
        return weight
    thickness, areas = vessel.layers(height)
    return float(sum(dz * min(gradient(inlet * floor / area), most) for dz, area in zip(thickness, areas)))


def bubbles(case: Case, bed: BedEstimate) -> bool:
    """Whether the bed bubbles: a gas bed above minimum fluidisation. Correlations for homogeneous beds then fail."""
    return not case.in_liquid and not case.bed.fixed and bed.inlet > bed.onset


def _terminal_by_law(case: Case, gravity: float) -> float:
    """Terminal velocity of the slowest species alone by the drag law of the case; NaN if it has none for voidage 1."""
    law, fluid, found = case.laws.drag_law, case.fluid, []
    if law is None or fluid is None or law.ranges.get("voidage", (0.0, 1.0))[1] < 1.0:
        return math.nan
    for each in case.species.values():
        drag = case.laws.drag_function(each.sauter_diameter / case.bed.diameter)
        assert drag is not None
        flow = each.diameter, case.material_of(each).density, fluid.density, fluid.viscosity
        with suppress(ArithmeticError, ValueError):  # a law of a user may have no value at voidage 1
            found.append(balance.terminal_velocity(*flow, drag, gravity))
    return min(found, default=math.nan)


def mean_inlet_velocity(case: Case) -> float:
    """Mean superficial velocity over the floor including the jet, highest in time [m/s]."""
    if case.column.ends != "flow":
        return 0.0
    inlet, jet = case.bed.highest_inlet_velocity, case.bed.jet
    return inlet if jet is None else inlet + share_of_jet(case, jet) * (jet.velocity - inlet)


def share_of_jet(case: Case, jet: Jet) -> float:
    """Share of the open floor through which the jet enters [-]."""
    vessel, column = vessel_of(case), case.column
    width, depth, _ = column.size
    opening = 0.25 * math.pi * jet.width**2 if jet.round else min(jet.width, width) * min(jet.depth or depth, depth)

    def covered(places: Array) -> int:
        """Number of places (2, m) that the jet covers."""
        return int(np.count_nonzero(jet.covers(places[0] - 0.5 * width, places[1] - 0.5 * depth)))

    is_open, area = (vessel.floor_places, vessel.floor) if vessel else (floor_places(column), column.floor_area)
    every = covered(floor_places(column, of_the_box=True))
    return min(1.0, opening * (covered(is_open) / every if every else 1.0) / area)
