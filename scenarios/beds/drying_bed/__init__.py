"""Wet seeds dry in a fluidised bed of hot air."""

from scenarios.beds.drying_bed.study import Balance, Drying, balance, case, drying

__all__ = ["Balance", "Drying", "balance", "case", "drying"]
