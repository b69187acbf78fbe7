# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Stamps in tables: numbers, dates, and times of the day with or without a date."""

from typing import Any

import numpy as np
import pandas as pd

from scenario_gen.base.documents import shown
from scenario_gen.base.errors import InputError
from scenario_gen.logs.column import Column
from scenario_gen.logs.columns import UNITS
from scenario_gen.logs.raw import MAX_NUMBER_LENGTH_COUNT

MAX_STAMP_S = 9e9
"""Latest stamp since 1970 in 64 bits of nanoseconds."""

MAX_DATE_LENGTH_COUNT = 64  # characters; pandas takes minutes for a date of 100,000 digits
_USUAL_PERIOD_S = (0.005, 2.0)
_DAY_S = 86_400.0
_CLOCK_TIME = r"\s*\d{1,2}:\d{2}:\d{2}(?:[.,]\d+)?\s*"
_DECIMAL_COMMA = r"^(\s*[-+]?\d*),(\d+)\s*$"
_COMPACT_DATE = r"\d{6}|\d{8}"  # ddmmyy as of NMEA, yyyymmdd

Stamps = tuple["pd.Series[int]", "pd.Series[bool]"]


def reals(values: "pd.Series[Any]") -> "pd.Series[float]":
    """Return numbers, or texts that are numbers, as float64; NaN for others."""
    if not pd.api.types.is_numeric_dtype(values):
        texts = values.where(values.astype(str).str.len() < MAX_NUMBER_LENGTH_COUNT)
        values = texts.replace(_DECIMAL_COMMA, r"\1.\2", regex=True)
    return pd.to_numeric(values, errors="coerce").astype(float)


def read_stamps(
    values: "pd.Series[Any]", column: Column, dates: "pd.Series[Any] | None", place: str
) -> Stamps:
    """Return stamps as integer nanoseconds within `MAX_STAMP_S`, and which of them are valid.

    Args:
        values: numbers, or texts that are numbers, dates or times of the day.
        column: their unit.
        dates: the days of times of the day, if another column has them.
        place: the file and the column.

    Raises:
        InputError: the column does not have stamps, or has an implausible unit.
    """
    seconds = time_of_day(values, column)
    if seconds is not None:
        stamps = _after_midnight(seconds)
        if dates is not None:
            stamps = seconds + _days(dates)
        return _in_nanoseconds(stamps, 1.0)
    stamps, is_valid = _nanoseconds(values, column.factor)
    _check_stamps(values, stamps, is_valid, column, place)
    return stamps, is_valid


def time_of_day(values: "pd.Series[Any]", column: Column) -> "pd.Series[float] | None":
    """Return seconds since midnight of `hh:mm:ss` or hhmmss; None for other stamps.

    Numbers without a unit are hhmmss if each has less than 60 minutes and seconds, and if the
    minute advances by a step of 40.
    """
    numbers = reals(values)
    if numbers.isna().all():
        texts = values.dropna().astype(str)
        if not len(texts) or not texts.str.fullmatch(_CLOCK_TIME).mean() > 0.5:
            return None
        cleaned = values.astype(str).str.strip().str.replace(",", ".", regex=False)
        return pd.to_timedelta(cleaned, errors="coerce").dt.total_seconds()
    if column.unit != "hhmmss" and (column.unit or not _shows_minutes(numbers.to_numpy(float))):
        return None
    hours = np.trunc(numbers / 10_000.0)
    minutes = np.trunc(numbers / 100.0) - 100.0 * hours
    return 3600.0 * hours + 60.0 * minutes + numbers % 100.0


def _shows_minutes(numbers: Any) -> bool:
    """Return whether numbers (F,) have the form hhmmss and pass the end of a minute."""
    finite = np.unique(numbers[np.isfinite(numbers)])
    if len(finite) < 3 or finite[0] < 0.0 or finite[-1] >= 240_000.0 or finite[-1] < 100.0:
        return False
    if (finite % 100.0 >= 60.0).any() or (finite // 100.0 % 100.0 >= 60.0).any():
        return False
    steps = np.diff(finite)
    usual = float(np.median(steps))
    is_new_minute = np.diff(finite // 100.0) > 0.0
    excess = steps[is_new_minute] % 100.0 - usual
    return bool(is_new_minute.any() and np.isclose(excess % 100.0, 40.0, atol=usual).all())


def _after_midnight(seconds: "pd.Series[float]") -> "pd.Series[float]":
    """Return times of the day that increase over midnight, if all are near it."""
    is_evening = seconds > 0.75 * _DAY_S
    is_morning = seconds < 0.25 * _DAY_S
    if is_evening.any() and is_morning.any() and (is_evening | is_morning | seconds.isna()).all():
        return seconds + _DAY_S * is_morning
    return seconds


def _days(dates: "pd.Series[Any]") -> "pd.Series[float]":
    """Return the first second of days since 1970; the first day's where a date is missing."""
    texts = dates.map(lambda date: "" if pd.isna(date) else str(date).removesuffix(".0").strip())
    unique = pd.Series(texts.unique())
    if unique.str.fullmatch(_COMPACT_DATE).any():
        padded = unique.where(unique.str.len() != 5, "0" + unique)
        layout = "%Y%m%d" if (padded.str.len() == 8).all() else "%d%m%y"
        parsed = pd.to_datetime(padded, errors="coerce", utc=True, format=layout)
    else:
        parsed = _dates(unique)
    days = parsed.map(lambda day: np.nan if pd.isna(day) else day.timestamp() // _DAY_S * _DAY_S)
    seconds = texts.map(dict(zip(unique, days, strict=True))).astype(float)
    return seconds.ffill().bfill().fillna(0.0)


def _dates(texts: "pd.Series[Any]") -> "pd.Series[Any]":
    """Return dates with the day first if dots separate it, or if a month would be above 12."""
    texts = texts.where(texts.astype(str).str.len() <= MAX_DATE_LENGTH_COUNT)
    dates = pd.to_datetime(texts, errors="coerce", utc=True, format="ISO8601")
    if dates.notna().any():
        return dates
    unique = pd.Series(texts.dropna().astype(str).unique(), dtype=object)
    first = unique.str.extract(r"^\s*(\d{1,2})[./-](\d{1,2})[./-]\d{2}").astype(float)
    is_day_first = unique.str.contains(r"^\s*\d{1,2}\.", regex=True).any() or (first[0] > 12).any()
    parsed = pd.to_datetime(
        unique, errors="coerce", utc=True, format="mixed", dayfirst=bool(is_day_first)
    )
    by_text = dict(zip(unique, parsed, strict=True))
    return pd.to_datetime(texts.map(lambda text: by_text.get(str(text))), utc=True)


def _nanoseconds(values: "pd.Series[Any]", factor: float) -> Stamps:
    """Return numbers or dates as `read_stamps` does; `factor` is that of their unit to seconds."""
    if pd.api.types.is_integer_dtype(values):
        is_inside = (values.astype(float).abs() * factor < MAX_STAMP_S).astype(bool)
        bounded = values.where(is_inside, int(MAX_STAMP_S / factor)).astype(np.int64)
        return bounded * round(factor * 1e9), values.notna().astype(bool)
    numbers = reals(values)
    if numbers.isna().all():
        dates = _dates(values)
        ticks = dates.fillna(pd.Timestamp(0, tz="UTC")).astype(np.int64)
        stamps, _ = _nanoseconds(ticks, UNITS["time"][dates.dt.unit])
        return stamps, dates.notna()
    return _in_nanoseconds(numbers, factor)


def _in_nanoseconds(numbers: "pd.Series[float]", factor: float) -> Stamps:
    is_inside = numbers.abs() * factor < MAX_STAMP_S
    bounded = numbers.where(is_inside, MAX_STAMP_S / factor)
    return (bounded * (factor * 1e9)).round().astype(np.int64), numbers.notna()


def _check_stamps(
    values: "pd.Series[Any]",
    stamps: "pd.Series[int]",
    is_valid: "pd.Series[bool]",
    column: Column,
    place: str,
) -> None:
    """Check that a column has stamps, and a plausible unit.

    Raises:
        InputError: it has not; the message shows a value, and what it looks like.
    """
    first = shown(next(iter(values.dropna()), ""))
    if not is_valid.any():
        raise InputError(
            f"{place}: {first!r} is neither a number nor a date such as 2022-08-31T12:00:00.5"
        )
    out_of_range = float((stamps.abs() >= round(MAX_STAMP_S * 1e9)).mean())
    if column.factor != 1.0 or out_of_range <= 0.5 * bool(column.unit):
        return
    steps = np.diff(np.unique(reals(values).dropna()))
    step = float(np.median(steps)) if len(steps) > 1 else 0.0
    for unit in ("ms", "us", "ns"):
        if _USUAL_PERIOD_S[0] <= step * UNITS["time"][unit] <= _USUAL_PERIOD_S[1]:
            raise InputError(
                f"{place}: {first} looks like {unit}: --set log.columns=time={column.option(unit)}"
            )
