"""March of three wet spheres from event to event: films meet and part, solids strike, rest on each other and let go.

An event is where a room falls to nothing: the way to the solid, to the rim of the film, or the force between solids
pressed together. Its time is found by repeating the step with other lengths, so it is as accurate as the step.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.kernels import kernel
from scenarios.adaptive import STAGES, next_length
from scenarios.three_spheres_motion import (
    APART,
    FILM,
    FILM_RATIO,
    JOINED,
    MINIMUM_GAP,
    RESTING,
    RESTITUTION,
    ROOM,
    SLOWEST,
    STATE,
    look,
    rates,
    step,
    strike,
)

CONTACT, MEET, SEPARATE, RELEASE = 0, 1, 2, 3
"""Kinds of events; a release is not told to the user."""

DONE, FULL, STUCK = 0, 1, 2
"""Why the march returns."""

TIME, LENGTH = 0, 1
SAMPLES, EVENTS = 0, 1

TOUCH = 1e-10
"""Gap above the minimum gap below which solids are taken to touch, over the film."""

STILL = 1e-12
SHORTEST = 1e-12
MOST_STEPS = 3_000_000
STRIDE = 0.02
"""Longest way in a step, over the diameter: no pair slips past another within one."""


@kernel
def least_room(state, modes, numbers, slopes, seen):
    """Smallest room, its pair and the kind of event that is due when it is used up."""
    least, which, what = math.inf, 0, CONTACT
    for pair in range(3):
        look(state, numbers, pair, seen)
        film = numbers[FILM + pair]
        if modes[pair] == RESTING:
            room, kind = slopes[STAGES * STATE + pair], RELEASE
        elif modes[pair] == APART:
            room, kind = seen[0] - film, MEET
        elif 2.0 * seen[0] < film + numbers[MINIMUM_GAP]:
            room, kind = seen[0] - numbers[MINIMUM_GAP], CONTACT
        else:
            room, kind = film - seen[0], SEPARATE
        if room < least:
            least, which, what = room, pair, kind
    return least, which, what


@kernel
def tell(log, counts, time, kind, pair, speed):
    """Write an event down."""
    row = counts[EVENTS]
    log[row, 0], log[row, 1], log[row, 2], log[row, 3] = time, kind, pair, speed
    counts[EVENTS] = row + 1


@kernel
def collide(state, modes, numbers, pair, speed, seen):
    """A hard contact, or one so slow that the pair stays pressed together."""
    rests = speed <= numbers[SLOWEST]
    strike(state, numbers, pair, 0.0 if rests else numbers[RESTITUTION], seen)
    modes[pair] = RESTING if rests else JOINED
    if rests and pair < 2:
        state[4 * pair + 2] = 0.0


@kernel
def settle(state, modes, numbers, time, log, counts, seen):
    """Contacts that one contact brings about at once, until none is left."""
    for _ in range(300):
        still = True
        for pair in range(3):
            look(state, numbers, pair, seen)
            touching = modes[pair] == RESTING or (modes[pair] == JOINED and seen[0] - numbers[MINIMUM_GAP] < TOUCH)
            speed = seen[1]
            if touching and (speed > STILL or (modes[pair] == RESTING and -numbers[SLOWEST] < speed < -STILL)):
                if modes[pair] == JOINED:
                    tell(log, counts, time, CONTACT, pair, speed)
                collide(state, modes, numbers, pair, speed, seen)
                still = False
            elif modes[pair] == RESTING and speed < -STILL:
                modes[pair] = JOINED
        if still or counts[EVENTS] >= len(log) - 6:
            return


@kernel
def longest(state, modes, numbers, slopes, seen):
    """Longest step: no way past another sphere, and a quarter of the flight after a contact."""
    length = math.inf
    for pair in range(3):
        look(state, numbers, pair, seen)
        speed = math.hypot(seen[1], seen[5] * seen[2]) + 1e-300
        length = min(length, STRIDE / (numbers[FILM_RATIO] * speed))
        if pair < 2 and modes[pair] == JOINED and seen[0] - numbers[MINIMUM_GAP] < TOUCH and seen[1] < -STILL:
            braking = slopes[4 * pair + 2]
            if braking > 0.0:
                length = min(length, -0.5 * seen[1] / braking)
    return length


@kernel
def dips(state, end, modes, numbers, length, seen):
    """Time within a step at which a pair that approaches at its start and recedes at its end is closest; else 0."""
    for pair in range(3):
        if modes[pair] == RESTING:
            continue
        look(state, numbers, pair, seen)
        before = seen[1]
        look(end, numbers, pair, seen)
        if before > 0.0 and seen[1] < 0.0:
            return length * before / (before - seen[1])
    return 0.0


@kernel
def nothing_left(state, modes, numbers, remaining, seen):
    """Whether all films are apart and free flight brings no two spheres together in the time that remains."""
    for pair in range(3):
        if modes[pair] != APART:
            return False
        look(state, numbers, pair, seen)
        across = seen[5] * seen[2]
        speed = math.hypot(seen[1], across)
        reach = 1.0 / numbers[FILM_RATIO] + numbers[FILM + pair]
        if seen[1] > 0.0 and seen[5] * abs(across) < reach * speed and seen[5] - reach < speed * remaining:
            return False
    return True


@kernel
def advance(clock, state, modes, numbers, until, samples, log, counts, first_speeds):
    """March until a time, or until a record is full; returns why it stopped.

    clock         time and length of the next step
    samples       rows of time and state, one a step; none are kept where it has no rows
    log           rows of time, kind, pair, speed of events
    counts        rows filled of both
    first_speeds  speed of the first separation of each pair, NaN before
    """
    slopes, end, seen = np.empty(ROOM), np.empty(STATE), np.empty(6)
    fresh = True
    for _ in range(MOST_STEPS):
        if clock[TIME] >= until:
            return DONE
        if counts[EVENTS] > len(log) - 10 or (len(samples) > 0 and counts[SAMPLES] > len(samples) - 3):
            return FULL
        if fresh:
            if nothing_left(state, modes, numbers, until - clock[TIME], seen):
                return DONE
            rates(state, modes, numbers, slopes, 0)
            least, which, what = least_room(state, modes, numbers, slopes, seen)
            if what == RELEASE and least < 0.0:
                modes[which] = JOINED
                continue
        length = min(clock[LENGTH], until - clock[TIME], longest(state, modes, numbers, slopes, seen))
        error = step(state, modes, numbers, length, slopes, end)
        if not error <= 1.0:
            clock[LENGTH] = next_length(length, error)
            if clock[LENGTH] < SHORTEST * 1e-6:
                return STUCK
            continue
        least, which, what = least_room(end, modes, numbers, slopes, seen)
        if least >= 0.0:
            dip = dips(state, end, modes, numbers, length, seen)
            if dip > 0.0:
                step(state, modes, numbers, dip, slopes, end)
                least, which, what = least_room(end, modes, numbers, slopes, seen)
                if least < 0.0:
                    length = dip
                else:
                    step(state, modes, numbers, length, slopes, end)
        if least >= 0.0:
            clock[TIME] += length
            clock[LENGTH] = next_length(length, error)
            for row in range(STATE):
                state[row] = end[row]
                slopes[row] = slopes[(STAGES - 1) * STATE + row]
            fresh = False
            sample(clock, state, samples, counts)
            continue
        # the event lies within the step: between a time with room and one without
        low, high, room_low, room_high = 0.0, length, 0.0, least
        for tries in range(200):
            if tries == 0:
                middle = 0.5 * high
            elif low == 0.0:
                middle = 0.25 * high
            else:
                middle = (low * room_high - high * room_low) / (room_high - room_low)
                if tries % 3 == 2 or not low < middle < high:
                    middle = 0.5 * (low + high)
            step(state, modes, numbers, middle, slopes, end)
            least, which, what = least_room(end, modes, numbers, slopes, seen)
            if least >= 0.0:
                low, room_low = middle, least
            else:
                high, room_high = middle, least
            if -1e-13 < least < 1e-13 or high - low < 1e-15 * high or high < SHORTEST:
                break
        clock[TIME] += middle
        for row in range(STATE):
            state[row] = end[row]
        look(state, numbers, which, seen)
        speed = seen[1]
        if what == CONTACT:
            place(state, which, numbers[MINIMUM_GAP])
            if speed > STILL:
                tell(log, counts, clock[TIME], CONTACT, which, speed)
            if speed > 0.0 or low == 0.0:
                collide(state, modes, numbers, which, speed, seen)
        elif what == MEET:
            place(state, which, numbers[FILM + which])
            modes[which] = JOINED
            tell(log, counts, clock[TIME], MEET, which, speed)
        elif what == SEPARATE:
            place(state, which, numbers[FILM + which])
            modes[which] = APART
            tell(log, counts, clock[TIME], SEPARATE, which, -speed)
            if math.isnan(first_speeds[which]):
                first_speeds[which] = -speed
        else:
            modes[which] = JOINED
        sample(clock, state, samples, counts)
        settle(state, modes, numbers, clock[TIME], log, counts, seen)
        sample(clock, state, samples, counts)
        fresh = True
    return STUCK


@kernel
def place(state, pair, gap):
    """Put a pair exactly on a gap that it has reached to rounding."""
    if pair < 2:
        state[4 * pair] = gap


@kernel
def sample(clock, state, samples, counts):
    """Keep a row of the history."""
    row = counts[SAMPLES]
    if row < len(samples):
        samples[row, 0] = clock[TIME]
        for column in range(STATE):
            samples[row, 1 + column] = state[column]
        counts[SAMPLES] = row + 1
