"""Figures for all readers: colours that differ for the colour-blind, units on axes, letters to read at half size."""

from __future__ import annotations

import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cfddem.case.compare import Points
from cfddem.plotting import curves, study_figures
from cfddem.plotting.colours import colour_map

HOME = Path(__file__).parents[2]
SOURCES = {
    str(path.relative_to(HOME)): path.read_text(encoding="utf-8")
    for package in ("cfddem", "scenarios")
    for path in sorted((HOME / package).rglob("*.py"))
}

SEEN = {
    "all colours": np.eye(3),
    "no red": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "no green": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "no blue": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
"""What linear red, green and blue become for readers who lack a kind of cone: Machado, Oliveira & Fernandes, IEEE
Trans. Vis. Comput. Graph. 15 (2009) 1291, at severity 1."""

LEAST = {"all colours": 20.0, "no red": 20.0, "no green": 20.0, "no blue": 15.0}
"""Least distance of two colours in CIELAB; 2.3 can just be seen. Few readers lack blue: 1 in 10 000."""

MAPS = {"viridis", "plasma", "cividis", "Blues", "Blues_r", "YlGnBu", "RdBu_r", "gray", "viridis_r"}
"""Maps whose lightness changes steadily, from end to end or from the middle."""


def lightness_and_hue(colour: np.ndarray) -> np.ndarray:
    """CIELAB of linear red, green and blue (white D65)."""
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ colour
    ratio = xyz / np.array([0.9505, 1.0, 1.089])
    root = np.where(ratio > 0.008856, np.cbrt(ratio), 7.787 * ratio + 16.0 / 116.0)
    return np.array([116.0 * root[1] - 16.0, 500.0 * (root[0] - root[1]), 200.0 * (root[1] - root[2])])


def linear(colour: np.ndarray) -> np.ndarray:
    """Linear red, green and blue of a colour on the screen (sRGB)."""
    return np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)


def distance(one: str, other: str, kind: str) -> float:
    """Distance of two colours #rrggbb in CIELAB for a kind of reader."""
    parts = [np.array([int(each[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]) for each in (one, other)]
    seen = [lightness_and_hue((np.array(SEEN[kind]) @ linear(each)).clip(0.0, 1.0)) for each in parts]
    return float(np.linalg.norm(seen[0] - seen[1]))


@pytest.mark.parametrize("kind", SEEN)
def test_colours_of_curves_differ_for_every_reader(kind: str) -> None:
    names = ("BLUE", "SKY", "ORANGE", "GREEN", "RED", "GREY")
    for one, other in itertools.combinations(names, 2):
        found = distance(getattr(curves, one), getattr(curves, other), kind)
        assert found > LEAST[kind], f"{one} and {other} for {kind}: {found:.0f}"


def test_the_check_finds_a_green_and_a_grey_that_are_alike_without_green_cones() -> None:
    assert distance("#1b8a5a", "#7a7a7a", "all colours") > 40.0
    assert distance("#1b8a5a", "#7a7a7a", "no green") < LEAST["no green"]


@pytest.mark.parametrize("colour", ["speed", "agglomerate"])
def test_maps_of_spheres_change_their_lightness_steadily(colour: str) -> None:
    """Apart from the grey of single particles at the lower end."""
    shades = np.array(colour_map(colour).colors)[16:, :3]
    light = np.array([lightness_and_hue(linear(each))[0] for each in shades])
    assert (np.diff(light) > -1e-3).all() and light[-1] - light[0] > 50.0


def test_only_maps_for_all_readers_are_used() -> None:
    found = {
        (file, name)
        for file, text in SOURCES.items()
        for name in re.findall(r"(?:cmap=|colormaps\[|part_of\(|_cells\([^)]*?, )\"(\w+)\"", text)
    }
    assert {name for _, name in found} & {"viridis", "plasma", "Blues"}
    assert not {each for each in found if each[1] not in MAPS}


def test_letters_are_large_enough_for_half_size() -> None:
    """A figure is 8 inches wide; on a screen of half that, 8.5 points are 9 pixels high."""
    small = [
        f"{file}: {size}"
        for file, text in SOURCES.items()
        for size in re.findall(r"(?:fontsize|labelsize)\"?[=:] ?([\d.]+)", text)
        if float(size) < 8.5
    ]
    assert not small, "\n".join(small)


def test_axes_have_units() -> None:
    """Every label of an axis that is written out has brackets."""
    bare = [
        f"{file}: {text!r}"
        for file, source in SOURCES.items()
        for text in re.findall(r"set_[xyz]label\(f?\"([^\"]+)\"", source)
        if "[" not in text
    ]
    assert not bare, "\n".join(bare)


def test_figures_are_no_wider_than_eleven_inches() -> None:
    """A page shows about 900 pixels; the letters of a wider figure could not be read there at half size."""
    wide = [
        f"{file}: {size} inches"
        for file, text in SOURCES.items()
        for size in re.findall(r"(?:panels|blank)\([^\n]*?width=(\d+\.\d+)\b(?! \*)", text)
        if float(size) > 11.0
    ]
    assert not wide, "\n".join(wide)


@pytest.mark.filterwarnings("ignore:Palette images")
def test_pictures_of_the_pages_have_no_colour_of_a_former_palette() -> None:
    """Among them a green and a grey that readers without green cones cannot tell apart."""
    from PIL import Image

    former = {int(each[1:], 16): each for each in ("#56a6d9", "#e07b00", "#1b8a5a", "#b8323c")}
    old = []
    for path in sorted((HOME / "docs" / "images").glob("*.png")):
        pixels = np.asarray(Image.open(path).convert("RGB")).astype(np.int32) @ np.array([65536, 256, 1])
        old += [f"{path.name}: {name}" for code, name in former.items() if (pixels == code).sum() > 50]
    assert not old, "\n".join(old)


def test_a_sweep_joins_numbers_and_never_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The key with numbers is on the axis, wherever it stands; one curve for each word."""
    drawn: list[Any] = []
    monkeypatch.setattr(study_figures, "save", lambda figure, path: drawn.append(figure))
    points = [
        study_figures.Point({"laws.drag": law, "bed.inlet_velocity": speed}, {"bed_height": (0.04, 1e-4, "m")})
        for law in ("di_felice", "wen_yu")
        for speed in (0.03, 0.045)
    ]
    words = [study_figures.Point({"laws.drag": each.values["laws.drag"]}, each.measures) for each in points[::2]]
    for each in (points, words):
        assert study_figures.sweep_figure(each, tmp_path / "sweep.png")
    (both,), (alone,) = drawn[0].axes, drawn[1].axes
    assert both.get_xlabel() == "bed.inlet_velocity  [m/s]" and alone.get_xlabel() == "laws.drag"
    curve = Points("mine", "bed_height", "m", "inlet_velocity", np.array([0.04]), np.array([0.05]), np.array([np.nan]))
    assert study_figures.sweep_figure(points, tmp_path / "sweep.png", [curve])
    (measured,) = drawn[2].axes
    assert measured.containers[-1].get_label() == "measured: mine" and len(measured.containers) == 3
    curves_of = [each.lines[0].get_linestyle() for panel in (both, alone) for each in panel.containers]
    assert curves_of == ["-", "-", "None"]
