"""Equipment that a case can have: when it has it, and the columns of the history that it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple

from cfddem.case.schema import Case
from cfddem.data.fields import Field
from cfddem.fluid.fields import CellField
from cfddem.io.quantities import Quantity, of_function
from cfddem.model.feature import Equipment


class Measured(NamedTuple):
    """A column of the history: a number for the present state of a simulation."""

    unit: str  # SI, `1` for a plain number
    group: str  # how the report shows it: "measure", "imbalance" or "recorded"
    function: Callable[[Any], float]  # of a simulation; its name is that of the column


class CaseFeature(Equipment):
    """Equipment that a case can have.

    table       of the case that turns it on
    case        that has it
    simulation  of the case; particles and solvers are ready, and in their state at the start
    """

    table: ClassVar[str] = ""

    def __init__(self, case: Case, simulation: Any) -> None:
        """Prepare what acts in every step."""

    @classmethod
    def is_in(cls, case: Case) -> bool:
        """Whether a case has it."""
        return bool(getattr(case, cls.table or "_", None))  # a case may be older than the table

    @classmethod
    def fields_of(cls, case: Case) -> tuple[Field, ...]:
        """Fields of the particles that it needs in a case."""
        return cls.fields

    @classmethod
    def cell_fields_of(cls, case: Case) -> tuple[CellField, ...]:
        """Fields of the cells that it adds to snapshots of a case, see `cells_for_snapshot`."""
        return ()

    @classmethod
    def measures(cls, case: Case) -> tuple[Measured, ...]:
        """What it measures in a case."""
        return ()

    @classmethod
    def columns(cls, case: Case) -> Mapping[str, Quantity]:
        """Columns of the history that it gives, by name."""
        return {
            each.function.__name__: of_function(each.function, each.unit, each.group) for each in cls.measures(case)
        }

    def values(self, simulation: Any) -> Mapping[str, float]:
        """Numbers for its columns."""
        return {each.function.__name__: float(each.function(simulation)) for each in self.measures(simulation.case)}
