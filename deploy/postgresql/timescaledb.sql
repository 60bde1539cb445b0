-- Optional, after schema.sql, where TimescaleDB 2.18 or newer is installed and preloaded (shared_preload_libraries).
-- Unverified: no TimescaleDB was at hand. The tables work without it; it saves space and time beyond some 10 million rows.

CREATE EXTENSION IF NOT EXISTS timescaledb;
-- the triggers of the summaries by hour come back below: no hypertable is made of a table that has such
DROP TRIGGER summarise_insert ON inspections;
DROP TRIGGER summarise_update ON inspections;
DROP TRIGGER summarise_delete ON inspections;
SELECT create_hypertable('inspections', by_range('began', INTERVAL '7 days'), migrate_data => true);
CREATE TRIGGER summarise_insert AFTER INSERT ON inspections REFERENCING NEW TABLE AS added
FOR EACH STATEMENT EXECUTE FUNCTION summarise_inspections();
CREATE TRIGGER summarise_update AFTER UPDATE ON inspections REFERENCING OLD TABLE AS removed NEW TABLE AS added
FOR EACH STATEMENT EXECUTE FUNCTION summarise_inspections();
CREATE TRIGGER summarise_delete AFTER DELETE ON inspections REFERENCING OLD TABLE AS removed
FOR EACH STATEMENT EXECUTE FUNCTION summarise_inspections();

ALTER TABLE inspections SET (timescaledb.compress, timescaledb.compress_segmentby = 'station', timescaledb.compress_orderby = 'began DESC, sequence DESC');
-- later than images are removed by the stations' quota, as each removal changes a row
SELECT add_compression_policy('inspections', INTERVAL '60 days');
