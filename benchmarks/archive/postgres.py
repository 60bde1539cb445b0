"""A PostgreSQL server of one's own, reached over a UNIX socket, which no other account's processes are children of.

It listens on TCP as well where it is given an address of its own.
"""

import os
import pwd
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import psycopg

SCHEMA = Path(__file__).resolve().parents[2] / "deploy" / "postgresql" / "schema.sql"
PORT = 5432
_LIMIT_S = 120


def programs() -> Path | None:
    """The folder of PostgreSQL's programs, the newest installed; None where there are none."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda path: int(path.parts[-3]))
    return found[-1].parent if found else None


class Server:
    """A server in a folder of its own.

    Args:
        folder: its data and its socket; short, as a socket's path has to be.
        bin_folder: where initdb and pg_ctl are.
        address: on which it listens too; empty for the socket alone.
    """

    def __init__(self, folder: Path, bin_folder: Path, address: str = "") -> None:
        self.folder, self.address, self._bin = folder, address, bin_folder

    def initialise(self) -> None:
        """Make the database cluster and start it, with our tables in the database `fruit`."""
        if os.geteuid() == 0:  # PostgreSQL refuses to run as root
            account = pwd.getpwnam("postgres")
            os.chown(self.folder, account.pw_uid, account.pw_gid)
        data = self.folder / "data"
        self._call("initdb", "--no-sync", "--auth=trust", "--username=fruit", "--encoding=UTF8", "-D", data)
        self.start()
        with psycopg.connect(
            host=str(self.folder), port=PORT, user="fruit", dbname="postgres", autocommit=True
        ) as made:
            made.execute("CREATE DATABASE fruit")
        with self.connect() as connection:
            connection.execute(SCHEMA.read_bytes())

    def start(self) -> None:
        """Start it; returns when it answers."""
        listening = f"-c listen_addresses='{self.address}' -c unix_socket_directories={self.folder}"
        options = f"{listening} -c fsync=off -c max_wal_size=1GB"
        data, log = self.folder / "data", self.folder / "log"
        self._call("pg_ctl", "start", "--wait", "-D", data, "-l", log, "-o", options)

    def stop(self, how: Literal["fast", "immediate"]) -> None:
        """Stop it: orderly, or as a crash does."""
        self._call("pg_ctl", "stop", "--wait", "-m", how, "-D", self.folder / "data")

    def connect(self) -> psycopg.Connection[Any]:
        """A connection as the owner, each statement a transaction."""
        return psycopg.connect(host=str(self.folder), port=PORT, user="fruit", dbname="fruit", autocommit=True)

    def cut(self) -> int:
        """Cut every other connection; how many."""
        with self.connect() as connection:
            query = "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE pid <> pg_backend_pid()"
            found = connection.execute(f"{query} AND backend_type = 'client backend'").fetchone()
        return found[0] if found else 0

    def _call(self, program: str, *arguments: object) -> None:
        as_postgres = ["runuser", "-u", "postgres", "--"] if os.geteuid() == 0 else []
        command = [*as_postgres, str(self._bin / program), *map(str, arguments)]
        done = subprocess.run(
            command, cwd="/", stdin=-3, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False, timeout=_LIMIT_S
        )
        if done.returncode:
            raise RuntimeError(f"{program}: {done.stdout.decode(errors='replace')}")


@contextmanager
def throwaway(bin_folder: Path, address: str = "") -> Iterator[Server]:
    """A server that is gone afterwards, with its data; the arguments as of `Server`."""
    folder = Path(tempfile.mkdtemp(prefix="pg-"))
    server = Server(folder, bin_folder, address)
    try:
        server.initialise()
        yield server
    finally:
        if (folder / "data" / "postmaster.pid").exists():
            server.stop("immediate")
        until_s = time.monotonic() + 10
        while folder.exists() and time.monotonic() < until_s:
            shutil.rmtree(folder, ignore_errors=True)
