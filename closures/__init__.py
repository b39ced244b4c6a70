"""Physics as scalar functions: numbers in, number out.

Each file is a chapter, each function one equation that can be read beside its paper. A law is a plain
Python function; compiled loops call the same function by its name.

>>> from closures import lubrication
>>> round(lubrication.film_strength(1e-3, 3.175e-3) * 1e7, 2)   # N m^-1 s * m
1.9
"""

from closures.check import check
from closures.law import SHELF, Law, law, page

__all__ = ["SHELF", "Law", "check", "law", "page"]
