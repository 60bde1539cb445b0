"""Messages about a Dask cluster that works in place of this machine's processes."""

from station.messages.message import define

NO_EXTRA = define("cluster.no_extra", "--scheduler: install the extra first: pip install 'fruit-station[cluster]'")
NO_SCHEDULER = define(
    "cluster.no_scheduler",
    "--scheduler {address}: no Dask scheduler answers there: {words}; check that `dask scheduler` runs there, and that "
    "no firewall is between",
)
BAD_ADDRESS = define("cluster.bad_address", "--scheduler {address}: expected tcp://HOST:PORT or tls://HOST:PORT")
