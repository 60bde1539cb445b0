-- The database of many stations. Load it once, as the database's owner:
--   createdb fruit
--   psql --set ON_ERROR_STOP=1 --single-transaction --file schema.sql fruit
-- then give each station a login that is a member of fruit_station, and readers one of fruit_reader:
--   CREATE ROLE station_7 LOGIN PASSWORD '…' IN ROLE fruit_station;
-- A database of version 1 becomes one of this version by schema-1-to-2.sql. TimescaleDB is optional: timescaledb.sql, loaded after this file.

CREATE TABLE schema_version (version integer PRIMARY KEY);
INSERT INTO schema_version VALUES (2);

-- What each station has told so far, by the database that counted. Written in the transaction of the rows themselves,
-- so that nothing is lost or doubled wherever a connection is cut.
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

CREATE VIEW inspections_of_growers AS
SELECT inspections.*, lots.grower
FROM inspections LEFT JOIN lots ON lots.station = inspections.station AND lots.name = inspections.lot;

DO $$
BEGIN
    IF NOT EXISTS (SELECT FROM pg_roles WHERE rolname = 'fruit_station') THEN CREATE ROLE fruit_station; END IF;
    IF NOT EXISTS (SELECT FROM pg_roles WHERE rolname = 'fruit_reader') THEN CREATE ROLE fruit_reader; END IF;
END $$;
GRANT SELECT ON ALL TABLES IN SCHEMA public TO fruit_reader, fruit_station;
GRANT INSERT, UPDATE ON stations, inspections, lots TO fruit_station;
-- the trail only grows here too
GRANT INSERT ON recipes, audit, refused TO fruit_station;
