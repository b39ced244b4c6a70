"""The runs of a sweep as a pandas table, with units."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from cfddem.backend.errors import InputError
from cfddem.backend.optional import library
from cfddem.case.input_errors import field_of
from cfddem.case.schema import Case

if TYPE_CHECKING:
    import pandas


def open_sweep(folder: str | Path) -> pandas.DataFrame:
    """The runs of a sweep as a table: one row for each run, by its name.

    A measure is a column with its mean, followed by `NAME_error` with the standard error. Values that a run does not
    have, and errors that are not known, are NaN. `attrs["units"]` has the unit of each column.

    folder   of the sweep, which holds `sweep.csv`
    returns  keys that were changed, status, measures, message
    errors   InputError if there is no table, or pandas is not installed
    """
    pandas = library("pandas", "open_sweep", "data")
    path = Path(folder) / "sweep.csv"
    if not path.is_file():
        remedy = "`cfddem sweep` writes it when the runs have ended; the same command goes on with a sweep"
        raise InputError("folder", str(folder), "a folder with sweep.csv", remedy)
    try:
        table = pandas.read_csv(path, index_col="run", encoding="utf-8")
    except (ValueError, OSError) as failure:  # of pandas: a table without its columns, or no text
        first = str(failure).splitlines()[0]
        raise InputError("folder", str(folder), "a folder with a table of runs in sweep.csv", first) from None
    units: dict[str, str] = {}
    names: dict[str, str] = {}
    for heading in table.columns:
        if found := re.fullmatch(r"(.+?) \[(.*)\]", heading):
            names[heading] = found[1]
            units |= {found[1]: found[2], f"{found[1]}_error": found[2]}
        elif heading.endswith(" error"):
            names[heading] = f"{heading.removesuffix(' error')}_error"
        elif found := re.search(r"\[([^\[\]]*)\]$", field_of(Case, heading.split(".")) or ""):
            units[heading] = found[1]
    table = table.rename(columns=names)
    table.attrs["units"] = {name: units[name] for name in table.columns if name in units}
    return table  # type: ignore[no-any-return]
