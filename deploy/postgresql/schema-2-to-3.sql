-- From version 2 of schema.sql to version 3, the summaries by hour and the audit trail's index without seals. Load it once, as the database's owner:
--   psql --set ON_ERROR_STOP=1 --single-transaction --file schema-2-to-3.sql fruit
-- A station of the other version publishes nothing meanwhile, and nothing is lost. It reads all inspections once, some
-- minutes for a year of ten stations.

LOCK TABLE inspections IN SHARE ROW EXCLUSIVE MODE;

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

CREATE VIEW hourly_outcomes_of_growers AS
SELECT hourly_outcomes.*, lots.grower
FROM hourly_outcomes LEFT JOIN lots ON lots.station = hourly_outcomes.station AND lots.name = hourly_outcomes.lot;

INSERT INTO hourly_outcomes
SELECT date_trunc('hour', began, 'UTC'), station, lot, coalesce(fruit, ''), coalesce(recipe_sha256, ''), outcome, count(*), min(began)
FROM inspections GROUP BY 1, 2, 3, 4, 5, 6;
INSERT INTO hourly_reasons
SELECT date_trunc('hour', began, 'UTC'), station, coalesce(fruit, ''), outcome, reason, count(*)
FROM inspections, unnest(reasons) AS reason GROUP BY 1, 2, 3, 4, 5;
INSERT INTO hourly_values
SELECT date_trunc('hour', began, 'UTC'), station, coalesce(fruit, ''), 'area_mm2', bin_of(area_mm2), count(*)
FROM inspections WHERE area_mm2 IS NOT NULL GROUP BY 1, 2, 3, 5;
INSERT INTO hourly_values
SELECT date_trunc('hour', began, 'UTC'), station, coalesce(fruit, ''), 'duration_ms', bin_of(duration_ms), count(*)
FROM inspections WHERE duration_ms IS NOT NULL GROUP BY 1, 2, 3, 5;
ANALYZE hourly_outcomes, hourly_reasons, hourly_values;

-- every fruit has a seal or two: a list without them would read past thousands
CREATE INDEX audit_without_seals ON audit (at DESC) WHERE action <> 'inspection.sealed';

GRANT SELECT ON hourly_outcomes, hourly_reasons, hourly_values, hourly_outcomes_of_growers TO fruit_reader, fruit_station;

UPDATE schema_version SET version = 3;
