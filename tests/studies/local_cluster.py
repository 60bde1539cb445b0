"""A Dask cluster of two processes: tells its address on standard output, and ends when standard input does."""

import sys

from distributed import LocalCluster


def main() -> None:
    """Serve until told to end."""
    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=True,
        dashboard_address=None,  # pyright: ignore[reportArgumentType] (None is no dashboard)
    ) as cluster:
        address = cluster.scheduler_address  # pyright: ignore[reportAttributeAccessIssue] (known at run time)
        sys.stdout.write(f"{address}\n")
        sys.stdout.flush()
        sys.stdin.read()


if __name__ == "__main__":
    main()
