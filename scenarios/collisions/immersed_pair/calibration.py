"""Values of materials and films for which computed collisions agree with measured ones, with errors."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.analysis.response import fewest_runs
from cfddem.backend.errors import CfddemError, InputError, nearest
from cfddem.case.compare import Points
from cfddem.case.gallery import read_value
from cfddem.case.materials import Material
from cfddem.studies.calibration import Calibration, Trial, chi2_of, response_of
from cfddem.studies.samples import Variable, unit_samples
from scenarios.collisions.immersed_pair.measured import read_points, values_at
from scenarios.collisions.immersed_pair.study import MATERIALS, collide

SCATTER, FALL, LEAST_SCATTER = 0.15, 0.8, 0.02
"""Standard deviation about the best point of the fit with which trials are proposed, as a share of the ranges: of the
first one, the factor from one to the next, and the least."""

KEYS = [*Material.model_fields, *(name for name in inspect.signature(collide).parameters if name != "material")]
"""What can be set or varied: values of the material, and arguments of a collision."""


def key_of(word: str) -> str:
    """The name of a value of a collision; InputError for another word."""
    name = word.replace("-", "_")
    if name not in KEYS or name == "stokes":
        raise InputError("key", word, nearest(name, KEYS), "stokes or angle come from the data" * (name == "stokes"))
    return name


def settings(texts: Sequence[str]) -> dict[str, Any]:
    """Values by name of texts such as `velocity=0.1`.

    >>> settings(["velocity=0.1", "against=wall"])
    {'velocity': 0.1, 'against': 'wall'}
    """
    values = {}
    for setting in texts:
        key, equals, text = setting.partition("=")
        if not equals:
            raise InputError("--set", setting, "key=value, such as velocity=0.1")
        values[key_of(key.strip())] = read_value(text)
    return values


def fit(
    material: str,
    match: Sequence[Path],
    varied: Sequence[Variable],
    fixed: Mapping[str, Any],
    *,
    trials: int = 30,
    progress: Callable[[Trial], None] = lambda _: None,
) -> Calibration:
    """Search for the values of keys for which collisions agree with measured points.

    material  of both bodies, whose values are changed
    match     files of measured points with errors: restitution over stokes or angle, or rebound angle over angle
    varied    keys and their ranges
    fixed     values by name that all collisions share
    trials    number of sets of values; the first ones fill the ranges, the others lie about the best fit
    progress  called after every trial
    errors    InputError for wrong names or data, before any collision
    """
    if material not in MATERIALS:
        raise InputError("--collide", material, nearest(material, MATERIALS))
    if trials < 1:
        raise InputError("--trials", trials, "at least 1")
    if not match:
        raise InputError("--match", None, "given: a CSV file of measured collisions with errors")
    data = [read_points(path) for path in match]
    for path, points in zip(match, data):
        if not np.isfinite(points.error).all():
            raise InputError(f"{path} error", None, "given for every point", "add a column of standard errors")
    done: list[Trial] = []
    fewest = max(8, 2 * fewest_runs(len(varied)))
    start, chance = unit_samples(len(varied), fewest, "sobol"), np.random.default_rng(1)
    while len(done) < trials:
        response = response_of(varied, data, done) if len(done) >= fewest else None
        width = max(LEAST_SCATTER, SCATTER * FALL ** max(0, len(done) - fewest))
        scattered = width * chance.normal(size=len(varied))
        shares = start[len(done) % fewest] if response is None else np.clip(response.best + scattered, 0.0, 1.0)
        values = {variable.key: variable.value(float(share)) for variable, share in zip(varied, shares)}
        done.append(_trial(len(done), material, dict(fixed), values, data))
        progress(done[-1])
        if len(done) == 1 and not done[0].computed:  # what is the same in all collisions
            _collisions(material, dict(fixed) | values, data)
    return Calibration(tuple(varied), tuple(data), tuple(done), response_of(varied, data, done))


def _trial(
    number: int, material: str, fixed: Mapping[str, Any], values: dict[str, float], data: Sequence[Points]
) -> Trial:
    try:
        computed = _collisions(material, {**fixed, **values}, data)
    except CfddemError as failure:
        return Trial(number, values, str(failure), (), math.nan)
    return Trial(number, values, "finished", computed, chi2_of(computed, data))


def _collisions(material: str, values: Mapping[str, Any], data: Sequence[Points]) -> tuple[float, ...]:
    """Values at all measured points."""
    own = {name: value for name, value in values.items() if name in Material.model_fields}
    solid = Material(**MATERIALS[material].model_dump() | own)
    rest = {name: value for name, value in values.items() if name not in own}
    values_of_data = [
        values_at(points, lambda **point: collide(solid, **rest | point), points.place) for points in data
    ]
    computed = np.concatenate(values_of_data)
    if not np.isfinite(computed).all():
        raise InputError("data", None, "of collisions that have these values", "a computed one has none")
    return tuple(computed.tolist())
