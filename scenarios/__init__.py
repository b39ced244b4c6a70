"""Runnable cases: one page each, with its published comparison."""
