"""The case: the complete description of a run. It is checked when it is made and does not change afterwards.

Python and TOML use the same keys. A case is data; reading one executes nothing. :mod:`cfddem.run.build` makes the
walls, boundaries, particles and solvers from it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import ValidationError, model_validator

from cfddem.backend.errors import InputError, shown
from cfddem.backend.law_choice import chosen
from cfddem.case.bed import AT_RANDOM, POURED_SOLID_FRACTION
from cfddem.case.compare import data_in
from cfddem.case.feature_table import FeatureTable, with_feature_tables
from cfddem.case.feeds import refuse_wrong_equipment
from cfddem.case.input_errors import Key, dotted, input_error, key_lines, line_of
from cfddem.case.liquid import Liquid, Spray
from cfddem.case.materials import Material, check_pairs, unknown_materials
from cfddem.case.tables import CaseTables
from cfddem.case.toml_text import parse, read_text, set_value
from cfddem.case.vessel import vessel_of
from cfddem.case.vessel_shape import refuse_openings
from cfddem.case.walls import place_of, walls_in
from closures.agitation import SHARES, TIMES, AgitationFactors, free_spheres
from closures.kinds import BUILT_IN
from closures.registry import Law, law_of, load_package_laws

HEAVY = 2.0
"""Density ratio from which agitation is a default: lighter beads are at the edge of what was measured."""


@with_feature_tables
class Case(CaseTables):
    """The complete description of a run.

    >>> case = Case(
    ...     fluid=dict(density=998.0, viscosity=1e-3),
    ...     material=dict(glass=dict(density=2540.0, youngs_modulus=60e9, poisson=0.23, friction=0.4)),
    ...     column=dict(width=0.02, height=0.12, cell=0.005),
    ...     bed=dict(diameter=2e-3, count=2000, inlet_velocity=0.05),
    ...     run=dict(until=2.0),
    ... )
    >>> case.solid.density
    2540.0
    """

    if TYPE_CHECKING:  # tables may be given as dictionaries, which type checkers would take for errors

        def __init__(self, **tables: Any) -> None: ...

    @model_validator(mode="after")
    def _material_names_exist(self) -> Case:
        named = {f"bed.species.{name}": species.material for name, species in self.bed.species.items()}
        for error in unknown_materials(list(self.material), named or {"bed": self.bed.material}, self.column.material):
            raise error
        check_pairs(self.material, self.pair)
        refuse_wrong_equipment(self)
        return self

    @model_validator(mode="after")
    def _a_random_packing_fills_a_box_or_cylinder(self) -> Case:
        if self.bed.start in AT_RANDOM and self.vessel and not (self.vessel.is_round and self.vessel.is_upright):
            raise InputError(
                "bed.start", self.bed.start, '"poured" or "suspended" in this vessel',
                "a packing fills a column, or an upright cylinder",
            )  # fmt: skip
        return self

    @model_validator(mode="after")
    def _the_vessel_goes_with_the_rest(self) -> Case:
        if self.vessel:
            self.vessel.refuse(self.column)
        if not self.has_smooth_walls:
            return self
        where = "in a vessel with a fluid" if self.vessel else "beside thin walls"
        if self.column.shape == "cylinder":
            raise InputError("column.shape", None, f"a box {where}", 'take [vessel] with shape = "cylinder"')
        closing = [f"wall.{n}.solid" for n, wall in enumerate(self.wall) if self.closes_cells(wall)]
        if closing:
            remedy = 'or take column.shape = "cylinder", a wall with steps of cells, without vessel and thin walls'
            raise InputError(closing[0], None, f'"none" or "thin" {where}', remedy)
        return self

    @model_validator(mode="after")
    def _thin_walls_end_before_periodic_sides(self) -> Case:
        for n, wall in enumerate(self.wall):
            reach = wall.form.extent() if wall in self.thin_walls and wall.file is None else None
            if reach is None:  # the grid refuses a surface, once its file is read
                continue
            for d, length in enumerate(self.column.size):
                if self.column.periodic[d] and (reach[0, d] <= 0.0 or reach[1, d] >= length):
                    low, high = (f"{end:.4g}" for end in reach[:, d])
                    raise InputError(f"wall.{n}.point", shown(wall.point), f"such that the thin wall ends before the "
                                     f"periodic sides, at 0 and {length:g} m along {'xyz'[d]}", f"it reaches from "
                                     f"{low} to {high} m; move it, or make it smaller")  # fmt: skip
        return self

    @model_validator(mode="after")
    def _what_enters_leaves(self) -> Case:
        if not self.patch:
            return self
        first, ends = next(iter(self.patch)), self.column.ends
        if not self.fluid or ends == "periodic":
            where = "without a fluid" if not self.fluid else 'where column.ends is "periodic"'
            remedy = "patches are for the fluid between walls"
            raise InputError(f"patch.{first}", None, f"left out {where}", remedy)
        refuse_openings(self)
        if self.bed.jet:
            raise InputError("bed.jet", None, "left out where there are patches", 'make it a patch, kind = "inlet"')
        kinds = [(patch.kind, patch.side, patch.shape) for patch in self.patch.values()]
        of_lid = [kind for kind, side, shape in kinds if side == "lid" and shape == "whole"]
        leaves = ends == "flow" and not {"wall", "inlet"} & {*of_lid}
        inlets = [name for name, patch in self.patch.items() if patch.kind == "inlet"]
        flows = self.bed.highest_inlet_velocity > 0.0
        enters = [f"patch.{name}" for name in inlets] + ["bed.inlet_velocity"] * (ends == "flow" and flows)
        if enters and not leaves and "outlet" not in {kind for kind, _, _ in kinds}:
            remedy = 'give a patch of kind = "outlet", or column.ends = "flow", whose lid is one'
            raise InputError(enters[0], None, "together with an outlet: what enters has to leave", remedy)
        return self

    @model_validator(mode="after")
    def _tables_of_features_go_with_the_rest(self) -> Case:
        tables: list[Liquid | Spray | FeatureTable | None] = [self.liquid, self.spray, *self.feature_tables]
        for table in tables:
            if table:
                table.refuse(self)
        return self

    @property
    def feature_tables(self) -> list[FeatureTable]:
        """Tables of this case that features own."""
        values = (getattr(self, name) for name in type(self).model_fields)
        return [value for value in values if isinstance(value, FeatureTable)]

    @property
    def solid(self) -> Material:
        """Material of the particles, if they are all of one kind.

        Raises InputError for a mixture.
        """
        if self.bed.species:
            raise InputError("bed.species", None, "left out; this operation needs a bed of one material")
        return self.material_of(self.bed)

    @property
    def counts(self) -> dict[str, int]:
        """Number of particles of each species: as given, or as many as a poured bed of the given height holds."""
        bed = self.bed
        if bed.height is None:
            return {name: species.count or len(bed.positions) for name, species in self.species.items()}
        vessel = vessel_of(self)
        volume = self.floor_area * bed.height if vessel is None else vessel.below(bed.height)
        solids = POURED_SOLID_FRACTION * volume
        shares = bed.species_volumes(solids) or dict.fromkeys(self.species, solids)
        return {name: int(shares[name] / species.mean_volume) for name, species in self.species.items()}

    @property
    def volumes(self) -> dict[str, float]:
        """Particle volume of each species [m3]."""
        return {name: count * self.species[name].mean_volume for name, count in self.counts.items()}

    @property
    def solid_density(self) -> float:
        """Volume mean of the particle density [kg/m3]."""
        volumes, species = self.volumes, self.species
        mass = sum(volume * self.material_of(species[name]).density for name, volume in volumes.items())
        return mass / sum(volumes.values())

    @property
    def has_films(self) -> bool:
        """Whether lubrication films form between close spheres."""
        return self.laws.film_in(self.around) != "none"

    @property
    def agitation(self) -> str | Law:
        """Law of agitation that the run uses, or "none" or "lattanzi".

        `laws.agitation = "auto"` is `free_spheres` if density ratios and Re_m = rho U d / eta, with the inlet velocity
        U, are within its range and the density ratios at least HEAVY, and "none" otherwise. The solid fraction is
        compared with the range during the run.
        """
        choice = self.laws.agitation
        if choice == "auto" or "agitation" in self.laws.missing:
            return law_of(free_spheres) if choice == "auto" and self._agitation_is_measured else "none"
        return choice if isinstance(choice, str) and choice in BUILT_IN["agitation"] else chosen("agitation", choice)

    @property
    def surface(self) -> Literal["smeared", "sharp"]:
        """What particles at the surface of a bed see.

        `laws.surface = "auto"` is sharp in model A with a law of drag and a kernel, and smeared in model B.
        """
        return self._surface_and_reason[0]

    @property
    def surface_in_words(self) -> str:
        """What particles at the surface of a bed see, and why; empty for one sphere, and where nothing resists it."""
        surface, reason = self._surface_and_reason
        return f"{surface}{reason}" if self.resists and not self.is_one_sphere else ""

    @property
    def _surface_and_reason(self) -> tuple[Literal["smeared", "sharp"], str]:
        """What particles at the surface of a bed see, and why that is the default; no reason if the case says it."""
        laws = self.laws
        if laws.surface != "auto":
            return laws.surface, ""
        if laws.model == "B" or laws.kernel_width == 0.0:
            return "smeared", ", the default in model B" if laws.model == "B" else ", the default without a kernel"
        if laws.drag_law is None or self.is_one_sphere:
            return "smeared", ""
        return "sharp", ", the default"

    @property
    def agitation_factors(self) -> AgitationFactors:
        """Factors of the law of agitation: those of the case, or those of the law where the case has none."""
        laws, law = self.laws, self.agitation
        name = law.name if isinstance(law, Law) else law
        along, across = SHARES.get(name, (1.0, 1.0))
        return AgitationFactors(
            _given(laws.agitation_drag_along, along),
            _given(laws.agitation_drag_across, across),
            laws.agitation_inertia,
            _given(laws.agitation_time, TIMES.get(name, 1.0)),
        )

    @property
    def _agitation_is_measured(self) -> bool:
        """Whether the law of free spheres was measured for all species at the highest inlet velocity."""
        if not self.resists:
            return False
        fluid, ranges = self.required_fluid, law_of(free_spheres).ranges
        numbers = [
            {
                "density_ratio": self.material_of(species).density / fluid.density,
                "reynolds": fluid.density * self.fastest_inflow * species.diameter / fluid.viscosity,
            }
            for species in self.species.values()
        ]
        return all(
            ranges[name][0] <= value <= ranges[name][1] and state["density_ratio"] >= HEAVY
            for state in numbers
            for name, value in state.items()
        )

    @property
    def particle_count(self) -> int:
        """Total number of particles."""
        return sum(self.counts.values())

    @property
    def is_one_sphere(self) -> bool:
        """Whether there is one particle in the whole run: none enter."""
        return self.particle_count == 1 and not self.feed

    @property
    def stands_still(self) -> bool:
        """Whether no particle moves in the whole run: a fixed bed, or particles that a table holds."""
        return self.bed.fixed or any(table.holds_particles for table in self.feature_tables)

    @property
    def reference_speed(self) -> float:
        """Highest collision speed to expect [m/s].

        As given in `run.reference_speed`, or the largest of twice the inlet velocity, the speed of free flow by the
        pressures of patches, that after a fall of one diameter, the initial speed, and those of walls and feeds.
        """
        if self.run.reference_speed is not None:
            return self.run.reference_speed
        fall = math.sqrt(math.hypot(*self.laws.gravity) * self.bed.largest_diameter)
        speeds = [math.hypot(*self.bed.initial_velocity), *(math.hypot(*feed.velocity) for feed in self.feed)]
        speeds += [wall.fastest for wall in self.wall if math.isfinite(wall.fastest)]
        speeds += [abs(self.vessel.spin) * max((radius for _, radius in self.line), default=0.0)] if self.vessel else []
        return max(2.0 * self.fastest_inflow, self.fastest_by_pressure, fall, *speeds)

    @classmethod
    def from_toml(cls, path: str | Path, overrides: Mapping[str, Any] | None = None) -> Case:
        """Read a case from a TOML file.

        overrides  values that replace those of the file, {"bed.inlet_velocity": 0.06, ...}

        Raises InputError that lists every input error with file, line, key, value and limit.
        """
        return cls.from_text(read_text(Path(path)), str(path), overrides).with_files_of(Path(path).parent)

    @classmethod
    def from_text(
        cls, text: str, name: str = "case", overrides: Mapping[str, Any] | None = None, *, finished: bool = False
    ) -> Case:
        """Read a case from the text of a TOML file; errors call it `name`, and surface files stay as they are given. In
        that of a finished run, laws that this machine does not have are names only, and tables of a user are left
        out."""
        values = parse(text, name)
        if values.keys() - cls.model_fields.keys():
            load_package_laws()  # an installed package may declare a table
        if finished:
            values = {key: value for key, value in values.items() if key in cls.model_fields}
        for key, value in (overrides or {}).items():
            set_value(values, key.split("."), value, key)
        try:
            return cls.model_validate(values, context={"finished": finished})
        except ValidationError as failure:
            lines, overridden = key_lines(text), {tuple(key.split(".")) for key in overrides or {}}

            def place(key: Key) -> str:
                if tuple(map(str, key)) in overridden:
                    return "--set "
                line = line_of(key, lines)
                return f"{name}: " if line is None else f"{name}:{line}: "

            raise input_error(failure, cls, values, _unknown_materials_in(failure, values), place) from None

    def to_toml(self) -> str:
        """The case as TOML text; `Case.from_text` reads it back as an equal case."""
        import tomli_w

        values = self.model_dump(exclude_defaults=True, exclude_none=True)
        for kind in BUILT_IN:
            if callable(law := getattr(self.laws, kind)):
                values["laws"][kind] = getattr(law, "__name__", "user-defined law")
        return tomli_w.dumps(values)

    def with_files_of(self, folder: Path) -> Case:
        """The case with the places of its surface files and measured data; a run folder has copies of both.

        folder  of the case file; other paths are relative to it
        errors  InputError for measured data outside of the folder, unless their whole path is given
        """
        is_run = (folder / "run.json").is_file()
        vessel = self.vessel and self.vessel.with_file(
            lambda file: place_of(file, folder, "vessel", "vessel.file", is_run)
        )
        data = data_in(self.compare, folder)
        return self.model_copy(update={"wall": walls_in(self.wall, folder), "vessel": vessel, "compare": data})

    def with_(self, **changes: Any) -> Case:
        """A changed copy: `case.with_(**{"bed.inlet_velocity": 0.06})`, or whole tables by name."""
        values = self.model_dump()
        for key, value in changes.items():
            set_value(values, key.split("."), value, key)
        return Case(**values)


def require_case(value: object) -> None:
    """Refuse what is no case, such as the name of a file or a dict of tables."""
    if not isinstance(value, Case):
        remedy = "Case.from_toml(path) reads a file, Case(**tables) takes tables"
        raise InputError("case", type(value).__name__, "a Case", remedy)


def _given(value: float | None, default: float) -> float:
    return default if value is None else value


def _unknown_materials_in(failure: ValidationError, values: Mapping[str, Any]) -> list[InputError]:
    """Errors for unknown material names in raw values, where other errors prevent the case from being made."""
    if any(report["loc"] == () for report in failure.errors()):
        return []
    materials, bed, column = (values.get(name) for name in ("material", "bed", "column"))
    if not (isinstance(materials, dict) and isinstance(bed, dict) and isinstance(column, dict)):
        return []
    if dict not in map(type, materials.values()):
        return []
    species = bed.get("species") or {"": bed}
    if not isinstance(species, dict):
        return []
    tables = {f"bed.species.{name}" if name else "bed": table for name, table in species.items()}
    named = {key: table.get("material") for key, table in tables.items() if isinstance(table, dict)}
    beds = {dotted([key]): name for key, name in named.items() if isinstance(name, str | None)}
    walls = column.get("material")
    names = [dotted([name]) for name in materials]
    return list(unknown_materials(names, beds, walls if isinstance(walls, str) else None))
