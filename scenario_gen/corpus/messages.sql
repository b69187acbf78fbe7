-- Messages in order of hours, in each of vehicles and time.
--
-- `source` has the columns of a MessageTable, `filename` of the ENUM `read`.
-- Result: device, t [µs since 2004], lat, lon [1e-7 degrees], speed, heading; `cause` of being left out, the first that holds, as
-- CAUSES in messages.py count them, or 0; `file`, the place in `files`; `back`: the stamp is before that of the row above, of the
-- same vehicle.
SELECT
    device,
    t,
    TRY_CAST(round(lat * 1e7) AS INTEGER) AS lat,
    TRY_CAST(round(lon * 1e7) AS INTEGER) AS lon,
    speed,
    heading,
    (CASE
        WHEN device IS NULL THEN 1
        WHEN t IS NULL OR t <= 0 OR t > 40 * 365 * 24 * 3_600_000_000 THEN 2  -- 40 years
        WHEN lat IS NULL OR lon IS NULL OR (lat = 0 AND lon = 0) THEN 3
        WHEN abs(lat) > 85 OR abs(lon) > 180 OR isnan(lat) OR isnan(lon) THEN 4
        WHEN speed IS NULL OR heading IS NULL OR isnan(speed) OR isnan(heading) THEN 5
        WHEN speed < 0 OR speed > 100 THEN 6
        -- milliseconds within the minute, by two clocks; 65535 of a sender that does not know
        WHEN clock <> 65_535 AND abs(t * 1e-3 - clock - 60000.0 * round((t * 1e-3 - clock) / 60000.0)) > 1500 THEN 7
        ELSE 0
    END)::UTINYINT AS cause,
    enum_code(filename::read)::USMALLINT AS file,  -- found by hash: a list would be searched for each row
    coalesce(device = lag(device) OVER () AND t < lag(t) OVER (), false) AS back
FROM source
ORDER BY  -- by short numbers
    TRY_CAST(t // 3_600_000_000 AS INTEGER), TRY_CAST(device AS INTEGER), TRY_CAST(t % 3_600_000_000 AS UINTEGER)
