#!/usr/bin/env python3
"""Finds the shifts by which the pixels of a tile complement each other (src/render/sampler/sobol.rs).

    python3 pixel_shifts.py [--seed 1]

takes some minutes. Each seed finds other shifts, which are nearly as good.

A pixel has the points A i + B p over GF(2), where the bits i number its samples, the bits p are its place along the Morton curve of a
tile, A are the generator matrices of two Sobol' dimensions, and B is what is looked for. In a block of 2^m pixels with 2^k samples each,
every cell of 2^-q0 by 2^-q1, q0 + q1 = k + m, holds one point if and only if the first q0 and q1 rows of [A B], restricted to the first k and m
columns, have full rank. B is found column by column, first for dimensions 0 and 1, then for 2 and 3, each by descent from random starts
over flips of one and two of its bits, so that the ranks lack as little as possible for up to 64 samples. The pairs of one of the former and one of
the latter dimensions count less.

Prints the columns of each dimension, their digits from the lowest bit on, and what the ranks of each pair lack: a line per m, a group per k, a
digit per q0.
"""

import argparse
import itertools
import random

ROWS = 16
PLACE_BITS = 8
SAMPLE_BITS = 6
STARTS = 20
FLIPS = 400
CROSS_WEIGHT = 0.3

# Degree, inner coefficients and first direction numbers of the primitive polynomials (Joe and Kuo 2008).
POLYNOMIALS = {1: (1, 0, [1]), 2: (2, 1, [1, 3]), 3: (3, 1, [1, 3, 1])}


def generator_columns(dimension):
    """Returns the first columns of a Sobol' dimension's generator matrix, row r in bit r."""
    if dimension == 0:
        return [1 << k for k in range(ROWS)]
    degree, inner, numbers = POLYNOMIALS[dimension]
    directions = [number << (31 - k) for k, number in enumerate(numbers)]
    for k in range(degree, ROWS):
        direction = directions[k - degree] ^ directions[k - degree] >> degree
        for j in range(1, degree):
            if inner >> (degree - 1 - j) & 1:
                direction ^= directions[k - j]
        directions.append(direction)
    return [int(f"{direction:032b}"[ROWS - 1 :: -1], 2) for direction in directions]


GENERATORS = [generator_columns(dimension) for dimension in range(4)]


def rank(columns):
    basis = []
    for column in columns:
        for b in basis:
            column = min(column, column ^ b)
        if column:
            basis.append(column)
    return len(basis)


def lacks(shifts, pair):
    """Yields (k, q0, q1, what the rank lacks) of a pair of dimensions, for blocks of as many bits as there are shifts."""
    low, high = pair
    m = len(shifts[high])
    join = lambda columns: [a | b << ROWS for a, b in zip(columns[low], columns[high])]
    generators, blocks = join(GENERATORS), join(shifts)
    for k in range(SAMPLE_BITS + 1):
        for q0 in range(k + m + 1):
            q1 = k + m - q0
            mask = (1 << q0) - 1 | (1 << q1) - 1 << ROWS
            yield k, q0, q1, k + m - rank([column & mask for column in generators[:k] + blocks])


def pair_penalty(shifts, pair):
    """Few samples, and cells that are square or span one of the dimensions, count most."""
    return sum(
        0.8**k * (2 if abs(q0 - q1) <= 1 or 0 in (q0, q1) else 1) * (2**lack - 1)
        for k, q0, q1, lack in lacks(shifts, pair)
    )


def penalty(shifts):
    """Penalty of the dimensions 0 and 1, or if there are four, of the pairs that have one of the others."""
    if len(shifts) == 2:
        return pair_penalty(shifts, (0, 1))
    cross = sum(pair_penalty(shifts, pair) for pair in itertools.product((0, 1), (2, 3)))
    return pair_penalty(shifts, (2, 3)) + CROSS_WEIGHT * cross


def with_columns(shifts, columns):
    """Adds a column to the last two dimensions: that of the first in the lower 16 bits."""
    return [*shifts[:-2], [*shifts[-2], columns & 0xFFFF], [*shifts[-1], columns >> ROWS]]


def next_columns(shifts, random_bits):
    candidates = []
    for _ in range(STARTS):
        columns = random_bits(2 * ROWS)
        least = penalty(with_columns(shifts, columns))
        for _ in range(FLIPS):
            flipped = columns ^ 1 << random_bits(5) ^ (1 << random_bits(5)) * random_bits(1)
            found = penalty(with_columns(shifts, flipped))
            if found < least:
                least, columns = found, flipped
        candidates.append((least, columns))
    return min(candidates)[1]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    random_bits = random.Random(parser.parse_args().seed).getrandbits
    shifts = []
    for _ in range(2):
        shifts += [[], []]
        for _ in range(PLACE_BITS):
            shifts = with_columns(shifts, next_columns(shifts, random_bits))
    for columns in shifts:
        print(", ".join(f"0x{column:04x}" for column in columns))
    for pair in itertools.combinations(range(4), 2):
        print("dimensions", *pair)
        for m in range(1, PLACE_BITS + 1):
            groups = {}
            for k, _, _, lack in lacks([columns[:m] for columns in shifts], pair):
                groups[k] = groups.get(k, "") + str(lack)
            print(m, *groups.values())


if __name__ == "__main__":
    main()
