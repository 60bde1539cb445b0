#!/bin/sh
# Logins of the containers, made once with the database; their passwords come from the secrets.
set -eu
login() {
    psql --set ON_ERROR_STOP=1 --username postgres --dbname fruit \
        --set name="$1" --set group="$2" --set password="$(head -n 1 "/run/secrets/$3")" <<'SQL'
CREATE ROLE :"name" LOGIN PASSWORD :'password' IN ROLE :"group";
SQL
}
login station_1 fruit_station postgresql_station
login grafana fruit_reader grafana_postgresql
