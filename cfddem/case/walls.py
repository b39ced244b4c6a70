"""Walls of a case beside those of the column: planes, plates, cylinders, cones and surfaces from files, at rest or
moving."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from cfddem.backend.errors import InputError, shown
from cfddem.case.bed import NonNegative, Point, Positive
from cfddem.case.materials import Checked

OWN_KEYS: Mapping[str, tuple[str, ...]] = {
    "plane": ("normal",),
    "plate": ("edges",),
    "cylinder": ("axis", "radius", "length", "caps", "outside"),
    "cone": ("axis", "radius", "top_radius", "length"),
    "surface": ("file", "scale"),
}
"""Keys of each shape beside those of all walls."""

NEEDED: Mapping[str, tuple[str, ...]] = {
    "plane": (),
    "plate": ("edges",),
    "cylinder": ("radius",),
    "cone": ("top_radius", "length"),
    "surface": ("file",),
}

FORMATS = (".stl", ".ply", ".vtp")
"""Endings of surface files."""

COPIES = "surfaces"
"""Folder inside a run folder with copies of the surface files of the case."""

IN_PLACE = 1e-9
"""Relative difference below which directions are equal."""

ORIGIN = (0.0, 0.0, 0.0)


class CaseWall(Checked):
    """A wall inside the column: a plane, a plate, a cylinder, a cone, or a surface from a file; at rest or moving."""

    shape: Literal["plane", "plate", "cylinder", "cone", "surface"] = Field(description="shape of the wall")
    material: str | None = Field(None, description="material of the wall; default: that of the column")
    point: Point = Field(
        ORIGIN,
        description="a point of a plane, a corner of a plate, centre of the lower end of a cylinder or cone, or where "
        "the origin of a surface file lies [m]",
    )
    edges: tuple[Point, Point] | None = Field(
        None, description="two edges of a plate from its corner; particles touch it from both sides [m]"
    )
    normal: Point = Field((0.0, 0.0, 1.0), description="normal of a plane, to the side of the particles")
    axis: Point = Field((0.0, 0.0, 1.0), description="axis of a cylinder or cone, from its lower end")
    radius: NonNegative | None = Field(
        None, description="radius of a cylinder, or of the lower end of a cone, default 0 [m]"
    )
    top_radius: Positive | None = Field(None, description="radius of the upper end of a cone [m]")
    length: Positive | None = Field(
        None, description="length of a cylinder or cone along its axis; a cylinder without it has no end [m]"
    )
    caps: bool = Field(False, description="a cylinder has flat ends; without them particles touch it from both sides")
    outside: bool = Field(False, description="particles are outside of a cylinder that is closed or has no end")
    file: str | None = Field(
        None, description="STL, PLY or VTP file of a surface; its place is relative to the case file"
    )
    scale: Positive = Field(1.0, description="unit of length of the file [m]")
    velocity: Point = Field(ORIGIN, description="velocity of the wall [m/s]")
    spin: Point = Field(ORIGIN, description="angular velocity of the wall [rad/s]")
    centre: Point | None = Field(
        None, description="centre of the spin, moves with the wall; default: on the axis, or in the middle [m]"
    )
    amplitude: Point = Field(
        ORIGIN, description="amplitude of an oscillation: displacement amplitude x sin(2 pi frequency t) [m]"
    )
    frequency: NonNegative = Field(0.0, description="frequency of the oscillation [Hz]")
    begin: NonNegative = Field(0.0, description="time at which the motion begins [s]")
    end: Positive | None = Field(None, description="time at which the motion ends; default: the end of the run [s]")
    solid: Literal["inside", "outside", "thin", "none"] | None = Field(
        None,
        description="in a fluid: side of the wall whose cells are solid; thin: none, but no fluid passes through the "
        "wall; none: it does. Default: the side without particles, the inside of a surface, or thin for a plate",
    )

    @model_validator(mode="after")
    def _keys_suit_the_shape(self) -> CaseWall:
        self._require_keys_of(self.shape, OWN_KEYS, NEEDED)
        for name in ("normal", "axis"):
            if not math.hypot(*getattr(self, name)) > 0.0:
                raise InputError(name, getattr(self, name), "a direction other than zero")
        self._check_shape()
        self._check_motion()
        return self

    def _check_shape(self) -> None:
        if self.shape == "cylinder":
            if not self.radius:
                raise InputError("radius", self.radius, "above 0")
            if self.caps and self.length is None:
                raise InputError("caps", True, "false where no length is given")
            if self.outside and self.is_open:
                raise InputError("outside", True, "false for an open cylinder", "particles touch it from both sides")
        require_surface_file(self.file)
        if self.edges and not _norm(np.cross(*np.array(self.edges))) > IN_PLACE * _norm(self.edges[0]) * _norm(
            self.edges[1]
        ):
            raise InputError("edges", shown(self.edges), "two edges in different directions, in m")
        if self.shape == "plate" and self.solid in ("inside", "outside"):
            raise InputError("solid", self.solid, "thin, none, or left out", "a plate has no inside")
        sided = not self.has_triangles and not self.is_open
        if self.solid in ("inside", "outside", "thin") and sided:
            raise InputError("solid", self.solid, "none, or left out", "the side without particles is solid")

    def _check_motion(self) -> None:
        oscillates, spins = any(self.amplitude), any(self.spin)
        if oscillates != (self.frequency > 0.0):
            name, other = ("frequency", "amplitude") if oscillates else ("amplitude", "frequency")
            raise InputError(name, getattr(self, name), f"other than 0 where {other} is given")
        if oscillates and any(self.velocity):
            raise InputError("amplitude", self.amplitude, "left out where velocity is given")
        if self.end is not None and self.end <= self.begin:
            raise InputError("end", self.end, f"after the beginning of the motion, {self.begin:g} s")
        if (self.begin or self.end) and not self.moves:
            raise InputError("begin", self.begin, "left out for a wall at rest", "give velocity, spin or amplitude")
        if self.centre is not None and not spins:
            raise InputError("centre", self.centre, "left out where there is no spin")
        if self.shape == "plane" and not _parallel(self.spin, self.normal):
            raise InputError("spin", self.spin, "along the normal of a plane", "use a surface for a plate that tilts")
        if self.shape == "cylinder" and self.length is None and not self._spins_in_place:
            raise InputError("spin", self.spin, "about the axis of a cylinder without end", "give a length")

    @property
    def has_triangles(self) -> bool:
        """Whether the wall is made of triangles: a surface from a file, or a plate."""
        return self.shape in ("surface", "plate")

    @property
    def radii(self) -> tuple[float, float]:
        """Radii of the lower and upper end of a cylinder or cone [m]."""
        own = self.radius or 0.0
        return own, self.top_radius or own

    @property
    def is_open(self) -> bool:
        """Whether particles touch the wall from both sides, and it has no inside."""
        return self.shape == "cone" or (self.shape == "cylinder" and self.length is not None and not self.caps)

    @property
    def is_thin(self) -> bool:
        """Whether a fluid is on both sides of the wall, and does not pass through it."""
        return self.solid == "thin" or (self.shape == "plate" and self.solid is None)

    @property
    def moves(self) -> bool:
        """Whether the surface has a velocity at some time."""
        return any(self.velocity) or any(self.spin) or any(self.amplitude)

    @property
    def has_schedule(self) -> bool:
        """Whether the velocity changes in time."""
        return self.begin > 0.0 or self.end is not None or any(self.amplitude)

    @property
    def swing(self) -> np.ndarray:
        """Largest velocity of the oscillation (3,) [m/s]."""
        return 2.0 * math.pi * self.frequency * np.array(self.amplitude)

    @property
    def leaves_its_place(self) -> bool:
        """Whether the wall sweeps through space; one that moves along itself does not."""
        drift = np.array(self.velocity) + self.swing
        if self.shape == "plane":
            return not abs(float(drift @ np.array(self.normal))) <= IN_PLACE * _norm(drift) * _norm(self.normal)
        if self.shape == "cylinder" and self.length is None:
            return not _parallel(drift, self.axis)
        if self.has_triangles:
            return self.moves
        return bool(drift.any()) or not self._spins_in_place

    @property
    def _spins_in_place(self) -> bool:
        """Whether a spin leaves a surface of revolution unchanged."""
        arm = np.subtract(self.point if self.centre is None else self.centre, self.point)
        return not any(self.spin) or (_parallel(self.spin, self.axis) and _parallel(arm, self.axis))

    @property
    def fastest(self) -> float:
        """Bound of the speed of the surface; NaN for the spin of a surface from a file, which is not read [m/s]."""
        turning = 0.0
        if any(self.spin):
            arm = np.subtract(self.point if self.centre is None else self.centre, self.point)
            reach = max(self.radii) + (self.length or 0.0) * (not self._spins_in_place)
            across = _norm(arm) * (not self._spins_in_place)
            turning = _norm(self.spin) * (reach + across) if self.shape in ("cylinder", "cone") else math.nan
            turning = 0.0 if self.shape == "plane" else turning
        return _norm(self.velocity) + _norm(self.swing) + turning


def _norm(vector: Sequence[float] | np.ndarray) -> float:
    return math.hypot(*vector)


def _parallel(one: Sequence[float] | np.ndarray, other: Sequence[float] | np.ndarray) -> bool:
    """Whether two vectors have the same axis; a vector of length 0 has any."""
    across = _norm(np.cross(np.array(one, float), np.array(other, float)))
    return across <= IN_PLACE * _norm(one) * _norm(other)


# ---------------------------------------------------------------- surface files


def require_surface_file(file: str | None) -> None:
    """Raise InputError for a file whose ending is not that of a surface."""
    if file is not None and Path(file).suffix.lower() not in FORMATS:
        raise InputError("file", file, "a surface file, *.stl, *.ply or *.vtp")


def copy_of(folder: Path, name: str, file: str) -> Path:
    """Copy of a surface file in a run folder, by the name of its wall, "wall_0" or "vessel"."""
    return folder / COPIES / f"{name}{Path(file).suffix.lower()}"


def walls_in(walls: Sequence[CaseWall], folder: Path) -> tuple[CaseWall, ...]:
    """Walls with the places of their surface files; a run folder has copies, other paths are relative to it.

    folder  of the case file
    """
    is_run = (folder / "run.json").is_file()

    def place(number: int, file: str) -> str:
        return place_of(file, folder, f"wall_{number}", f"wall.{number}.file", is_run)

    return with_surfaces(walls, place)


def place_of(file: str, folder: Path, name: str, key: str, is_run: bool) -> str:
    """The place of a surface file of a case: its copy in a run folder, or relative to the folder of the case.

    name, key  of the copy, see `copy_of`, and of the file in the case
    is_run     whether the folder is that of a run
    """
    return str(kept(folder, copy_of(folder, name, file), key, file)) if is_run else os.path.abspath(folder / file)


def kept(folder: Path, copy: Path, key: str, file: str) -> Path:
    """The copy of a file in a run folder.

    key, file  of the case, in errors
    errors     InputError if the copy is missing, or is a link to a file outside of the folder
    """
    if copy.is_file() and Path(os.path.realpath(copy)).is_relative_to(os.path.realpath(folder)):
        return copy.absolute()
    raise InputError(key, file, f"a file in the run folder, {copy}", "files outside of it are not read; copy it there")


def with_surfaces(walls: Sequence[CaseWall], place: Callable[[int, str], str]) -> tuple[CaseWall, ...]:
    """Walls with other surface files, each from the number of the wall and the file that it has now."""
    return tuple(
        wall if wall.file is None else wall.model_copy(update={"file": place(n, wall.file)})
        for n, wall in enumerate(walls)
    )
