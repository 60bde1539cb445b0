-- Optional, after schema.sql, where TimescaleDB 2.13 or newer is installed and preloaded (shared_preload_libraries).
-- Unverified: no TimescaleDB was at hand. The tables work without it; it saves space and time beyond some 10 million rows.

CREATE EXTENSION IF NOT EXISTS timescaledb;
SELECT create_hypertable('inspections', by_range('began', INTERVAL '7 days'), migrate_data => true);

ALTER TABLE inspections SET (timescaledb.compress, timescaledb.compress_segmentby = 'station', timescaledb.compress_orderby = 'began DESC, sequence DESC');
-- later than images are removed by the stations' quota, as each removal changes a row
SELECT add_compression_policy('inspections', INTERVAL '60 days');

CREATE MATERIALIZED VIEW hourly_outcomes WITH (timescaledb.continuous) AS
SELECT station, fruit, outcome, time_bucket(INTERVAL '1 hour', began) AS hour, count(*) AS inspections
FROM inspections GROUP BY station, fruit, outcome, hour WITH NO DATA;
SELECT add_continuous_aggregate_policy('hourly_outcomes', start_offset => INTERVAL '3 days', end_offset => INTERVAL '1 hour', schedule_interval => INTERVAL '1 hour');
GRANT SELECT ON hourly_outcomes TO fruit_reader;
