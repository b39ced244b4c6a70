"""What feeds bring during a run, and the walls, feeds and outlets that do not go with the rest of a case."""

from __future__ import annotations

from collections.abc import Iterator

from cfddem.backend.errors import InputError, nearest, shown
from cfddem.case.bed import AT_RANDOM, CaseFeed, Species
from cfddem.case.tables import CaseTables


def refuse_wrong_equipment(case: CaseTables) -> None:
    """Refuse walls, feeds and outlets that do not go with the rest of the case."""
    for error in (*_wrong_walls(case), *_wrong_feeds(case)):
        raise error


def feed_rate(case: CaseTables, feed: CaseFeed) -> float:
    """Particles per second that a feed brings [1/s]."""
    species = fed_species(case, feed)
    if feed.rate is not None:
        return feed.rate
    return (feed.mass_rate or 0.0) / (species.mean_volume * case.material_of(species).density)


def fed_count(case: CaseTables) -> float:
    """Particles that all feeds bring until the end of the run."""
    ends = (case.run.until if feed.end is None else min(feed.end, case.run.until) for feed in case.feed)
    return sum(feed_rate(case, feed) * max(end - feed.begin, 0.0) for feed, end in zip(case.feed, ends))


def fed_species(case: CaseTables, feed: CaseFeed) -> Species:
    """The species that a feed brings."""
    return case.species[feed.species or next(iter(case.species))]


def _wrong_walls(case: CaseTables) -> Iterator[InputError]:
    for number, wall in enumerate(case.wall):
        key = f"wall.{number}"
        if wall.material is not None and wall.material not in case.material:
            limit = nearest(wall.material, case.material)
            yield InputError(
                f"{key}.material", shown(wall.material), limit, "every material is a table [material.NAME]"
            )
        if not case.has_fluid:
            if wall.solid is not None:
                yield InputError(f"{key}.solid", wall.solid, "left out in a case without a fluid")
            continue
        if wall.solid is None and wall.form.is_open:
            remedy = "thin keeps the fluid on both sides; else give the side whose cells are solid"
            yield InputError(
                f"{key}.solid", None, "given in a case with a fluid: thin, inside, outside or none", remedy
            )
        if wall.leaves_its_place and wall.side != "none":
            remedy = "the cells of the fluid do not move; a wall may move along itself"
            yield InputError(f"{key}.solid", wall.solid, "none for a wall that leaves its place in a fluid", remedy)
    if case.wall and case.bed.start in AT_RANDOM:
        yield InputError("bed.start", case.bed.start, '"poured", "suspended" or "placed" where walls are given')


def _wrong_feeds(case: CaseTables) -> Iterator[InputError]:
    boxes = [(f"feed.{n}", feed.corner, feed.size) for n, feed in enumerate(case.feed)]
    boxes += [(f"outlet.{n}", outlet.corner, outlet.size) for n, outlet in enumerate(case.outlet)]
    if case.bed.start_size is not None and case.bed.start_corner is not None:
        boxes.append(("bed.start", case.bed.start_corner, case.bed.start_size))
    whole = case.column.size
    for key, corner, size in boxes:
        for low, edge, length in zip(corner, size, whole):
            if low < 0.0 or low + edge > length * (1.0 + 1e-9):
                divider = "_" if key == "bed.start" else "."
                limit = f"inside the column, 0 to {', '.join(f'{length:g}' for length in whole)} m"
                remedy = f"the box ends at {', '.join(f'{a + b:.4g}' for a, b in zip(corner, size))} m"
                yield InputError(f"{key}{divider}corner", corner, limit, remedy)
                break
    if case.feed and case.has_fluid:
        for key, law, none in (("added_mass", case.laws.added_mass, 0.0), ("history", case.laws.history, "none")):
            if law != none:
                remedy = "the law needs the past of a particle, and particles of a feed have none"
                yield InputError(f"laws.{key}", shown(law), f"{none!r} where there is a feed in a fluid", remedy)
    for number, feed in enumerate(case.feed):
        names = list(case.bed.species)
        if (feed.species or "") not in (names or [""]):
            limit = nearest(feed.species or "", names) if names else "left out for a bed of one species"
            value, opening = (shown(feed.species), "") if feed.species else (None, "given, ")
            yield InputError(f"feed.{number}.species", value, opening + limit)
        if case.bed.fixed:
            yield InputError("bed.fixed", True, "false where there is a feed")
