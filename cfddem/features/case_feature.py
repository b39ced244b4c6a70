"""Equipment that a case can have: when it has it, and the columns of the history that it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple

from cfddem.case.schema import Case
from cfddem.fluid.fields import CellField
from cfddem.io.quantities import Quantity
from cfddem.model.feature import Equipment
from cfddem.model.fields import Field


class Measured(NamedTuple):
    """A column of the history: a number for the present state of a feature."""

    name: str
    unit: str  # SI, `1` for a plain number
    group: str  # how the report shows it: "measure", "imbalance" or "recorded"
    meaning: str
    value: Callable[[Any, Any], float]  # of the feature and the simulation
    when: Callable[[Any], bool] = lambda case: True  # whether the history of a case has it


class CaseFeature(Equipment):
    """Equipment that a case can have.

    table       of the case that turns it on
    measures    columns of the history that it can give
    case        that has it
    simulation  of the case; particles and solvers are ready, and in their state at the start
    """

    table: ClassVar[str] = ""
    measures: ClassVar[tuple[Measured, ...]] = ()

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
    def columns(cls, case: Case) -> Mapping[str, Quantity]:
        """Columns of the history that it gives, by name."""
        return {
            measure.name: Quantity(measure.unit, measure.meaning, measure.group)
            for measure in cls.measures
            if measure.when(case)
        }

    def values(self, simulation: Any) -> Mapping[str, float]:
        """Numbers for its columns."""
        shown = (measure for measure in self.measures if measure.when(simulation.case))
        return {measure.name: float(measure.value(self, simulation)) for measure in shown}
