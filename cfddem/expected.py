"""What the laws of beds say of a case before it runs: velocities, expansion, pressure drop, film, steps, cost."""

from __future__ import annotations

import math
from dataclasses import dataclass

from cfddem.bed import POURED_SOLID_FRACTION, Species
from cfddem.case import Case
from cfddem.chosen_laws import GAP_ARGUMENTS, asked_by_name
from cfddem.coupling.clocks import COURANT, MOST_SUBSTEPS
from cfddem.fluid.division import VISCOUS, cell_counts
from cfddem.materials import pair_table
from cfddem.mixture import bed_drag
from cfddem.particles.steps import Clocks, crossing_step, hertz_steps, linear_steps
from closures import balance, bed, contact, drag_single, minimum_gap, numbers

LIQUID = 100.0
"""Density from which on a fluid counts as a liquid, whose beds expand evenly [kg/m3]."""

BYTES_PER_PARTICLE, BYTES_PER_CELL, BYTES_AT_LEAST = 3000.0, 1300.0, 0.45e9
"""Memory of a dense run, by the size of its arrays and that of a process with its loops."""

PARTICLE_STEPS_PER_SECOND, CELL_STEPS_PER_SECOND, EXCHANGES_PER_SECOND = 4e6, 3e5, 4e5
"""Speed of one core: particle steps, cells of fluid steps, particles of fluid steps.

Measured with 2 000 to 128 000 spheres in a liquid; particles alone are two to three times as fast where few touch.
"""


@dataclass(frozen=True)
class Bed:
    """The bed by the laws of beds; nan where a law does not apply."""

    count: int
    solids: float  # volume of the particles [m3]
    weight: float  # buoyant, over the floor [Pa]
    archimedes: float
    inlet: float  # mean superficial velocity over the floor, the largest in time [m/s]
    reynolds: float  # on the superficial velocity; on the terminal one where nothing flows in
    onset: float  # u_mf by the drag law, at the voidage of a poured bed [m/s]
    terminal: float  # u_t of a particle alone, of the slowest species [m/s]
    voidage: float  # of the bed in the flow
    height: float  # of the bed in the flow [m]
    pressure_drop: float  # [Pa]
    drag_factor: float  # F at this voidage

    @property
    def poured_height(self) -> float:
        """Height of the bed at rest [m]."""
        return self.height * (1.0 - self.voidage) / POURED_SOLID_FRACTION


def bed_of(case: Case) -> Bed:
    """The bed of a case."""
    diameter, floor = case.bed.diameter, case.column.floor_area
    count, solids, density = case.particle_count, sum(case.volumes.values()), case.solid_density
    packed, nan = 1.0 - POURED_SOLID_FRACTION, math.nan
    poured = solids / (floor * POURED_SOLID_FRACTION)
    gravity, fluid = math.hypot(*case.laws.gravity), case.fluid
    if fluid is None:
        weight = solids * density * gravity / floor
        return Bed(count, solids, weight, nan, 0.0, nan, nan, nan, packed, poured, nan, nan)
    weight = solids * abs(density - fluid.density) * gravity / floor
    inlet = mean_inlet(case)
    if fluid.viscosity == 0.0:
        return Bed(count, solids, weight, nan, inlet, nan, nan, nan, packed, poured, nan, nan)
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
        voidage = 1.0 - solids / (floor * case.column.height)
    elif case.bed.fixed:
        voidage = packed
    elif inlet > 0.0 and number > 0.0 and fluid.density >= LIQUID:  # a gas bed bubbles instead
        voidage = balance.voidage_in_balance(number, inlet / scale, drag, packed)
    height = case.column.height if voidage >= 1.0 else solids / (floor * (1.0 - voidage))
    drop = weight
    if case.bed.fixed or inlet < onset:
        drop = bed.ergun_gradient(inlet, diameter, fluid.density, fluid.viscosity, min(voidage, 0.999)) * height
    return Bed(
        count, solids, weight, number, inlet, reynolds, onset, terminal, voidage, height, drop, drag(reynolds, voidage)
    )


def mean_inlet(case: Case) -> float:
    """Superficial velocity over the whole floor, the jet included, the largest in time [m/s]."""
    column, jet = case.column, case.bed.jet
    if column.ends != "flow":
        return 0.0
    inlet = case.bed.floor_speed
    if jet is None:
        return inlet
    width, depth, _ = column.size
    hole = 0.25 * math.pi * jet.width**2 if jet.round else min(jet.width, width) * min(jet.depth or depth, depth)
    share = min(1.0, hole / column.floor_area)
    return (1.0 - share) * inlet + share * jet.velocity


# ---------------------------------------------------------------- film and contact


@dataclass(frozen=True)
class Encounter:
    """Two mean particles of a species that meet at the reference speed."""

    species: str
    speed: float  # [m/s]
    stokes: float
    roughness_gap: float  # h_sigma [m]
    film_gap: float  # h_eps, with the real modulus [m]
    softened_film_gap: float  # h_eps if the film felt the modulus of the contact [m]
    overlap: float  # deepest, dry [m]
    real_overlap: float  # the same with the real modulus [m]
    resting_overlap: float  # under the weight of the bed [m]
    softening: float  # modulus of the contact over the real one

    @property
    def gap(self) -> float:
        """The minimum gap: the larger of roughness and elastic film [m]."""
        return max(self.roughness_gap, self.film_gap)

    @property
    def softened_gap(self) -> float:
        """What the minimum gap would be if the film felt the modulus of the contact [m]."""
        return max(self.roughness_gap, self.softened_film_gap)


def encounter_of(case: Case, known: Bed) -> Encounter:
    """How two particles of a case meet; in a mixture those of the species that press deepest into each other."""
    met = (_encounter(case, known, name, each) for name, each in case.species.items())
    return max(met, key=lambda each: each.overlap / case.species[each.species].diameter)


def _encounter(case: Case, known: Bed, name: str, species: Species) -> Encounter:
    """How two particles of a species meet."""
    row = _pair(case, species)
    mass, radius = _reduced(case, species, species.diameter)
    speed = max(case.reference_speed, 1e-12)
    real, soft = float(row["film_modulus"]), float(row["contact_modulus"])
    stiffness, real_stiffness = contact.hertz_stiffness(soft, radius), contact.hertz_stiffness(real, radius)
    load = known.weight * species.diameter**2
    viscosity = 0.0 if case.fluid is None else case.fluid.viscosity
    wet = case.has_films
    return Encounter(
        name,
        speed,
        numbers.stokes(mass, speed, viscosity, radius) if viscosity > 0.0 else math.inf,
        float(row["roughness_gap"]) if wet else 0.0,
        _film_gap(case, float(row["roughness_gap"]), speed, viscosity, real, radius) if wet else 0.0,
        _film_gap(case, float(row["roughness_gap"]), speed, viscosity, soft, radius) if wet else 0.0,
        contact.hertz_largest_overlap(mass, stiffness, speed),
        contact.hertz_largest_overlap(mass, real_stiffness, speed),
        (load / stiffness) ** (2.0 / 3.0),
        soft / real,
    )


def _film_gap(case: Case, roughness: float, speed: float, viscosity: float, modulus: float, radius: float) -> float:
    """Gap at which the film turns two particles back, by the law that the case has chosen [m]."""
    own = case.laws.pair_laws.get("minimum_gap")
    asked = (roughness, speed, viscosity, modulus, radius)
    return asked_by_name(own.function if own else minimum_gap.elastohydrodynamic, GAP_ARGUMENTS, asked)


def _pair(case: Case, species: Species):  # type: ignore[no-untyped-def]
    """Row of the table of material pairs of two particles of a species."""
    return pair_table([case.material_of(species)])[0, 0]


def _reduced(case: Case, species: Species, diameter: float) -> tuple[float, float]:
    """Reduced mass [kg] and radius [m] of two particles of a species and a diameter [m]."""
    return 0.5 * math.pi / 6.0 * diameter**3 * case.material_of(species).density, 0.25 * diameter


# ---------------------------------------------------------------- steps and cost


@dataclass(frozen=True)
class Steps:
    """Steps of a run, and what it costs."""

    clocks: Clocks  # of the particles
    particle: float  # step of the particles [s]
    limits: dict[str, float]  # of the fluid step, by clock [s]
    cells: tuple[int, int, int] | None

    @property
    def binding(self) -> str:
        """Clock that sets the fluid step."""
        return min(self.limits, key=self.limits.__getitem__)

    @property
    def fluid(self) -> float:
        """Step of the fluid, or of the particles between two looks at their clocks [s]."""
        return self.limits[self.binding]


def steps_of(case: Case, known: Bed) -> Steps:
    """Steps of a case at its start."""
    run, speed = case.run, max(case.reference_speed, 1e-12)
    every = [_clocks(case, each, speed) for each in case.species.values()]
    read = min(every, key=lambda each: each.recommended)
    particle = math.inf if case.bed.fixed else run.step or read.recommended
    limits = {"collision": MOST_SUBSTEPS * particle}
    if run.fluid_step is not None:
        limits["given"] = run.fluid_step
    if case.fluid is None:
        return Steps(read, particle, limits, None)
    cells = cell_counts(case.column.size, case.column.cell)
    spacing = [length / count for length, count in zip(case.column.size, cells)]
    fastest = max(known.inlet / known.voidage, case.bed.inlet_speed)
    if fastest > 0.0:
        limits["Courant"] = COURANT * min(spacing) / fastest
    rates = [width**-2 for width, count in zip(spacing, cells) if count > 1]
    if rates and case.fluid.viscosity > 0.0:
        limits["viscous"] = VISCOUS * case.fluid.density / (2.0 * case.fluid.viscosity * sum(rates))
    if not case.bed.fixed:
        limits["particle Courant"] = COURANT * min(spacing) / speed
    return Steps(read, particle, limits, cells)


def _clocks(case: Case, species: Species, speed: float) -> Clocks:
    """Clocks of the smallest particles of a species."""
    mass, radius = _reduced(case, species, species.smallest)
    laws = case.laws
    if laws.contact == "linear" and max(laws.normal_stiffness, laws.tangential_stiffness) > 0.0:
        hertz, impact = linear_steps(mass, laws.normal_stiffness, laws.tangential_stiffness)
    else:
        modulus = float(_pair(case, species)["contact_modulus"])
        hertz, impact = hertz_steps(mass, radius, modulus, speed)
    return Clocks(hertz, impact, math.inf, math.inf, crossing_step(2.0 * radius, speed))


@dataclass(frozen=True)
class Cost:
    """Time on one core, memory, and room on the disk."""

    seconds: float
    memory: float  # [byte]
    disk: float  # [byte]
    snapshots: float
    of_cells: bool  # cells take more memory than particles


def cost_of(case: Case, known: Bed, steps: Steps) -> Cost:
    """What a run will cost, to within a factor of two or three."""
    cells = math.prod(steps.cells or (0, 0, 0))
    pushes, turns = case.run.until / min(steps.particle, steps.fluid), case.run.until / steps.fluid
    seconds = pushes * known.count / PARTICLE_STEPS_PER_SECOND
    seconds += turns * (cells / CELL_STEPS_PER_SECOND + known.count / EXCHANGES_PER_SECOND * bool(cells))
    snapshots = 1.0 + case.run.until / (case.run.every or case.run.until / 50.0)
    return Cost(
        seconds,
        BYTES_AT_LEAST + BYTES_PER_PARTICLE * known.count + BYTES_PER_CELL * cells,
        snapshots * (120.0 * known.count + 40.0 * cells),
        snapshots,
        BYTES_PER_CELL * cells > BYTES_PER_PARTICLE * known.count,
    )
