"""A bed of steel spheres that is heated from above, beside the measurement of Beaulieu (2020)."""
