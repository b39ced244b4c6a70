"""One sphere settles in a liquid."""

from scenarios.beds.settling.study import fall, mordant, release, ten_cate

__all__ = ["fall", "mordant", "release", "ten_cate"]
