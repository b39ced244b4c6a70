r"""Heat between particles, with walls, and by radiation with the surroundings.

.. math:: m_i c_i\,\dot T_i = \sum_j G_{ij}(T_j - T_i) + \sum_w G_{iw}(T_w - T_i) + h_i A_i (T_e - T_i)

One implicit step over the list of pairs, by conjugate gradients: no step is too long, and no temperature leaves the
range of those that exchange. What a pair exchanges follows from the new temperatures, and is equal and opposite to the
last bit.

Every rank solves for its own particles. Ghosts receive the unknowns of others before each product. A particle sums its
links in the order of the ids of the others, and scalar products are sums of whole numbers: the bits are those of one
process, for any division of space. A wall with a power is an unknown that every rank has.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.communicator import Communicator
from cfddem.backend.compile import serial
from cfddem.case.schema import Case
from cfddem.features.case_feature import CaseFeature, Measured
from cfddem.features.contact_heat_keys import ADIABATIC, ContactHeat, wall_names
from cfddem.features.heat import LEAST, mean_temperature
from cfddem.features.heat_keys import Heat
from cfddem.fluid.thin_walls import thin_wall
from cfddem.model.fields import Field
from cfddem.particles.pair_graph import shifts
from cfddem.particles.particle_feature import Engine, ParticleFeature
from cfddem.particles.state import Particles
from cfddem.particles.walls.nearest_point import NORMAL
from closures.contact_heat import (
    asperity_conductance,
    contact_conductance,
    harmonic_conductivity,
    hertz_radius,
    intersection_radius,
    lens_conductance,
    local_surroundings,
    macro_gap_conductance,
    micro_gap_conductance,
    radiation_coefficient,
    solid_layer_resistance,
)

TOLERANCE = 1e-13
"""Residual of the implicit step over the right-hand side [-]."""

MOST_ITERATIONS = 2000

UNKNOWN = Field("heat_unknown", "K", role="scratch", halo=("heat",), meaning="iterate of the exchange of heat")
"""The field by which ghosts get the unknowns of others."""


class Links(NamedTuple):
    """Conductances of owned particles with others, by particle and then by the id of the other."""

    row: np.ndarray  # owned particle (n,)
    other: np.ndarray  # owned, or a ghost (n,)
    link: np.ndarray  # [W/K]

    @classmethod
    def of(cls, first: np.ndarray, second: np.ndarray, conductance: np.ndarray, particles: Particles) -> Links:
        """Links of pairs; a pair of two owned particles has two."""
        some = conductance > 0.0
        row, other = np.append(first[some], second[some]), np.append(second[some], first[some])
        link = np.tile(conductance[some], 2)
        mine = row < particles.owned
        row, other, link = row[mine], other[mine], link[mine]
        order = np.lexsort((link, particles.id[other], row))
        return cls(row[order], other[order], link[order])

    def sums(self, values: np.ndarray, count: int) -> np.ndarray:
        """Sums of the values of links over each of so many particles (count,)."""
        return np.bincount(self.row, values, count).astype(float)  # whole numbers without a link


class Network:
    """Linear equations of the new temperatures.

    solver    whose particles exchange
    diagonal  of owned particles, without their links (N,) [W/K]
    pairs     links between particles
    at_walls  rows of owned particles, numbers of walls with a power, and their links [W/K]
    walls     number of these walls
    """

    def __init__(
        self,
        solver: Any,
        diagonal: np.ndarray,
        pairs: Links,
        at_walls: tuple[np.ndarray, np.ndarray, np.ndarray],
        walls: int,
    ) -> None:
        self.solver, self.pairs, self.at_walls, self.walls = solver, pairs, at_walls, walls
        self.total, self.count = solver.communicator.sum, len(diagonal)
        body, _, link = at_walls
        of_particles = diagonal + pairs.sums(pairs.link, self.count)
        np.add.at(of_particles, body, link)
        of_walls = self._at_each_wall(link)
        of_walls[of_walls == 0.0] = 1.0  # a wall that nothing touches
        self.diagonal = np.append(of_particles, of_walls)

    def _at_each_wall(self, values: np.ndarray) -> np.ndarray:
        """Sums over the links of every wall, of all ranks (walls,)."""
        if not self.walls:
            return np.zeros(0)
        of_wall = self.at_walls[1] == np.arange(self.walls)[:, None]
        return np.asarray(self.total(np.where(of_wall, values, 0.0), axis=1))

    def around(self, values: np.ndarray) -> np.ndarray:
        """Values of the owned particles (N,), followed by those of ghosts."""
        particles = self.solver.particles
        particles.heat_unknown[: self.count] = values
        self.solver.lists.ghosts.refresh("heat")
        return np.asarray(particles.heat_unknown)

    def product(self, values: np.ndarray) -> np.ndarray:
        """The equations, applied to unknowns of owned particles and walls (N + walls,)."""
        (_, other, link), (body, node, at_wall), count = self.pairs, self.at_walls, self.count
        apart = self.pairs.sums(link * self.around(values[:count])[other], count)
        np.add.at(apart, body, at_wall * values[count:][node])
        return self.diagonal * values - np.append(apart, self._at_each_wall(at_wall * values[body]))

    def dot(self, one: np.ndarray, other: np.ndarray) -> float:
        """Scalar product over all ranks; walls count once."""
        product, n = one * other, self.count
        return float(self.total(product[:n]) + product[n:].sum())

    def solved(self, right: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Temperatures of owned particles, and of walls with a power [K].

        right  right-hand side (N + walls,) [W]
        start  first guess of particles (N,) [K]
        """
        values = np.append(start, (right / self.diagonal)[self.count :])
        residual = right - self.product(values)
        scale = self.dot(right, right)
        direction, size = np.zeros(len(right)), 1.0
        for _ in range(MOST_ITERATIONS):
            if self.dot(residual, residual) <= TOLERANCE**2 * scale:
                break
            guess = residual / self.diagonal
            before, size = size, self.dot(residual, guess)
            direction = guess + (size / before) * direction
            image = self.product(direction)
            length = size / self.dot(direction, image)
            values, residual = values + length * direction, residual - length * image
        return values[: self.count], values[self.count :]


# ---------------------------------------------------------------- loops
#
# Conductances of pairs of particles, and of particles and walls, in one compiled loop.


NONE, SMOOTH, ROUGH = 0, 1, 2
LENS, RAREFIED = 1, 2


class Pairs(NamedTuple):
    """Pairs of two spheres, or of a sphere and a wall, whose radius is infinite."""

    first: np.ndarray  # radius [m]
    second: np.ndarray  # radius [m]
    gap: np.ndarray  # [m]
    force: np.ndarray  # normal, of the contact; 0 or less without one [N]
    modulus: np.ndarray  # E* of the real solids [Pa]
    first_conductivity: np.ndarray  # [W/m/K]
    second_conductivity: np.ndarray  # [W/m/K]
    hardness: np.ndarray  # harmonic mean of the two [Pa]
    roughness: np.ndarray  # of both surfaces together [m]
    slope: np.ndarray  # of both together [-]


class Choices(NamedTuple):
    """Which conductances act, and the gas."""

    contact: int  # NONE, SMOOTH or ROUGH
    by_force: bool  # the radius of a contact is that of Hertz
    gap: int  # NONE, LENS or RAREFIED
    conductivity: float  # of the gas [W/m/K]
    lens: float  # gap up to which it conducts, over the larger radius [-]
    least_gap: float  # [m]
    jump: float  # gas parameter M [m]


@serial
def conductances(pairs, choices, result):
    """Conductance of each pair, written to `result` (n,) [W/K]."""
    gas = choices.conductivity
    for k in range(len(result)):
        first, second, gap = pairs.first[k], pairs.second[k], pairs.gap[k]
        reduced = first if second == math.inf else first * second / (first + second)
        circle, total = 0.0, 0.0
        if choices.contact != NONE:
            if choices.by_force and pairs.force[k] > 0.0:
                circle = min(hertz_radius(pairs.force[k], pairs.modulus[k], reduced), reduced)
            elif not choices.by_force and gap < 0.0:
                circle = intersection_radius(first, second, -gap)
        if circle > 0.0:
            both = harmonic_conductivity(pairs.first_conductivity[k], pairs.second_conductivity[k])
            total = contact_conductance(both, circle)
            if choices.contact == ROUGH:
                pressure = max(1.5 * pairs.force[k] / (math.pi * circle**2 * pairs.hardness[k]), 1e-12)
                rough = asperity_conductance(both, circle, pressure, pairs.roughness[k], pairs.slope[k])
                if choices.gap != NONE:
                    rough += gas * micro_gap_conductance(circle, pressure, pairs.roughness[k], choices.jump)
                total = 1.0 / (1.0 / total + 1.0 / rough)
        if choices.by_force and gap < 0.0:  # a softened contact overlaps too much
            gap = -(circle**2) / reduced
        if choices.gap == LENS:
            total += gas * lens_conductance(first, second, gap, choices.lens, choices.least_gap)
        elif choices.gap == RAREFIED and gap < choices.lens * (first if second == math.inf else max(first, second)):
            around = gas * macro_gap_conductance(first, second, gap, circle, choices.jump)
            layers = solid_layer_resistance(first, circle, pairs.first_conductivity[k])
            if second != math.inf:
                layers += solid_layer_resistance(second, circle, pairs.second_conductivity[k])
            total += 1.0 / (1.0 / around + layers)
        result[k] = total


class HeatExchangeOfContacts(CaseFeature):
    """Temperatures of particles that touch each other and walls.

    from_walls      heat given by the walls so far [J]
    radiated        heat received from the surroundings so far [J]
    gained          change of the heat of the particles by this exchange, from their temperatures [J]
    scale           heat that particles gained and lost so far, without sign [J]
    total_capacity  heat capacity of all particles in the last exchange [J/K]
    """

    name, table, kept = "contact heat", "contact_heat", ("from_walls", "radiated", "gained", "scale", "total_capacity")
    measures = (
        Measured("mean_temperature", "K", "measure", "mean temperature of the particles, by heat capacity",
                 mean_temperature, lambda case: not Heat.of(case)),
        Measured("contact_heat_from_walls", "J", "recorded", "heat that the walls have given to the particles",
                 lambda heat, _: heat.from_walls),
        Measured("contact_heat_radiated", "J", "recorded",
                 "heat that the particles have received from the surroundings by radiation",
                 lambda heat, _: heat.radiated),
        Measured("contact_heat_imbalance", "1", "imbalance",
                 "change of the heat in the particles that walls and surroundings did not give, over the heat "
                 "exchanged, at least that of a thousandth of a kelvin", lambda heat, _: heat.imbalance),
    )  # fmt: skip

    def __init__(self, case: Case, simulation: Any) -> None:
        keys = ContactHeat.of(case)
        assert keys
        self.keys, self.case = keys, case
        self.capacities = _capacities(case, keys)
        self.emissivities = keys.by_material(case, "emissivity", 0.0)
        self.walls = [keys.wall.get(name, ADIABATIC) for name in wall_names(case)]
        thin = [wall.form.corners() for wall in case.wall if wall.is_thin]  # also without a fluid
        self._thin = thin_wall(*thin) if thin else None
        self.from_walls, self.radiated, self.gained, self.scale = 0.0, 0.0, 0.0, 0.0
        self.total_capacity, self._step = float(simulation.communicator.sum(self.capacity(simulation.owned))), 0.0
        self.choices = Choices(
            contact={"none": NONE, "smooth": SMOOTH, "rough": ROUGH}[keys.contact],
            by_force=keys.radius == "hertz",
            gap={"none": NONE, "lens": LENS, "rarefied": RAREFIED}[keys.gap],
            conductivity=keys.gas_conductivity or 0.0,
            lens=keys.lens,
            least_gap=keys.least_gap,
            jump=keys.jump,
        )
        solver = simulation.particle_solver
        solver.features.append(HeatReach(self._reach(solver.particles, simulation.communicator)))
        if keys.held:
            solver.hold()

    def _reach(self, particles: Particles, communicator: Communicator) -> float:
        """Reach of the list of pairs over R* [-]."""
        if self.choices.gap == NONE and not any(wall.coefficient for wall in self.walls):
            return 0.0
        largest, smallest = communicator.largest(particles.radius), communicator.smallest(particles.radius)
        return float(self.keys.lens * (1.0 + largest / smallest))

    @classmethod
    def fields_of(cls, case: Case) -> tuple[Field, ...]:
        """The temperature; `[heat]` declares it where a case has both."""
        keys = ContactHeat.of(case)
        assert keys
        if Heat.of(case):
            return (UNKNOWN,)
        by_species = keys.start_temperatures(case)

        def start(particles: Any, rows: np.ndarray) -> np.ndarray:
            return by_species[particles.species[rows]] if len(by_species) > 1 else np.full(len(rows), by_species[0])

        return Field("temperature", "K", initial=start, snapshot=True, meaning="temperature"), UNKNOWN

    @property
    def imbalance(self) -> float:
        """Change of the heat in the particles that walls and surroundings did not give, over the heat exchanged [-].

        At least over that of a thousandth of a kelvin: where less was exchanged, rounding would be over rounding.
        """
        wrong = abs(self.gained - self.from_walls - self.radiated)
        return wrong / max(self.scale, LEAST * self.total_capacity) if wrong > 0.0 else 0.0

    def capacity(self, particles: Any) -> np.ndarray:
        """Heat capacity of every particle (N,) [J/K]."""
        return np.asarray(particles.mass * self.capacities[particles.material])

    def before(self, simulation: Any, step: float) -> None:
        """Note the length of the step [s]."""
        self._step = step

    def after(self, simulation: Any) -> None:
        """Exchange heat over the step."""
        solver, particles, step = simulation.particle_solver, simulation.owned, self._step
        total, count = simulation.communicator.sum, simulation.owned.count
        capacity, start = self.capacity(particles), particles.temperature.copy()
        pairs, (body, wall, at_wall) = self._links(solver)
        area = 4.0 * np.pi * particles.radius**2
        around = self._surroundings(simulation)
        emissivity: Any = self.emissivities[particles.material]
        radiation = area * radiation_coefficient(emissivity, start, around)  # type: ignore[arg-type]  # of every particle
        temperatures = np.array([of_wall.fixed for of_wall in self.walls])
        powered = np.array([of_wall.is_powered for of_wall in self.walls], bool)

        # walls of a temperature stand on the right; a wall with a power is an unknown without capacity
        fixed, free = ~powered[wall], powered[wall]
        diagonal, right = capacity / step + radiation, capacity / step * start + radiation * around
        np.add.at(diagonal, body[fixed], at_wall[fixed])
        np.add.at(right, body[fixed], at_wall[fixed] * temperatures[wall[fixed]])
        power = np.array([of_wall.power for of_wall in self.walls if of_wall.is_powered], float)  # type: ignore[type-var]
        node = (np.cumsum(powered) - 1)[wall[free]]  # local: walls
        network = Network(solver, diagonal, pairs, (body[free], node, at_wall[free]), len(power))
        new, of_walls = network.solved(np.append(right, power), start)

        heat = step * pairs.link * (network.around(new)[pairs.other] - new[pairs.row])
        of_power = step * at_wall[free] * (of_walls[node] - new[body[free]])
        from_walls = step * at_wall[fixed] * (temperatures[wall[fixed]] - new[body[fixed]])
        absorbed = step * radiation * (around - new)
        passed = pairs.sums(heat, count)
        np.add.at(passed, body[free], of_power)
        np.add.at(passed, body[fixed], from_walls)
        particles.temperature += (passed + absorbed) / capacity

        at_walls = total(np.append(of_power, from_walls)), total(np.abs(np.append(of_power, from_walls)))
        gained = capacity * (particles.temperature - start)
        radiated, gains, size, self.total_capacity = total(
            [absorbed, gained, np.abs(absorbed), capacity], axis=1
        ).tolist()
        self.from_walls += at_walls[0]
        self.radiated += radiated
        self.gained += gains
        self.scale += 0.5 * total(np.abs(heat)) + at_walls[1] + size

    def _links(self, solver: Any) -> tuple[Links, tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Links of owned particles with others, and rows, walls and conductance of owned particles at walls."""
        edges, particles, walls, keys = solver.edges, solver.particles, solver.walls, self.keys
        pairs, gap = edges.between_particles, solver.gap
        first, second = edges.first.astype(np.int64), edges.second.astype(np.int64)
        force = np.zeros(edges.rows) if "force" not in edges else self._normal_force(solver)
        between = self._conductances(
            particles, particles.material[first[:pairs]], particles.material[second[:pairs]],
            (particles.radius[first[:pairs]], particles.radius[second[:pairs]], gap[:pairs], force[:pairs]), solver,
        )  # fmt: skip
        if self._thin:
            near = np.flatnonzero(between)
            one, other = particles.position[first[near]], particles.position[second[near]]
            apart = self._apart(solver)[near]
            # also from the second: across a periodic side the wall is beside one of them
            behind = self._thin.between(one, one - apart) | self._thin.between(other, other + apart)
            between[near[behind]] = 0.0
        body, piece = first[pairs:], second[pairs:]
        wall = walls.wall[piece]
        # one link of a particle and a wall: at the nearest of its pieces
        order = np.lexsort((gap[pairs:], wall, body))
        fresh = np.ones(len(order), bool)
        fresh[1:] = (np.diff(body[order]) != 0) | (np.diff(wall[order]) != 0)
        heated = np.array([of_wall.passes_heat for of_wall in self.walls], bool)
        rows = order[fresh]
        rows = rows[heated[wall[rows]] & (body[rows] < particles.owned)]
        body, wall, gap, force = body[rows], wall[rows], gap[pairs:][rows], force[pairs:][rows]
        radius = particles.radius[body]
        at_wall = self._conductances(
            particles, particles.material[body], walls.material[piece[rows]],
            (radius, np.full(len(rows), np.inf), gap, force), solver,
        )  # fmt: skip
        coefficient = np.array([of_wall.coefficient or 0.0 for of_wall in self.walls])[wall]
        touches = np.where(gap < keys.lens * radius, coefficient * np.pi * radius**2, 0.0)
        at_wall = np.where(coefficient > 0.0, touches, at_wall)
        there = at_wall > 0.0
        links = Links.of(first[:pairs], second[:pairs], between, particles)
        return links, (body[there], wall[there], at_wall[there])

    def _normal_force(self, solver: Any) -> np.ndarray:
        """Normal force of every contact, repulsive above 0 (n,) [N]."""
        edges, apart = solver.edges, self._apart(solver)
        apart /= np.maximum(np.linalg.norm(apart, axis=1), 1e-300)[:, None]
        normal = np.concatenate([apart, edges.touch[:, NORMAL : NORMAL + 3]])
        return np.asarray(np.einsum("ij,ij->i", edges.force, normal))

    def _apart(self, solver: Any) -> np.ndarray:
        """Place of the first particle of every pair from that of the second (n, 3) [m]."""
        edges, position = solver.edges, solver.particles.position
        pairs = edges.between_particles
        apart = position[edges.first[:pairs]] - position[edges.second[:pairs]]
        return np.asarray(apart + shifts(solver.box)[edges.image[:pairs]])

    def _conductances(
        self, particles: Particles, one: np.ndarray, other: np.ndarray, shape: tuple[np.ndarray, ...], solver: Any
    ) -> np.ndarray:
        """Conductances of pairs (n,) [W/K].

        one, other  numbers of the two materials (n,)
        shape       radii, gap and normal force
        """
        keys, case = self.keys, self.case
        solid, hardness = keys.by_material(case, "conductivity", 1.0), keys.by_material(case, "microhardness", 1.0)
        slope, height = keys.by_material(case, "slope", 1.0), keys.by_material(case, "surface_roughness", 1.0)
        first, second, gap, force = shape
        pairs = Pairs(
            first=first,
            second=second,
            gap=gap,
            force=force,
            modulus=np.ascontiguousarray(solver.table["film_modulus"][one, other]),
            first_conductivity=solid[one],
            second_conductivity=solid[other],
            hardness=2.0 * hardness[one] * hardness[other] / (hardness[one] + hardness[other]),
            roughness=np.hypot(height[one], height[other]),
            slope=np.hypot(slope[one], slope[other]),
        )
        result = np.zeros(len(one))
        conductances(pairs, self.choices, result)
        return result

    def _surroundings(self, simulation: Any) -> np.ndarray:
        """Temperature of what every particle sees (N,) [K]."""
        particles, joined = simulation.owned, simulation.communicator.joined
        temperature = np.full(particles.count, self.keys.surroundings_temperature or 0.0)
        if self.keys.surroundings == "uniform" or not self.keys.emissivity:
            return temperature
        size = np.array(self.case.column.size)
        cell = np.broadcast_to(np.array(self.case.column.cell, float), 3)
        number = np.maximum(np.rint(size / cell), 1).astype(np.int64)
        place = np.clip((particles.position / size * number).astype(np.int64), 0, number - 1)
        row = (place[:, 0] * number[1] + place[:, 1]) * number[2] + place[:, 2]
        cells = int(np.prod(number))
        # of all ranks, by id, so that sums have the same bits on any number of them
        order = np.argsort(joined(particles.id))
        every, volume, values = (joined(column)[order] for column in (row, particles.volume, particles.temperature))
        voidage = 1.0 - np.minimum(np.bincount(every, volume, cells) / np.prod(size / number), 1.0)
        mean = np.bincount(every, values, cells) / np.maximum(np.bincount(every, minlength=cells), 1)
        return np.asarray(local_surroundings(voidage[row], temperature, mean[row]))  # type: ignore[arg-type]


def _capacities(case: Case, keys: ContactHeat) -> np.ndarray:
    """Specific heat capacity by number of material [J/kg/K]."""
    heat = Heat.of(case)
    return heat.capacities(case) if heat else keys.by_material(case, "heat_capacity")


class HeatReach(ParticleFeature):
    """Keeps pairs in the list up to the gap through which the gas conducts."""

    name = "reach of heat"

    def __init__(self, reach: float) -> None:
        self.reach = reach

    def reach_ratio(self, engine: Engine, after: Particles | None) -> float:
        """Reach over R* [-]."""
        return self.reach

    def outgrows(self, engine: Engine, reach: float) -> bool:
        """Whether the list is too short, as the first of a run is."""
        return self.reach > reach
