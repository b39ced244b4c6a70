"""Keys and values of earlier case files, and what to write instead."""

from __future__ import annotations

KEYS = {
    "bed.velocity": "bed.initial_velocity",
    "laws.cohesion": "laws.contact",
    "laws.normal_stiffness": "laws.contact_parameters.normal_stiffness",
    "laws.own_wind": "laws.self_disturbance_correction",
    "laws.rolling": "laws.rolling_resistance",
    "laws.smoothing": "laws.kernel_width",
    "laws.tangential_stiffness": "laws.contact_parameters.tangential_stiffness",
    "run.collisions": "run.record_collisions",
    "run.energy": "run.energy_budget",
    "run.step": "run.particle_step",
}
"""New key of every renamed key."""

VALUES = {
    "bed.start": {"at": "placed"},
    "laws.rolling_resistance": {"free": "none"},
}
"""New value of every renamed value, by key."""


def new_key(key: str) -> str | None:
    """The new key of a renamed key; None if the key was not renamed.

    >>> new_key("run.step"), new_key("run.until")
    ('run.particle_step', None)
    """
    return KEYS.get(key)


def new_name(word: str) -> str | None:
    """The new name of a renamed key that is given without its table; None if it was not renamed.

    >>> new_name("own_wind")
    'self_disturbance_correction'
    """
    names = {key.partition(".")[2]: new.partition(".")[2] for key, new in KEYS.items()}
    return names.get(word)


def new_value(key: str, value: object) -> str | None:
    """The new text of a renamed value; None if the value was not renamed.

    >>> new_value("bed.start", "at")
    'placed'
    """
    return VALUES.get(key, {}).get(value) if isinstance(value, str) else None
