"""Head of the audit trail, signed and stored outside the database: without it, a cut-off end would not be found.

Two lines of fixed length, written in turn in place, as in `high_water_mark`. It is saved after the commit of new rows,
so it may be some rows behind, never ahead. A head as `ROW:HASH:SIGNATURE` is an anchor: stored elsewhere, it proves the
trail up to its row.
"""

import base64
import binascii
import logging
import os
import zlib
from pathlib import Path
from typing import NamedTuple

from station.atomic_file import write_atomically
from station.records.errors import RecordsError
from station.records.signing import PublicKeys, is_signed, sign

FILE_NAME = "audit_head"
log = logging.getLogger(__name__)

_SIGNATURE_LETTERS = 86
"""64 bytes in base64 without padding."""
_LINE_BYTES = 10 + 1 + 64 + 1 + _SIGNATURE_LETTERS + 1 + 8 + 1
_UNSIGNED_LINE_BYTES = 10 + 1 + 64 + 1 + 8 + 1
"""As versions before the signatures wrote it."""
_FORM = "fruit-station audit head 1"


class Head(NamedTuple):
    """Number and hash of the last row."""

    seq: int
    hash: str
    signature: str = ""
    """Of the station, 64 bytes in URL-safe base64 without padding; empty if it is not signed."""

    def __str__(self) -> str:
        return ":".join((str(self.seq), self.hash, *([self.signature] if self.signature else [])))

    def is_signed(self, keys: PublicKeys) -> bool:
        """Check whether one of the keys signed it."""
        try:
            signature = base64.urlsafe_b64decode(self.signature + "==")
        except (binascii.Error, ValueError):
            return False
        return is_signed(keys, signature, self.signed_text)

    @property
    def signed_text(self) -> bytes:
        """Return what is signed."""
        return f"{_FORM} {self.seq}:{self.hash}".encode("ascii", "replace")


def read_head(folder: Path) -> Head | None:
    """Read the last saved head; None if the file is missing or has no valid line.

    Raises:
        OSError: the file exists and cannot be read.
    """
    return max((head for head in _lines(folder / FILE_NAME) if head is not None), default=None)


def signed_head(folder: Path, head: Head) -> Head:
    """Sign the head with the station's key.

    Raises:
        OSError: the key cannot be read or made.
        RecordsError: the key is damaged.
    """
    signature = base64.urlsafe_b64encode(sign(folder, head.signed_text)).rstrip(b"=")
    return head._replace(signature=signature.decode("ascii"))


def save_head(folder: Path, head: Head) -> None:
    """Sign the head of a durable row and make it durable; it replaces the older of the two lines.

    Raises:
        OSError: it may not be durable.
        RecordsError: the key to sign it is damaged.
    """
    path = folder / FILE_NAME
    signed = signed_head(folder, head)
    body = b"%010d %s %s" % (signed.seq, signed.hash.encode("ascii"), signed.signature.encode("ascii"))
    line = body + b" %08x\n" % zlib.crc32(body)
    first, second = _lines(path)
    if (first is None and second is None) or path.stat().st_size != 2 * _LINE_BYTES:
        write_atomically(path, line * 2)
        return
    replaced = 1 if first is not None and (second is None or second < first) else 0
    descriptor = os.open(path, os.O_WRONLY | os.O_CLOEXEC)
    try:
        os.pwrite(descriptor, line, replaced * _LINE_BYTES)
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def try_save_head(folder: Path, head: Head) -> None:
    """Save the head of a durable row; a failure is logged only, because the trail itself is durable without it."""
    try:
        save_head(folder, head)
    except (OSError, RecordsError) as error:
        log.warning("the audit trail's head could not be kept outside the database: %s", error)


def _lines(path: Path) -> tuple[Head | None, Head | None]:
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return None, None
    size = _UNSIGNED_LINE_BYTES if len(content) == 2 * _UNSIGNED_LINE_BYTES else _LINE_BYTES
    return _parsed(content[:size]), _parsed(content[size : 2 * size])


def _parsed(line: bytes) -> Head | None:
    body, _, checksum = line.rstrip(b"\n").rpartition(b" ")
    number, *texts = body.split(b" ")
    if len(texts) not in {1, 2} or not number.isdigit() or checksum != b"%08x" % zlib.crc32(body):
        return None
    return Head(int(number), *(text.decode("ascii", "replace") for text in texts))
