"""Fluidised, packed, settling and spouted beds: one folder a case, each with a case file and a page."""
