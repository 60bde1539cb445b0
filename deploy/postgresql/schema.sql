-- The database of many stations. Load it once, as the database's owner:
--   createdb fruit
--   psql --set ON_ERROR_STOP=1 --single-transaction --file schema.sql fruit
-- then give each station a login that is a member of fruit_station, and readers one of fruit_reader:
--   CREATE ROLE station_7 LOGIN PASSWORD '…' IN ROLE fruit_station;
-- An older database becomes one of this version by schema-1-to-2.sql and schema-2-to-3.sql, in this order. TimescaleDB is optional: timescaledb.sql,
-- loaded after this file.

CREATE TABLE schema_version (version integer PRIMARY KEY);
INSERT INTO schema_version VALUES (3);

-- The last entry published by each station, by origin. Written in the transaction of the rows themselves, so that nothing
-- is lost or doubled wherever a connection is cut.
CREATE TABLE stations (
    station text NOT NULL,
    origin text NOT NULL,
    last_entry bigint NOT NULL,
    told timestamptz NOT NULL DEFAULT now(),
    PRIMARY KEY (station, origin)
);

CREATE TABLE recipes (
    sha256 text PRIMARY KEY,
    name text NOT NULL,
    number integer NOT NULL,
    revision text NOT NULL,
    recipe jsonb NOT NULL
);

CREATE TABLE inspections (
    station text NOT NULL,
    sequence bigint NOT NULL,
    began timestamptz NOT NULL,
    ended timestamptz,
    duration_ms bigint,
    published timestamptz,
    lot text NOT NULL,
    fruit text,
    recipe_sha256 text,
    outcome text NOT NULL,
    reasons text[] NOT NULL,
    judged text,
    explanation text[] NOT NULL,
    late boolean NOT NULL,
    partial boolean NOT NULL,
    simulated boolean NOT NULL,
    area_mm2 double precision,
    area_px bigint,
    closing_mm double precision,
    confidence double precision,
    trigger_id integer NOT NULL,
    encoder bigint NOT NULL,
    boot text NOT NULL,
    curve jsonb NOT NULL,
    images jsonb NOT NULL,
    images_state text NOT NULL,
    phases_s jsonb NOT NULL,
    measures jsonb NOT NULL,
    devices jsonb NOT NULL,
    versions jsonb NOT NULL,
    origin text NOT NULL,
    entry bigint NOT NULL,
    arrived bigint GENERATED ALWAYS AS IDENTITY,
    fruit_length_mm double precision,
    size_class integer,
    -- the time is part of the key because TimescaleDB wants it so; a number's begin never changes
    PRIMARY KEY (station, sequence, began)
);
COMMENT ON COLUMN inspections.images IS 'kind, step, sha256, size_bytes of each; the file is at the station: images/<first two of sha256>/<sha256>.png';
COMMENT ON COLUMN inspections.fruit_length_mm IS 'as the line''s PLC gave it with the trigger, size_class likewise; null where it gave none';
COMMENT ON COLUMN inspections.arrived IS 'rises in the order in which the rows came; per station that of the entries';
CREATE INDEX inspections_began ON inspections (began DESC);
CREATE INDEX inspections_lot ON inspections (lot, station);
CREATE INDEX inspections_reasons ON inspections USING gin (reasons);

CREATE TABLE lots (
    station text NOT NULL,
    name text NOT NULL,
    grower text NOT NULL,
    began timestamptz NOT NULL,
    ended timestamptz,
    revision integer NOT NULL,
    origin text NOT NULL,
    entry bigint NOT NULL,
    PRIMARY KEY (station, name)
);
CREATE INDEX lots_grower ON lots (grower);

CREATE TABLE audit (
    station text NOT NULL,
    seq bigint NOT NULL,
    hash text NOT NULL,
    previous_hash text NOT NULL,
    utc_ms bigint NOT NULL,
    at timestamptz NOT NULL,
    who text NOT NULL,
    role text NOT NULL,
    action text NOT NULL,
    subject text NOT NULL,
    reason text NOT NULL,
    old text,
    new text,
    origin text NOT NULL,
    entry bigint NOT NULL,
    arrived bigint GENERATED ALWAYS AS IDENTITY,
    -- two rows with one number and different hashes are a trail that was changed: both are kept
    PRIMARY KEY (station, seq, hash)
);
CREATE INDEX audit_at ON audit (at DESC);
-- every fruit has a seal or two: a list without them would read past thousands
CREATE INDEX audit_without_seals ON audit (at DESC) WHERE action <> 'inspection.sealed';

-- Rows that could not be taken as they are: kept whole, for a person. Nothing waits behind them.
CREATE TABLE refused (
    station text NOT NULL,
    origin text NOT NULL,
    entry bigint NOT NULL,
    kind text NOT NULL,
    error text NOT NULL,
    data text NOT NULL,
    refused timestamptz NOT NULL DEFAULT now(),
    PRIMARY KEY (station, origin, entry)
);

-- Summaries of the inspections by hour, which the dashboard Quality reads: a year of ten stations is some 17 million
-- inspections, and a few hundred thousand rows here. A trigger keeps them equal to what `inspections` has, in the same
-- transaction. Empty text is an unknown fruit or recipe. Each row is one station's, so no station waits for another.
CREATE TABLE hourly_outcomes (
    hour timestamptz NOT NULL,
    station text NOT NULL,
    lot text NOT NULL,
    fruit text NOT NULL,
    recipe_sha256 text NOT NULL,
    outcome text NOT NULL,
    inspections bigint NOT NULL,
    first_began timestamptz NOT NULL,
    PRIMARY KEY (hour, station, lot, fruit, recipe_sha256, outcome)
);
COMMENT ON COLUMN hourly_outcomes.hour IS 'its begin, a whole hour of UTC';
CREATE TABLE hourly_reasons (
    hour timestamptz NOT NULL,
    station text NOT NULL,
    fruit text NOT NULL,
    outcome text NOT NULL,
    reason text NOT NULL,
    inspections bigint NOT NULL,
    PRIMARY KEY (hour, station, fruit, outcome, reason)
);
CREATE TABLE hourly_values (
    hour timestamptz NOT NULL,
    station text NOT NULL,
    fruit text NOT NULL,
    quantity text NOT NULL,
    bin integer NOT NULL,
    inspections bigint NOT NULL,
    PRIMARY KEY (quantity, hour, station, fruit, bin)
);
COMMENT ON COLUMN hourly_values.quantity IS 'the column of inspections: area_mm2 or duration_ms';
COMMENT ON COLUMN hourly_values.bin IS 'values from 1.05^bin to 1.05^(bin + 1); -1000 also for what is not above 0';

-- 5 % wide, so that a median that is interpolated in its bin is right to 2.5 %, and within less where values are many
CREATE FUNCTION bin_of(value double precision) RETURNS integer
LANGUAGE sql IMMUTABLE PARALLEL SAFE AS $$
SELECT CASE WHEN value > 0 AND value < 'Infinity' THEN greatest(floor(ln(value) / ln(1.05::float8)), -1000)::integer ELSE -1000 END
$$;

-- Rights of the owner, as a station may write no summary by itself.
CREATE FUNCTION summarise_inspections() RETURNS trigger
LANGUAGE plpgsql SECURITY DEFINER SET search_path = public, pg_temp AS $$
DECLARE
    added constant text := 'SELECT 1 AS change, * FROM added';
    removed constant text := 'SELECT -1 AS change, * FROM removed';
    changed text;
BEGIN
    CASE TG_OP
        WHEN 'INSERT' THEN changed := added;
        WHEN 'UPDATE' THEN changed := added || ' UNION ALL ' || removed;
        ELSE changed := removed;
    END CASE;
    -- what an update leaves in its group changes no sum, and is no row here
    EXECUTE format($sql$
        INSERT INTO hourly_outcomes AS kept
        SELECT date_trunc('hour', began, 'UTC'), station, lot, coalesce(fruit, ''), coalesce(recipe_sha256, ''), outcome,
            sum(change), min(began)
        FROM (%s) AS changed GROUP BY 1, 2, 3, 4, 5, 6 HAVING sum(change) <> 0
        ON CONFLICT (hour, station, lot, fruit, recipe_sha256, outcome) DO UPDATE SET
            inspections = kept.inspections + EXCLUDED.inspections,
            first_began = least(kept.first_began, EXCLUDED.first_began)
    $sql$, changed);
    EXECUTE format($sql$
        INSERT INTO hourly_reasons AS kept
        SELECT date_trunc('hour', began, 'UTC'), station, coalesce(fruit, ''), outcome, reason, sum(change)
        FROM (%s) AS changed, unnest(reasons) AS reason GROUP BY 1, 2, 3, 4, 5 HAVING sum(change) <> 0
        ON CONFLICT (hour, station, fruit, outcome, reason) DO UPDATE SET
            inspections = kept.inspections + EXCLUDED.inspections
    $sql$, changed);
    EXECUTE format($sql$
        INSERT INTO hourly_values AS kept
        SELECT date_trunc('hour', began, 'UTC'), station, coalesce(fruit, ''), quantity, bin_of(value), sum(change)
        FROM (%s) AS changed, (VALUES ('area_mm2'), ('duration_ms')) AS quantities (quantity),
            LATERAL (SELECT CASE quantity WHEN 'area_mm2' THEN area_mm2 ELSE duration_ms END AS value) AS chosen
        WHERE value IS NOT NULL GROUP BY 1, 2, 3, 4, 5 HAVING sum(change) <> 0
        ON CONFLICT (quantity, hour, station, fruit, bin) DO UPDATE SET
            inspections = kept.inspections + EXCLUDED.inspections
    $sql$, changed);
    RETURN NULL;
END $$;
CREATE TRIGGER summarise_insert AFTER INSERT ON inspections REFERENCING NEW TABLE AS added
FOR EACH STATEMENT EXECUTE FUNCTION summarise_inspections();
CREATE TRIGGER summarise_update AFTER UPDATE ON inspections REFERENCING OLD TABLE AS removed NEW TABLE AS added
FOR EACH STATEMENT EXECUTE FUNCTION summarise_inspections();
CREATE TRIGGER summarise_delete AFTER DELETE ON inspections REFERENCING OLD TABLE AS removed
FOR EACH STATEMENT EXECUTE FUNCTION summarise_inspections();

CREATE VIEW inspections_of_growers AS
SELECT inspections.*, lots.grower
FROM inspections LEFT JOIN lots ON lots.station = inspections.station AND lots.name = inspections.lot;

CREATE VIEW hourly_outcomes_of_growers AS
SELECT hourly_outcomes.*, lots.grower
FROM hourly_outcomes LEFT JOIN lots ON lots.station = hourly_outcomes.station AND lots.name = hourly_outcomes.lot;

DO $$
BEGIN
    IF NOT EXISTS (SELECT FROM pg_roles WHERE rolname = 'fruit_station') THEN CREATE ROLE fruit_station; END IF;
    IF NOT EXISTS (SELECT FROM pg_roles WHERE rolname = 'fruit_reader') THEN CREATE ROLE fruit_reader; END IF;
END $$;
GRANT SELECT ON ALL TABLES IN SCHEMA public TO fruit_reader, fruit_station;
GRANT INSERT, UPDATE ON stations, inspections, lots TO fruit_station;
-- the trail only grows here too
GRANT INSERT ON recipes, audit, refused TO fruit_station;
