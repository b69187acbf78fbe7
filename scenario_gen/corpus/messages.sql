-- Lines of text as messages, in order of hours, in each of vehicles and time.
--
-- Variables: `files` are read; `columns` has the types of a line's fields; `line` is the length [bytes] from which one is no row.
-- Result: device, t [µs since 2004], lat, lon [1e-7 degrees], speed, heading; `cause` of being left out, the first that holds, as
-- CAUSES in messages.py count them, or 0; `file`, the place in `files`; `back`: the stamp is before that of the row above, of the
-- same vehicle.
SELECT
    TxDevice AS device,
    Gentime AS t,
    TRY_CAST(round(Latitude * 1e7) AS INTEGER) AS lat,
    TRY_CAST(round(Longitude * 1e7) AS INTEGER) AS lon,
    Speed AS speed,
    Heading AS heading,
    (CASE
        WHEN TxDevice IS NULL THEN 1
        WHEN Gentime IS NULL OR Gentime <= 0 OR Gentime > 40 * 365 * 24 * 3_600_000_000 THEN 2  -- 40 years
        WHEN Latitude IS NULL OR Longitude IS NULL OR (Latitude = 0 AND Longitude = 0) THEN 3
        WHEN abs(Latitude) > 85 OR abs(Longitude) > 180 OR isnan(Latitude) OR isnan(Longitude) THEN 4
        WHEN Speed IS NULL OR Heading IS NULL OR isnan(Speed) OR isnan(Heading) THEN 5
        WHEN Speed < 0 OR Speed > 100 THEN 6
        -- milliseconds within the minute, by two clocks; 65535 of a sender that does not know
        WHEN DSecond <> 65_535
            AND abs(Gentime * 1e-3 - DSecond - 60000.0 * round((Gentime * 1e-3 - DSecond) / 60000.0)) > 1500 THEN 7
        ELSE 0
    END)::UTINYINT AS cause,
    enum_code(filename::read)::USMALLINT AS file,  -- found by hash: a list would be searched for each row
    coalesce(TxDevice = lag(TxDevice) OVER () AND Gentime < lag(Gentime) OVER (), false) AS back
FROM read_csv(
    getvariable('files'), columns = getvariable('columns'), header = false, auto_detect = false, delim = ',', quote = '',
    escape = '', store_rejects = true, filename = true, max_line_size = getvariable('line')
)
ORDER BY  -- by short numbers
    TRY_CAST(t // 3_600_000_000 AS INTEGER), TRY_CAST(device AS INTEGER), TRY_CAST(t % 3_600_000_000 AS UINTEGER)
