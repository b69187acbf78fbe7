# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Assignment: a partner for each of a few rows, no two the same, so that most is shared.

Shortest augmenting paths (Crouse 2016), in the order of scipy's `linear_sum_assignment`, so that of equal ones the same is found;
scipy's package takes a fifth of a second to import.
"""

from scenario_gen.numerics import Ints

NEVER = 2**62  # more than any sum of the numbers that are compared


def best_partners(shared: Ints) -> list[int]:
    """Return the column of each row of `shared` (n, n) such that the sum of these entries is largest."""
    cost: list[list[int]] = (-shared).tolist()
    size = len(cost)
    by_row, by_column = [0] * size, [0] * size
    row_of, column_of = [-1] * size, [-1] * size
    for start in range(size):
        shortest, path = [NEVER] * size, [-1] * size
        remaining, rows, columns = list(range(size))[::-1], list[int](), list[int]()
        row, least = start, 0
        while row >= 0:
            rows.append(row)
            lowest, index = NEVER, -1
            for k, column in enumerate(remaining):
                length = least + cost[row][column] - by_row[row] - by_column[column]
                if length < shortest[column]:
                    path[column], shortest[column] = row, length
                if shortest[column] < lowest or (shortest[column] == lowest and row_of[column] < 0):
                    lowest, index = shortest[column], k
            least, column = lowest, remaining[index]
            columns.append(column)
            remaining[index] = remaining[-1]
            remaining.pop()
            row = row_of[column]
        by_row[start] += least
        for row in rows[1:]:
            by_row[row] += least - shortest[column_of[row]]
        for each in columns:
            by_column[each] -= least - shortest[each]
        row = -1
        while row != start:  # along the path back to the start, everyone takes the next one's partner
            row = path[column]
            row_of[column] = row
            column_of[row], column = column, column_of[row]
    return column_of
