"""The command line: the roof, and the one file of cfddem that reaches the scenarios."""

from __future__ import annotations

import json as _json
import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, CycloptsError, Parameter

from cfddem import __version__
from cfddem.errors import CfddemError, InputError, nearest

app = App(
    name="cfddem",
    version=__version__,
    help="Spheres in a fluid, with the thin film between them. All numbers are in SI units.",
    help_flags=["--help", "-h"],
)


@app.command
def collide(
    *,
    material: Annotated[str, Parameter(help="steel_smooth, steel_rough, glass or delrin")] = "delrin",
    target: Annotated[str | None, Parameter(help="material of the target or wall; the same if not given")] = None,
    diameter: Annotated[float, Parameter(help="of the striker [m]")] = 12.7e-3,
    target_diameter: Annotated[float | None, Parameter(help="of the target; the same if not given [m]")] = None,
    velocity: Annotated[float | None, Parameter(help="normal approach speed at h_co [m/s]")] = None,
    viscosity: Annotated[float | None, Parameter(help="of the fluid; 0 for a dry collision [Pa s]")] = None,
    stokes: Annotated[float | None, Parameter(help="of the normal approach; give two of the three")] = None,
    angle: Annotated[float, Parameter(help="between velocity and line of centres [deg]")] = 0.0,
    against: Annotated[str, Parameter(help="sphere or wall")] = "sphere",
    trajectory: Annotated[str, Parameter(help="frozen or full")] = "frozen",
    spin: Annotated[float, Parameter(help="of the striker before [rad/s]")] = 0.0,
    integrator: Annotated[str, Parameter(help="drift or verlet")] = "drift",
    friction_onset: Annotated[str, Parameter(help="film or overlap")] = "film",
    step_fraction: Annotated[float | None, Parameter(help="time step over the Hertz time")] = None,
    json: Annotated[bool, Parameter(help="print the result as JSON", negative="")] = False,
) -> None:
    """Let two spheres, or a sphere and a wall, collide in a fluid.

    Example: cfddem collide --material delrin --stokes 30 --velocity 0.1
    """
    _tell_of_compilation()
    from scenarios.binary_collision import MATERIALS
    from scenarios.binary_collision import collide as run

    for name in (material, target):
        if name is not None and name not in MATERIALS:
            raise InputError("material", name, nearest(name, MATERIALS))
    result = run(
        (MATERIALS[material], MATERIALS[target or material]),
        diameter=(diameter, diameter if target_diameter is None else target_diameter),
        velocity=velocity,
        viscosity=viscosity,
        stokes=stokes,
        angle=angle,
        against=against,
        trajectory=trajectory,
        spin=(spin, 0.0),
        integrator=integrator,
        friction_onset=friction_onset,
        step_fraction=step_fraction,
    )
    _show(result.summary(), _COLLISION_UNITS, json)


_COLLISION_UNITS = {
    "rebound_angle_striker": "deg",
    "rebound_angle_relative": "deg",
    "minimum_gap": "m",
    "stop_gap": "m",
    "spin": "rad/s",
}


@app.command
def wet_wall(
    *,
    particle: Annotated[str, Parameter(help="glass_0.91, glass_1.74 or alumina_1.74")] = "glass_1.74",
    liquid: Annotated[str, Parameter(help="water, tween, glycerol_35 or glycerol_51")] = "water",
    film: Annotated[float, Parameter(help="thickness of the liquid layer; 0 for a dry wall [m]")] = 100e-6,
    velocity: Annotated[float, Parameter(help="normal speed where the sphere meets the layer [m/s]")] = 1.0,
    angle: Annotated[float, Parameter(help="between velocity and normal [deg]")] = 0.0,
    spin: Annotated[float, Parameter(help="before [rad/s]")] = 0.0,
    half_filling_angle: Annotated[
        float | None, Parameter(help="of the bridge; the measured one if known [deg]")
    ] = None,
    friction: Annotated[float | None, Parameter(help="of the contact; the published one if known")] = None,
    capillary_phases: Annotated[str, Parameter(help="always, rebound or bridge")] = "always",
    length_from: Annotated[str, Parameter(help="length of the bridge from the surface or the wall")] = "surface",
    smallest_arc: Annotated[float | None, Parameter(help="floor of the toroid's arc in thick layers [m]")] = None,
    json: Annotated[bool, Parameter(help="print the result as JSON", negative="")] = False,
) -> None:
    """Let a sphere strike a wall under a thin liquid layer.

    Example: cfddem wet-wall --particle glass_1.74 --film 2e-4 --velocity 0.6
    """
    from scenarios.wet_wall import impact

    result = impact(
        particle,
        liquid,
        film,
        velocity,
        angle=angle,
        spin=spin,
        half_filling_angle=half_filling_angle,
        friction=friction,
        capillary_phases=capillary_phases,
        length_from=length_from,
        smallest_arc=smallest_arc,
    )
    values = result.summary()
    if not json:
        values |= {f"{name}_lost": energy for name, energy in values.pop("energy_lost").items()}
    _show(values, _WET_WALL_UNITS, json)


_WET_WALL_UNITS = {
    "spin": "rad/s",
    "half_filling_angle": "deg",
    "contact_speed": "m/s",
    "bridge_volume": "m3",
    "rupture_length": "m",
    "duration": "s",
    "contact_lost": "J/kg",
    "viscous_lost": "J/kg",
    "capillary_lost": "J/kg",
    "gravity_lost": "J/kg",
}


@app.command
def three_spheres(
    *,
    stokes: Annotated[float, Parameter(help="of the normal speed of impact")] = 8.0,
    theta12: Annotated[float, Parameter(help="line of centres 1-2 against the velocity [deg]")] = 45.0,
    theta23: Annotated[float, Parameter(help="line of centres 2-3 against the velocity [deg]")] = 0.0,
    film_ratio: Annotated[float, Parameter(help="film of the first pair over the diameter")] = 0.01,
    minimum_gap: Annotated[float, Parameter(help="gap at which solids touch, over the film")] = 0.05,
    capillary_number: Annotated[float, Parameter(help="infinite for no capillary pull")] = float("inf"),
    friction: Annotated[float, Parameter(help="of the solids")] = 0.0,
    restitution: Annotated[float, Parameter(help="of the solids, dry")] = 1.0,
    gap23: Annotated[float, Parameter(help="first gap of 2 and 3 over the film")] = 1.0,
    film23: Annotated[float, Parameter(help="film of 2 and 3 over that of 1 and 2")] = 1.0,
    film13: Annotated[float, Parameter(help="film of 1 and 3 over that of 1 and 2")] = 1.0,
    spheres: Annotated[int, Parameter(help="3, or 2 without the third")] = 3,
    until: Annotated[float, Parameter(help="way of the striker at its first speed, in diameters")] = 8.0,
    map: Annotated[Path | None, Parameter(help="picture of the outcomes at all St and angles, PNG")] = None,
    json: Annotated[bool, Parameter(help="print the result as JSON", negative="")] = False,
) -> None:
    """Let a wet sphere strike a resting pair of wet spheres.

    Example: cfddem three-spheres --stokes 12 --theta12 30
    """
    given = {name: value for name, value in locals().items() if name not in ("json", "map")}
    _tell_of_compilation()
    from scenarios.three_spheres import simulate
    from scenarios.three_spheres_figures import draw_map

    if map is not None:
        draw_map(map, given)

    values = simulate(**given).summary()
    if not json:
        events, contacts = values.pop("events"), values.pop("contacts")
        values |= {f"contacts{pair}": count for pair, count in contacts.items()}
    _show(values, {}, json)
    if not json:
        for event in events:
            print("t = {time:<9.4f} t* = {time_star:<8.4f} {pair} {kind:<8} at {speed:.4f}".format(**event))


@app.command
def wet_pair(
    *,
    stokes: Annotated[float, Parameter(help="of the normal speed of impact")] = 2.0,
    angle: Annotated[float, Parameter(help="between velocity and line of centres [deg]")] = 0.0,
    bridge: Annotated[str, Parameter(help="deforming or static")] = "deforming",
    cut: Annotated[str, Parameter(help="film below the minimum gap: zero or constant")] = "zero",
    tangential: Annotated[str, Parameter(help="film across the line of centres: davis, nase or none")] = "davis",
    friction: Annotated[float, Parameter(help="of the solids")] = 0.0,
    capillary: Annotated[bool, Parameter(help="with a capillary pull", negative="")] = False,
    glass_transition_pressure: Annotated[
        float | None, Parameter(help="that sets the minimum gap; the fitted one if not given [Pa]")
    ] = None,
    film: Annotated[float, Parameter(help="on both spheres together [m]")] = 270e-6,
    viscosity: Annotated[float, Parameter(help="of the film [Pa s]")] = 10.0,
    radius: Annotated[float, Parameter(help="of the spheres [m]")] = 12.7e-3,
    restitution: Annotated[float, Parameter(help="of the solids, dry")] = 0.9,
    duration: Annotated[float, Parameter(help="after which a pair counts as stuck [s]")] = 1.0,
    json: Annotated[bool, Parameter(help="print the result as JSON", negative="")] = False,
) -> None:
    """Let a wet steel sphere strike another that rests.

    Example: cfddem wet-pair --stokes 1.2 --angle 60
    """
    given = {name: value for name, value in locals().items() if name not in ("json", "tangential")}
    _tell_of_compilation()
    from scenarios.wet_pair import collide_wet

    result = collide_wet(**given, tangential=None if tangential == "none" else tangential)
    _show(result.summary(), _WET_PAIR_UNITS, json)


_WET_PAIR_UNITS = {"spin": "rad/s", "separation_time": "s", "minimum_gap": "m", "velocity": "m/s", "turned": "deg"}


@app.command
def validate(
    target: Annotated[str, Parameter(help="binary-collision, or all")] = "all",
    *,
    output: Annotated[Path, Parameter(help="folder for figures, tables and histories")] = Path("results/validation"),
    json: Annotated[bool, Parameter(help="print the table as JSON", negative="")] = False,
) -> None:
    """Redraw published results and compare; exits 1 if a limit does not hold.

    Example: cfddem validate binary-collision
    """
    _tell_of_compilation()
    from scenarios.validation import TARGETS
    from scenarios.validation import validate as run

    if target != "all" and target not in TARGETS:
        raise InputError("target", target, nearest(target, [*TARGETS, "all"]))
    names = list(TARGETS) if target == "all" else [target]
    held = [run(name, output, json) for name in names]  # every target runs, whatever the ones before it say
    if not all(held):
        sys.exit(1)


@app.command
def bench(
    target: Annotated[str, Parameter(help="dem")] = "dem",
    *,
    particles: Annotated[int, Parameter(help="10000, 100000 or 1000000")] = 10_000,
    threads: Annotated[int, Parameter(help="of each code")] = 1,
    film: Annotated[bool, Parameter(help="with the film of water", negative="")] = False,
    json: Annotated[bool, Parameter(help="print the result as JSON", negative="")] = False,
) -> None:
    """Measure this machine on standard work, beside LAMMPS where it is installed.

    Example: cfddem bench dem --particles 10000
    """
    _tell_of_compilation()
    from scenarios import dense_bed

    if target != "dem":
        raise InputError("target", target, nearest(target, ["dem"]))
    result = dense_bed.bench(particles, threads, film)
    if json:
        print(_json.dumps(result))
    else:
        for name, text in dense_bed.rows(result):
            print(f"{name:<20}  {text}")


@app.command
def run(
    case: Annotated[Path | None, Parameter(help="TOML file, or a name of the gallery; the only one here")] = None,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="new folder; NAME-run")] = None,
    set: Annotated[list[str] | None, Parameter(help="key=value in place of the file's; repeat for more")] = None,
    threads: Annotated[int | None, Parameter(help="of the machine; all if not given")] = None,
) -> None:
    """Run a case into a folder, and report what came out.

    Example: cfddem run liquid-bed -o bed --set run.until=0.1
    """
    from cfddem.case import Case
    from cfddem.gallery import find_case, overrides
    from cfddem.kernels import use_threads
    from cfddem.progress import live_line
    from cfddem.report import lines
    from cfddem.report import report as summary
    from cfddem.run import Run

    path = find_case(case)
    described = Case.from_toml(path, overrides(set or []))
    folder = output or Path(f"{path.stem}-run")
    use_threads(threads)
    with live_line() as line:
        text = described.to_toml() if set else path.read_text()
        Run.begin(described, folder, text=text, report=line.update, progress=line.say).go()
    print("\n".join(lines(summary(folder))))
    print(f"\nwritten to {folder}; see it with: cfddem view {folder}")


@app.command
def resume(
    folder: Annotated[Path | None, Parameter(help="of a run; the newest one here if not given")] = None,
    *,
    until: Annotated[float | None, Parameter(help="new end [s]")] = None,
    threads: Annotated[int | None, Parameter(help="of the machine; all if not given")] = None,
) -> None:
    """Go on with a run that was stopped or killed, to the same bits.

    Example: cfddem resume bed --until 0.12
    """
    from cfddem.kernels import use_threads
    from cfddem.progress import live_line
    from cfddem.record.reading import newest_run
    from cfddem.run import Run

    use_threads(threads)
    folder = folder or newest_run(Path())
    with live_line() as line:
        Run.resume(folder, until=until, report=line.update, progress=line.say).go()
    print(f"written to {folder}")


@app.command
def report(
    folder: Annotated[Path | None, Parameter(help="of a run; the newest one here if not given")] = None,
    *,
    json: Annotated[bool, Parameter(help="print the result as JSON", negative="")] = False,
) -> None:
    """Means of a run with their errors, beside the laws of beds.

    Example: cfddem report bed
    """
    from cfddem.record.reading import newest_run
    from cfddem.report import lines
    from cfddem.report import report as summary

    result = summary(folder or newest_run(Path()))
    print(_json.dumps(result, allow_nan=True) if json else "\n".join(lines(result)))


@app.command
def view(
    folder: Annotated[Path | None, Parameter(help="of a run; the newest one here if not given")] = None,
    *,
    output: Annotated[Path | None, Parameter(help="PNG to write; NAME.png here if not given")] = None,
    snapshot: Annotated[int, Parameter(help="0 the first, -1 the last")] = -1,
    show: Annotated[list[str] | None, Parameter(help="spheres, voidage, bubbles, streamlines; repeat for more")] = None,
    colour: Annotated[str, Parameter(help="of the spheres: speed, or a recorded field")] = "speed",
    movie: Annotated[Path | None, Parameter(help="film of all snapshots instead, .mp4 or .gif")] = None,
    history: Annotated[bool, Parameter(help="curves in time instead", negative="")] = False,
    window: Annotated[bool, Parameter(help="on the screen instead", negative="")] = False,
) -> None:
    """Make a picture of a run, a film, or curves in time.

    Example: cfddem view bed-run --movie bed.mp4
    """
    from cfddem.record.reading import newest_run
    from cfddem.view import pictures, plots
    from cfddem.view.window import window as on_screen

    folder, panels = folder or newest_run(Path()), show or ()
    if window:
        on_screen(folder, colour)
    elif movie is not None:
        print(pictures.movie(folder, movie, show=panels, colour=colour))
    elif history:
        print(plots.history(folder, output))
    else:
        print(pictures.picture(folder, output, snapshot=snapshot, show=panels, colour=colour))


@app.command
def export(
    folder: Annotated[Path | None, Parameter(help="of a run; the newest one here if not given")] = None,
    *,
    to: Annotated[str, Parameter(help="vtu, csv or netcdf")] = "vtu",
    output: Annotated[Path | None, Parameter(help="folder to write to; NAME-FORMAT here if not given")] = None,
    snapshot: Annotated[list[int] | None, Parameter(help="0 the first, -1 the last; all if not given")] = None,
) -> None:
    """Write a run in another format. ParaView, pyvista and h5py open run.vtkhdf as it is.

    Example: cfddem export bed-run --to csv
    """
    from cfddem.record.export import export as run
    from cfddem.record.reading import newest_run

    files = run(folder or newest_run(Path()), to, output, snapshot)
    print(f"{len(files)} files in {files[0].parent}" if files else "nothing to write: the run holds no snapshot")


def _tell_of_compilation() -> None:
    """Say on the terminal when loops are compiled for the first time; loads the compiler."""
    from cfddem.kernels import announce_compilation

    announce_compilation()


def _show(values: dict[str, Any], units: dict[str, str], as_json: bool) -> None:
    """Print a result as aligned lines or as JSON."""
    if as_json:
        print(_json.dumps(values))
        return
    width = max(len(name) for name in values)
    for name, value in values.items():
        print(f"{name:<{width}}  {_readable(value)} {units.get(name, '')}".rstrip())


def _readable(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return ", ".join(_readable(each) for each in value) or "-"
    return str(value)


def main() -> None:
    """Run a command; a user's mistake ends in one line and exit code 2, never in a traceback."""
    try:
        app(exit_on_error=False, print_error=False)
    except CycloptsError as mistake:
        print("cfddem: " + " ".join(str(mistake).split()), file=sys.stderr)
        sys.exit(2)
    except CfddemError as failure:
        print(f"cfddem: {failure}", file=sys.stderr)
        sys.exit(failure.exit_code)
    except KeyboardInterrupt:
        print("cfddem: stopped", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
