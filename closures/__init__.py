"""Physical laws as scalar functions: numbers in, number out.

Each file covers one subject. Each function is one equation from one source. A law is a plain Python function;
compiled loops call the same function by its name.

>>> from closures import lubrication
>>> round(lubrication.film_strength(1e-3, 3.175e-3) * 1e7, 2)   # N m^-1 s * m
1.9
"""

from closures.check import check
from closures.registry import REGISTRY, Law, law, law_of

__all__ = ["REGISTRY", "Law", "check", "law", "law_of"]
