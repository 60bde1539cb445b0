"""A wall clock that can be set for the processes of one station: a library loaded before the C library."""

import shutil
import struct
import subprocess
from pathlib import Path

from station.errors import StationError

_SOURCE = Path(__file__).with_name("shifted_clock.c")


class CannotDoError(StationError):
    """Error: a step of a scenario cannot be carried out on this machine."""


class ShiftedClock:
    """The clock of the programs that are started with `environment`; the file holds by how many seconds it is off.

    Args:
        folder: for the library and the file.
    """

    def __init__(self, folder: Path) -> None:
        self._file, self._library = folder / "clock_offset_s", folder / "shifted_clock.so"
        self._file.write_bytes(struct.pack("i", 0))

    def build(self) -> dict[str, str]:
        """Compile the library.

        Returns:
            The environment of who is to have this clock.

        Raises:
            CannotDoError: there is no C compiler here, or none that makes a library.
        """
        compiler = shutil.which("cc")
        if compiler is None:
            raise CannotDoError("no C compiler is here to make a clock that can be set; on Debian: apt-get install gcc")
        command = [compiler, "-shared", "-fPIC", "-O2", "-o", str(self._library), str(_SOURCE), "-ldl"]
        made = subprocess.run(command, capture_output=True, text=True, check=False)
        if made.returncode:
            raise CannotDoError(f"the clock that can be set could not be made: {made.stderr.strip()}")
        return {"LD_PRELOAD": str(self._library), "SHIFTED_CLOCK_FILE": str(self._file)}

    def step(self, seconds: float) -> None:
        """Set the clock off by so many seconds; 0 sets it right.

        Args:
            seconds: whole ones.
        """
        with self._file.open("r+b") as file:
            file.write(struct.pack("i", round(seconds)))
