"""Walls of a case beside those of the column, at rest or moving, and their files."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import MISSING, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, model_validator
from pydantic.fields import FieldInfo

from cfddem.backend.errors import InputError
from cfddem.case.bed import NonNegative, Point, Positive
from cfddem.case.feature_table import rebuild_cases
from cfddem.case.materials import Checked
from cfddem.model.triangles import Array
from cfddem.particles.walls.meshes import Plate, Surface
from cfddem.particles.walls.shapes import Cone, Cylinder, Plane
from cfddem.particles.walls.wall import Wall

if TYPE_CHECKING:
    from cfddem.particles.walls.motion import Motion

COPIES = "surfaces"
"""Folder inside a run folder with copies of the surface files of the case."""


ORIGIN = (0.0, 0.0, 0.0)

FORMATS = (".stl", ".ply", ".vtp")
"""Endings of surface files."""


def _of_a_surface(file: str) -> str:
    if Path(file).suffix.lower() not in FORMATS:
        raise InputError("file", file, "a surface file, *.stl, *.ply or *.vtp")
    return file


SurfaceFile = Annotated[str, AfterValidator(_of_a_surface)]

SHAPES: dict[str, type[Wall]] = {
    "plane": Plane,
    "plate": Plate,
    "cylinder": Cylinder,
    "cone": Cone,
    "surface": Surface,
}
"""Shapes by their names in a case. Their fields are the keys of a case; those without a default are needed."""


def _keys_of(kind: type[Wall]) -> dict[str, bool]:
    """Keys of a shape beside those of all walls, and whether it needs them."""
    own = (field for field in fields(kind) if field.name not in Wall.__dataclass_fields__)
    return {field.name: field.default is MISSING for field in own}


class CaseWall(Checked):
    """A wall inside the column, of a shape of `SHAPES`; at rest or moving. It has the keys of all shapes."""

    shape: str = Field(description="shape of the wall")
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
    file: SurfaceFile | None = Field(
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

    if TYPE_CHECKING:

        def __getattr__(self, key: str) -> Any: ...  # keys of a user's shape

    @model_validator(mode="after")
    def _keys_suit_the_shape(self) -> CaseWall:
        own = {name: list(_keys_of(kind)) for name, kind in SHAPES.items()}
        needed = {
            name: [key for key, is_needed in _keys_of(kind).items() if is_needed] for name, kind in SHAPES.items()
        }
        self._require_keys_of(self.shape, own, needed)
        side = self.form.side
        if self.solid is not None and self.solid not in side.allowed:
            raise InputError("solid", self.solid, f"{', '.join(side.allowed)}, or left out", side.why)
        self._check_motion()
        return self

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

    @property
    def form(self) -> Wall:
        """The wall at the start, with the keys of its shape and its largest velocity."""
        kind = SHAPES[self.shape]
        own = {key: value for key in _keys_of(kind) if (value := getattr(self, key)) is not None}
        velocity: Any = tuple((np.array(self.velocity) + self.swing).tolist())
        return kind(velocity=velocity, spin=self.spin, centre=self.centre, **own)

    @property
    def side(self) -> str | None:
        """The side that is solid to a fluid: that of the case, or of the shape."""
        return self.solid or self.form.side.default

    @property
    def is_thin(self) -> bool:
        """Whether a fluid is on both sides of the wall, and does not pass through it."""
        return self.side == "thin"

    def closes(self, points: Array) -> NDArray[np.bool_]:
        """Which points (N, 3) [m] it closes to the fluid (N,)."""
        if self.side in ("none", "thin"):
            return np.zeros(len(points), bool)
        return self.form.closes(points, self.solid)

    @property
    def moves(self) -> bool:
        """Whether the surface has a velocity at some time."""
        return any(self.velocity) or any(self.spin) or any(self.amplitude)

    @property
    def has_schedule(self) -> bool:
        """Whether the velocity changes in time."""
        return self.begin > 0.0 or self.end is not None or any(self.amplitude)

    @property
    def swing(self) -> Array:
        """Largest velocity of the oscillation (3,) [m/s]."""
        return 2.0 * math.pi * self.frequency * np.array(self.amplitude)

    @property
    def leaves_its_place(self) -> bool:
        """Whether the wall sweeps through space; one that moves along itself does not."""
        return not self.form.stays

    @property
    def fastest(self) -> float:
        """Bound of the speed of the surface; NaN for the spin of a surface from a file, which is not read [m/s]."""
        return math.hypot(*self.velocity) + math.hypot(*self.swing) + self.form.speed_of_spin()

    def motion(self, number: int = 0) -> Motion:
        """Its motion, as of a wall of this number of a particle solver."""
        from cfddem.particles.walls.motion import Motion  # loads the compiler, which checks lack

        end = math.inf if self.end is None else self.end
        return Motion(number, self.velocity, self.spin, self.amplitude, self.frequency, self.begin, end)

    def particle_wall(self, material: int, key: str) -> Wall:
        """The wall that particles touch.

        material  row of the pair table
        key       of the wall in the case, for errors
        """
        try:
            return replace(self.form, material=material).for_particles()
        except InputError as failure:
            raise InputError(f"{key}.{failure.field}", failure.value, failure.limit, failure.remedy) from None


OF_EVERY_CASE = frozenset(CaseWall.model_fields)
"""Keys that no shape of a user brings."""


def register(name: str, kind: type[Wall], **keys: Any) -> None:
    """Let cases have a shape of a user by its name, as `shape = "ring"`.

    name  in cases
    kind  class of the wall, whose fields are keys of the case
    keys  type and description of those that no other shape has: `Annotated[float, Field(gt=0, description="... [m]")]`

    errors  InputError for a name that another class has, a key of the class that is not described, and a key that is
            no field of the class or belongs to another shape; nothing is registered then
    """
    _refuse_misfits(name, kind, keys)
    SHAPES[name] = kind
    for key, annotation in keys.items():
        description = FieldInfo.from_annotation(annotation).description
        CaseWall.__pydantic_fields__[key] = FieldInfo(
            annotation=annotation | None, default=None, description=description
        )
        CaseWall.__annotations__[key] = annotation | None
    _declare()


def _refuse_misfits(name: str, kind: type[Wall], keys: dict[str, Any]) -> None:
    """Refuse what `register` cannot take. A class that is defined again, as in a notebook, may replace itself."""
    before = SHAPES.get(name, kind)
    if (before.__module__, before.__qualname__) != (kind.__module__, kind.__qualname__):
        raise InputError(
            "shape", name, f"a name that no other shape has, beside {', '.join(SHAPES)}", "take another one"
        )
    own, others = _keys_of(kind), {key for shape in SHAPES if shape != name for key in _keys_of(SHAPES[shape])}
    general = OF_EVERY_CASE - {key for shape in SHAPES.values() for key in _keys_of(shape)}
    for key in sorted({*own} & general):
        raise InputError(f"shape.{name}.{key}", None, "of another name", "a case has a key of this name for every wall")
    for key in sorted({*own} - {*keys} - OF_EVERY_CASE - others):
        remedy = f'add {key}=Annotated[float, Field(description="... [m]")]'
        raise InputError(f"shape.{name}.{key}", None, "described in register", remedy)
    for key, annotation in keys.items():
        if key not in own:
            raise InputError(f"shape.{name}.{key}", None, f"a field of {kind.__name__}, {', '.join(own)}")
        if key in OF_EVERY_CASE | others:
            raise InputError(f"shape.{name}.{key}", None, "left out of register", "other shapes have this key already")
        if not FieldInfo.from_annotation(annotation).description:
            remedy = 'give it as Annotated[float, Field(description="... [m]")]'
            raise InputError(f"shape.{name}.{key}", None, "described in register", remedy)


def forget_shape(name: str) -> None:
    """Remove a user's shape from all cases; its keys stay, without a shape."""
    del SHAPES[name]
    _declare()


def _declare() -> None:
    """Let the schema of a case know the shapes."""
    named: Any = Literal.__getitem__(tuple(SHAPES))  # type: ignore[attr-defined]
    description = CaseWall.model_fields["shape"].description
    CaseWall.__annotations__["shape"] = named
    CaseWall.__pydantic_fields__["shape"] = FieldInfo(annotation=named, description=description)
    CaseWall.model_rebuild(force=True)
    rebuild_cases()


_declare()


# ---------------------------------------------------------------- surface files


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
