-- From version 1 of schema.sql to version 2, the fruit's size. Load it once, as the database's owner:
--   psql --set ON_ERROR_STOP=1 --single-transaction --file schema-1-to-2.sql fruit
-- A station of the other version publishes nothing meanwhile, and nothing is lost. Rows published before have no size
-- here.

ALTER TABLE inspections ADD COLUMN fruit_length_mm double precision, ADD COLUMN size_class integer;

-- a view keeps the columns that it was made with
DROP VIEW inspections_of_growers;
CREATE VIEW inspections_of_growers AS
SELECT inspections.*, lots.grower
FROM inspections LEFT JOIN lots ON lots.station = inspections.station AND lots.name = inspections.lot;
GRANT SELECT ON inspections_of_growers TO fruit_reader, fruit_station;

UPDATE schema_version SET version = 2;
