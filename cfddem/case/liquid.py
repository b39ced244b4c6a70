"""The liquid on the particles of a case, its bridges, and the spray that brings more of it."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from cfddem.backend.errors import InputError
from cfddem.case.bed import NonNegative, Point, Positive
from cfddem.case.materials import Checked
from closures.liquid_film import film_volume

Share = Annotated[float, Field(ge=0, le=1)]

AMOUNTS = ("thickness", "volume_per_particle", "liquid_fraction")
"""Keys that give the liquid on a particle at the start."""

SAME_VISCOSITY = 0.01
"""A liquid fluid whose viscosity is that of the liquid within this is the same liquid [-]."""

ROUND_OFF = 1e-9
"""Share of the size of the column by which a spray zone may leave it: a corner and an edge need not sum exactly [-]."""

LAWS = {
    "pull": ("willett", "rabinovich", "lambert", "pendular", "constant", "none"),
    "film": ("pitois", "deforming", "static", "none"),
    "tangential": ("davis", "nase", "none"),
    "rupture": ("capillary", "lian", "willett", "film"),
    "redistribution": ("half", "radius", "contact_angle"),
}
"""Built-in laws of bridges by their keys, the default first; users register others."""


def _law(key: str, meaning: str) -> Any:
    """The field of a law of bridges."""
    words = ", ".join(f"'{word}'" for word in LAWS[key])
    return Field(LAWS[key][0], description=f"{meaning}; one of {words}", json_schema_extra={"examples": [*LAWS[key]]})


class Bond(Checked):
    """Solid bond that a bridge between particles leaves when it dries; without this table the bridge breaks."""

    solid_fraction: float = Field(
        gt=0, lt=1, description="volume of solids in a new bridge over that of its liquid; they make the bond [-]"
    )
    youngs_modulus: Positive = Field(description="Young's modulus of the bond [Pa]")
    tensile_strength: Positive = Field(description="tensile stress at which the bond breaks [Pa]")
    shear_strength: Positive | None = Field(
        None, description="shear stress at which it breaks; default: as the tensile strength [Pa]"
    )
    shear_ratio: Positive = Field(0.4, description="stiffness across the line of centres over that along it [-]")
    damping: float = Field(0.1, ge=0, lt=1, description="damping of the bond, over critical [-]")


class Liquid(Checked):
    """Liquid on the particles: it forms bridges between particles and at walls."""

    viscosity: NonNegative = Field(description="dynamic viscosity of the liquid [Pa s]")
    surface_tension: NonNegative = Field(description="surface tension [N/m]")
    contact_angle: float = Field(0.0, ge=0, le=180, description="contact angle on the solids [degrees]")
    thickness: NonNegative | None = Field(None, description="thickness of the liquid film on a wet particle [m]")
    volume_per_particle: NonNegative | None = Field(
        None, description="volume of liquid on a wet particle, instead of a thickness [m3]"
    )
    liquid_fraction: NonNegative | None = Field(
        None, description="volume of liquid on a wet particle over its own volume, instead of a thickness [-]"
    )
    share_of_wet_particles: Share = Field(1.0, description="share of the particles that are wet at the start [-]")
    pull: str = _law("pull", "capillary force of a bridge")
    film: str = _law(
        "film",
        "viscous resistance of a bridge along the line of centres, by its volume (pitois) or by the thickness of the "
        "films",
    )
    tangential: str = _law("tangential", "resistance of a bridge to sliding")
    cut: Literal["constant", "zero"] = Field(
        "constant", description="resistance below the minimum gap: as at the minimum gap, or none"
    )
    film_density: NonNegative = Field(
        0.0,
        description="density of the liquid; if above 0, the added mass of the film is reversed with the bodies at "
        "contact; 0: films have no inertia [kg/m3]",
    )
    rupture: str = _law(
        "rupture",
        "gap at which a bridge breaks: by volume and speed of separation, by volume (Lian, Willett), or where the "
        "films part",
    )
    redistribution: str = _law(
        "redistribution",
        "how the liquid of a broken bridge is shared: equally, by the radii, or by the contact angles of particle and "
        "wall (equally between particles)",
    )
    wall_contact_angle: float | None = Field(
        None, ge=0, le=180, description="contact angle on the walls, for redistribution by contact_angle [degrees]"
    )
    minimum_gap: Positive | None = Field(
        None, description="smallest gap of the film; default: from the roughness of the materials [m]"
    )

    wall_share: Share = Field(
        0.0,
        description="share of the liquid on a wall below a particle, of its projected area, that flows into a new "
        "bridge; 0: walls take no liquid [-]",
    )
    wall_thickness: NonNegative = Field(0.0, description="thickness of the liquid on the walls at the start [m]")

    bond: Bond | None = Field(None, description="solid bonds that dry bridges leave; needs [evaporation]")

    @field_validator(*LAWS)
    @classmethod
    def _laws_exist(cls, value: str, about: ValidationInfo) -> str:
        """A finished run may have used a law that this machine does not have."""
        if value not in LAWS[about.field_name or ""] and not (about.context or {}).get("finished"):
            from cfddem.particles.interactions.bridge_law import require_bridge_law  # takes the compiler along

            require_bridge_law(about.field_name or "", value)
        return value

    @model_validator(mode="after")
    def _at_most_one_amount(self) -> Liquid:
        amounts = [name for name in AMOUNTS if getattr(self, name) is not None]
        if len(amounts) > 1:
            raise InputError(amounts[1], getattr(self, amounts[1]), f"left out where {amounts[0]} is given")
        if self.wall_thickness > 0.0 and self.wall_share == 0.0:
            raise InputError("wall_share", 0.0, "above 0 where wall_thickness is given")
        if self.film_density > 0.0 and self.film == "none":
            raise InputError("film_density", self.film_density, "0 where film is none")
        by_angle = self.redistribution == "contact_angle"
        if by_angle and self.wall_share == 0.0:
            raise InputError(
                "redistribution", "contact_angle", "used with wall_share above 0",
                "it acts at walls that take liquid; between particles it is the same as half",
            )  # fmt: skip
        if self.wall_contact_angle is not None and not by_angle:
            without = 'left out without redistribution = "contact_angle"'
            raise InputError("wall_contact_angle", self.wall_contact_angle, without)
        if self.volume_per_particle is not None and self.volume_per_particle >= 1e-3:
            raise InputError("volume_per_particle", self.volume_per_particle, "below 1e-3 m3", "volumes are in m3")
        return self

    def refuse(self, case: Any) -> None:
        """Raise InputError where the liquid does not go with the rest of a case."""
        if case.spray is None and all(getattr(self, name) is None for name in AMOUNTS):
            limit = f"given, or {' or '.join(AMOUNTS[1:])}"
            raise InputError("liquid.thickness", None, limit, "only a case with [spray] may begin dry")
        around = case.around.viscosity
        if case.in_liquid and abs(around - self.viscosity) <= SAME_VISCOSITY * max(around, self.viscosity):
            raise InputError(
                "liquid.viscosity", self.viscosity, f"other than that of the fluid, {around:g} Pa s",
                "particles in a liquid have no bridges of the same liquid; leave out [liquid]",
            )  # fmt: skip
        if self.bond and not getattr(case, "evaporation", None):
            raise InputError("liquid.bond", None, "left out without [evaporation]", "bridges leave bonds as they dry")

    def volume_on(self, radius: np.ndarray) -> np.ndarray:
        """Volume of liquid on wet particles (N,) [m3].

        radius  (N,) [m]
        """
        if self.volume_per_particle is not None:
            return np.full(np.shape(radius), self.volume_per_particle)
        sphere = 4.0 / 3.0 * np.pi * np.asarray(radius) ** 3
        if self.liquid_fraction is not None:
            return np.asarray(self.liquid_fraction * sphere)
        return np.asarray(film_volume(radius, self.thickness or 0.0))  # type: ignore[arg-type]  # of every sphere


_ZONES = {"cone": ("nozzle", "length"), "box": ("corner", "size")}
"""Keys of each shape of a spray zone."""


class Spray(Checked):
    """A zone where drops of the liquid land on the particles."""

    rate: NonNegative = Field(description="volume of liquid sprayed per time [m3/s]")
    drop_volume: Positive = Field(description="volume of a drop [m3]")
    begin: NonNegative = Field(0.0, description="time at which the spray begins [s]")
    end: Positive | None = Field(None, description="time at which it ends; default: the end of the run [s]")
    zone: Literal["cone", "box"] = Field("cone", description="shape of the spray zone")
    nozzle: Point | None = Field(None, description="tip of a cone [m]")
    direction: Point = Field((0.0, 0.0, -1.0), description="axis of a cone, away from the nozzle")
    angle: float = Field(40.0, gt=0, lt=180, description="full opening angle of a cone [degrees]")
    length: Positive | None = Field(None, description="length of a cone along its axis [m]")
    corner: Point | None = Field(None, description="lower corner of a box [m]")
    size: tuple[Positive, Positive, Positive] | None = Field(None, description="edges of a box [m]")

    @model_validator(mode="after")
    def _zone_is_complete(self) -> Spray:
        for name in _ZONES[self.zone]:
            if getattr(self, name) is None:
                raise InputError(name, None, f'given for zone = "{self.zone}"')
        for name in _ZONES["box" if self.zone == "cone" else "cone"]:
            if getattr(self, name) is not None:
                raise InputError(name, getattr(self, name), f'left out for zone = "{self.zone}"')
        if not math.hypot(*self.direction) > 0.0:
            raise InputError("direction", self.direction, "a vector other than zero")
        if self.end is not None and self.end <= self.begin:
            raise InputError("end", self.end, f"after the beginning, {self.begin:g} s")
        return self

    @property
    def axis(self) -> np.ndarray:
        """Unit vector along the axis of a cone (3,)."""
        return np.array(self.direction) / math.hypot(*self.direction)

    @property
    def extremes(self) -> np.ndarray:
        """Two points that must lie in the column: tip and end of a cone's axis, or corners of a box (2, 3) [m]."""
        if self.zone == "cone":
            tip = np.array(self.nozzle)
            return np.array([tip, tip + (self.length or 0.0) * self.axis])
        corner = np.array(self.corner)
        return np.array([corner, corner + np.array(self.size)])

    def refuse(self, case: Any) -> None:
        """Raise InputError where there is no liquid, or the zone is outside the column."""
        if case.liquid is None:
            raise InputError("spray", None, "left out where there is no liquid", "give the table [liquid]")
        size = case.column.size
        margin = ROUND_OFF * max(size)
        for name, place in zip(_ZONES[self.zone], self.extremes):
            inside = all(-margin <= coordinate <= length + margin for coordinate, length in zip(place.tolist(), size))
            if case.column.shape == "cylinder":
                inside &= math.hypot(place[0] - 0.5 * size[0], place[1] - 0.5 * size[0]) <= 0.5 * size[0] + margin
            if not inside:
                where = ", ".join(f"{coordinate:.4g}" for coordinate in place)
                column = ", ".join(f"{length:g}" for length in size)
                limit = f"chosen so that the spray zone lies in the column, 0 to {column} m"
                raise InputError(f"spray.{name}", None, limit, f"it reaches to ({where}) m")
