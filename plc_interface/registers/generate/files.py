"""Generated files: content, writing, and comparison with those on disk."""

from pathlib import Path

from plc_interface.registers.generate import reference, structured_text
from plc_interface.registers.generate.add_on_instruction import add_on_instruction
from plc_interface.registers.generate.ignition import ignition
from plc_interface.registers.generate.scl import s7_1500
from plc_interface.registers.generate.structures import codesys, studio_5000
from plc_interface.registers.generate.telegraf import telegraf
from plc_interface.registers.generate.tia import tia
from station.errors import BadInputError

DOCUMENTS = Path(__file__).resolve().parents[3] / "docs" / "plc"
"""Their folder in the repository."""


def made_files() -> dict[str, str]:
    """Return the content of every generated file by its path below the folder."""
    return {
        "register-map.md": reference.markdown(),
        "register-map.csv": reference.table(),
        "import/telegraf.conf": telegraf(),
        "import/tia-portal.scl": tia(),
        "import/s7-1500.scl": s7_1500(),
        "import/studio-5000.L5X": studio_5000(),
        "import/add-on-instruction.L5X": add_on_instruction(),
        "import/codesys-plcopen.xml": codesys(),
        "import/ignition-tags.json": ignition(),
        "structured-text/data_types.st": structured_text.data_types(),
        "structured-text/FB_FruitStation.st": structured_text.function_block(),
        "structured-text/example.st": structured_text.example(),
        "structured-text/configuration.st": structured_text.configuration(),
    }


def write_files(folder: Path) -> list[Path]:
    """Write all files into a folder, created if it is missing; return those that are new or were different.

    Raises:
        BadInputError: the folder cannot be written, or does not exist in an installation without the repository.
    """
    if folder == DOCUMENTS and not DOCUMENTS.parent.is_dir():
        raise BadInputError("this installation has no folder of documents: give a folder with --out")
    contents, drifted = made_files(), drifted_files(folder)
    for path in drifted:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(contents[path.relative_to(folder).as_posix()], encoding="utf-8", newline="\n")
        except OSError as error:
            message = f"{path} cannot be written ({error.strerror}): give a folder that may be written with --out"
            raise BadInputError(message) from error
    return drifted


def drifted_files(folder: Path) -> list[Path]:
    """Return the files below a folder that are missing or differ from the generated ones."""
    return [folder / name for name, content in made_files().items() if _read(folder / name) != content]


def _read(path: Path) -> str | None:
    try:
        return path.read_bytes().decode("utf-8", "replace")
    except OSError:
        return None
