"""Signing key of a station (Ed25519, RFC 8032): signs the audit trail's head and backups, verified by its public part.

The key never leaves the records' folder: neither a backup nor an export contains it.
"""

import contextlib
import functools
import os
from collections.abc import Sequence
from pathlib import Path

from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from station.atomic_file import PARTIAL, sync_folder, write_atomically
from station.errors import BadInputError
from station.messages import records as messages
from station.records.errors import RecordsError

KEY_NAME = "signing_key.pem"
PUBLIC_NAME = "public_key.pem"
PublicKeys = Sequence[Ed25519PublicKey]
"""Keys of which any one may have signed."""

_LONGEST_FILE_BYTES = 10_000


def sign(folder: Path, content: bytes) -> bytes:
    """Return a signature of 64 bytes with the key of the records' folder; a missing key is made first.

    Raises:
        OSError: the key cannot be read or made.
        RecordsError: its file contains no such key.
    """
    return _key(folder).sign(content)


def own_public_key(folder: Path) -> Ed25519PublicKey:
    """Return the public part of the folder's key, and write it to its file; a missing key is made first.

    Raises:
        OSError: the key cannot be read or made.
        RecordsError: its file contains no such key.
    """
    public = _key(folder).public_key()
    pem = public.public_bytes(serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo)
    path = folder / PUBLIC_NAME
    if not path.exists() or path.read_bytes() != pem:
        write_atomically(path, pem)
    return public


def read_public_key(path: Path) -> Ed25519PublicKey:
    """Read a public key, a PEM file as `public_key.pem` in the records' folder of a station.

    Raises:
        BadInputError: it cannot be read, or contains no public Ed25519 key.
    """
    try:
        with path.open("rb") as file:
            key = serialization.load_pem_public_key(file.read(_LONGEST_FILE_BYTES))
    except OSError as error:
        raise BadInputError(f"{path}: the public key cannot be read ({error.strerror})") from error
    except (ValueError, UnsupportedAlgorithm):
        key = None
    if not isinstance(key, Ed25519PublicKey):
        raise BadInputError(f"{path}: this is no public Ed25519 key in PEM form; a station's is in its {PUBLIC_NAME}")
    return key


def public_keys_of(folder: Path, known: Sequence[Path] = ()) -> PublicKeys:
    """Read the public keys to check by: those in the files given, else the one in the records' folder, if it has one.

    Raises:
        BadInputError: a file contains no public key.
    """
    own = folder / PUBLIC_NAME
    return tuple(read_public_key(path) for path in known or ([own] if own.exists() else []))


def name_of(key: Ed25519PublicKey) -> str:
    """Return the key's 32 bytes, hexadecimal."""
    return key.public_bytes(serialization.Encoding.Raw, serialization.PublicFormat.Raw).hex()


def is_signed(keys: PublicKeys, signature: bytes, content: bytes) -> bool:
    """Check whether one of the keys signed exactly this content."""
    for key in keys:
        with contextlib.suppress(InvalidSignature):
            key.verify(signature, content)
            return True
    return False


def _key(folder: Path) -> Ed25519PrivateKey:
    path = folder / KEY_NAME
    if not path.exists():
        _make(path)
    key = _parsed(path.read_bytes())
    if key is None:
        raise RecordsError(messages.NO_SIGNING_KEY(path=str(path)), messages.REPLACE_KEY())
    return key


@functools.lru_cache(maxsize=1)
def _parsed(pem: bytes) -> Ed25519PrivateKey | None:
    """Return the key of a file's content; cached, because parsing takes longer than signing does."""
    try:
        key = serialization.load_pem_private_key(pem, password=None)
    except (ValueError, TypeError, UnsupportedAlgorithm):
        return None
    return key if isinstance(key, Ed25519PrivateKey) else None


def _make(path: Path) -> None:
    """Make a key, durably, unless another process is first: then its key remains."""
    pem = Ed25519PrivateKey.generate().private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    partial = path.with_name(f".{path.name}.{os.getpid()}{PARTIAL}")
    write_atomically(partial, pem, 0o600)
    try:
        with contextlib.suppress(FileExistsError):
            path.hardlink_to(partial)
    finally:
        partial.unlink()
    sync_folder(path.parent)
    own_public_key(path.parent)
