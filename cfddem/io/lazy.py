"""A field in all snapshots as an array of xarray whose values are read when they are asked for. It needs xarray."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from xarray.backends import BackendArray
from xarray.core.indexing import IndexingSupport, LazilyIndexedArray, explicit_indexing_adapter

from cfddem.backend.errors import RunFailed


class Series(BackendArray):
    """A field in time; one snapshot at a time is read, and only those of the chosen times."""

    def __init__(self, read: Callable[[int], np.ndarray], count: int, form: np.ndarray) -> None:
        self._read = read
        self.shape, self.dtype = (count, *form.shape), form.dtype

    def __getitem__(self, key: Any) -> Any:
        return explicit_indexing_adapter(key, self.shape, IndexingSupport.OUTER, self._values)

    def _values(self, key: tuple[Any, ...]) -> np.ndarray:
        places = np.arange(self.shape[0])[key[0]]
        if places.ndim == 0:
            return self._part(int(places), key[1:])
        form = blank(self.dtype, self.shape[1:])
        values = np.empty((len(places), *_chosen(form, key[1:]).shape), self.dtype)
        for row, place in enumerate(places):
            values[row] = self._part(int(place), key[1:])
        return values

    def _part(self, place: int, key: tuple[Any, ...]) -> np.ndarray:
        values = self._read(place)
        if values.shape != self.shape[1:]:
            raise RunFailed(f"snapshot {place}: a field has the shape {values.shape}, in the last {self.shape[1:]}")
        return _chosen(values, key)


def series(read: Callable[[int], np.ndarray], count: int, form: np.ndarray) -> Any:
    """A field in time, for a variable of xarray.

    read   number of a snapshot -> its values
    count  of snapshots
    form   an array with shape and type of one snapshot
    """
    return LazilyIndexedArray(Series(read, count, form))


def blank(dtype: Any, shape: tuple[int, ...]) -> np.ndarray:
    """An array of a shape and type that takes no memory."""
    return np.broadcast_to(np.empty((), dtype), shape)


def _chosen(values: np.ndarray, key: tuple[Any, ...]) -> np.ndarray:
    """The values at indices that each apply to their own axis; numpy would pair several lists of indices."""
    for axis, chosen in reversed(list(enumerate(key))):
        values = values[(slice(None),) * axis + (chosen,)]
    return np.asarray(values)
