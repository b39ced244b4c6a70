"""Standard runs that measure speed; `cfddem bench` runs them."""
