"""Commands that compare with published results and with other codes."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from cfddem.backend.errors import InputError, nearest
from cfddem.backend.tables import table
from cfddem.cli.json_output import print_json
from scenarios.validation.targets import ONLY_IF_NAMED, PIECEMEAL, TARGETS, measure
from scenarios.validation.targets import validate as run


def validate(
    target: Annotated[
        str,
        Parameter(help=f"{', '.join(TARGETS)} or all; all leaves out {', '.join(ONLY_IF_NAMED)}, which can take a day"),
    ] = "all",
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], help="folder for figures, tables and histories")] = Path(
        "results/validation"
    ),
    data: Annotated[
        list[Path] | None, Parameter(help="CSV file of measured points; for binary-collision", negative="")
    ] = None,
    hours: Annotated[
        float | None,
        Parameter(
            help=f"of {', '.join(PIECEMEAL)}: begin no further piece after this time; the next call does the rest"
        ),
    ] = None,
    json: Annotated[bool, Parameter(help="print the table as JSON", negative="")] = False,
) -> None:
    """Reproduce published results and compare; exits 1 if a limit is exceeded.

    Example: cfddem validate binary-collision
    """
    if not json:
        from cfddem.backend.compile import announce_compilation  # loads the compiler

        announce_compilation()
    if target != "all" and target not in TARGETS:
        raise InputError("target", target, nearest(target, [*TARGETS, "all"]))
    if data and target != "binary-collision":
        raise InputError("--data", target, "used with binary-collision", "cfddem report --data takes data of a run")
    if hours is not None and target not in PIECEMEAL:
        raise InputError("--hours", hours, f"used with {', '.join(PIECEMEAL)}")
    if hours is not None and not hours >= 0.0:
        raise InputError("--hours", hours, "at least 0")
    names = [name for name in TARGETS if name not in ONLY_IF_NAMED] if target == "all" else [target]
    if json:
        targets = [measure(name, output, data or (), hours) for name in names]
        verdicts = [target["holds"] for target in targets]
        print_json("validate", {"holds": all(verdicts), "targets": targets})
    else:
        verdicts = [run(name, output, data or (), hours) for name in names]  # every target runs, even after a failure
    if not all(verdicts):
        sys.exit(1)


def bench(
    target: Annotated[str, Parameter(help="dem, fluid, bed, scaling, or all")] = "dem",
    *,
    particles: Annotated[int, Parameter(help="of dem: 1000, 10000, 100000 or 1000000")] = 10_000,
    threads: Annotated[int, Parameter(help="of each code")] = 1,
    film: Annotated[bool, Parameter(help="dem with the film of water", negative="")] = False,
    films: Annotated[Literal["full"] | None, Parameter(help="with films that resist sliding and rolling, too")] = None,
    bridges: Annotated[
        bool,
        Parameter(
            help="dem with a liquid bridge on every contact; bed: a wet bed beside the same bed dry", negative=""
        ),
    ] = False,
    gpu: Annotated[bool, Parameter(help="dem with its steps on a graphics processor", negative="")] = False,
    json: Annotated[bool, Parameter(help="print the result as JSON", negative="")] = False,
) -> None:
    """Measure the speed of this machine: a dense bed of spheres (dem), boxes of fluid (fluid), a gas bed (bed).

    "scaling" shows how cost grows with particles, cells, sizes, the reach of films, and threads if given.
    Each is compared with the memory speed of the machine, and with other codes where they are installed or published.

    Example: cfddem bench dem --particles 10000
    """
    if not json:
        from cfddem.backend.compile import announce_compilation  # loads the compiler

        announce_compilation()
    from scenarios.beds.gas_bed import study as gas_bed
    from scenarios.beds.wet_bed import study as wet_bed
    from scenarios.benchmarks import dense_bed, fluid_box, scaling
    from scenarios.benchmarks import table as all_benchmarks

    bed = wet_bed if bridges else gas_bed

    targets = {
        "dem": (
            lambda: dense_bed.bench(particles, threads, film, bridges, full=films == "full", gpu=gpu),
            dense_bed.rows,
        ),
        "fluid": (lambda: fluid_box.bench(threads), fluid_box.rows),
        "bed": (lambda: bed.bench(threads), bed.rows),
        "scaling": (lambda: scaling.bench(threads), scaling.rows),
        "all": (lambda: all_benchmarks.bench(threads), all_benchmarks.rows),
    }
    if target not in targets:
        raise InputError("target", target, nearest(target, list(targets)))
    if gpu and target != "dem":
        raise InputError("--gpu", target, "used with the target dem")
    timed, rows = targets[target]
    result = timed()
    if json:
        print_json("bench", {"target": target, "result": result})
    else:
        print("\n".join(table(rows(result), widths=(20,), gap=2)))
