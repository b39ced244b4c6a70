"""The kept speeds of benchmarks: every kept name is one that a benchmark looks for, and lines show the ratio."""

from scenarios.benchmarks import kept_speeds, table
from scenarios.benchmarks.fluid_box import CELLS

BED = {
    "particles": 10_000,
    "threads": 1,
    "film": True,
    "gpu": "",
    "films that resist sliding": False,
    "bridges per particle": 0.0,
}


def test_every_benchmark_of_the_table_has_a_kept_speed():
    """As many as `bench all` measures: the dense beds, the boxes of fluid, the gas bed at two fluid steps."""
    beds = [name for name in kept_speeds.kept()["speeds"] if name.startswith("dense bed")]
    assert len(beds) == len([name for name in table.benchmarks() if name.startswith("dense bed")])
    assert len(kept_speeds.kept()["speeds"]) == len(beds) + len(CELLS) + 2


def test_a_line_ends_with_the_ratio_to_the_kept_speed():
    name = kept_speeds.dense_bed(BED)
    known = kept_speeds.kept()["speeds"][name]
    assert kept_speeds.beside(name, 1.25 * known).startswith("; 1.25 times as fast as kept")
    assert kept_speeds.beside("a bed that nobody measured", 1.0) == ""
