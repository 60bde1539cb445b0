"""A Dask cluster of two processes: prints its address on standard output, and ends when standard input does."""

import sys

from distributed import LocalCluster


def main() -> None:
    """Serve until standard input ends."""
    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=True,
        dashboard_address=None,
    ) as cluster:
        address = cluster.scheduler_address
        sys.stdout.write(f"{address}\n")
        sys.stdout.flush()
        sys.stdin.read()


if __name__ == "__main__":
    main()
