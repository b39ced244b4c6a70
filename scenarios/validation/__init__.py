"""Comparisons with published results; `cfddem validate` runs them."""
