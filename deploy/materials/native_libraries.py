"""Native libraries in the wheels: what their `.libs` folders bring, and what is linked into their modules.

A name comes from a file's name, or from a text that a library leaves in what it is linked into; a version from such a
text only, because a file's is that of its interface.
"""

import hashlib
import re
from importlib.metadata import Distribution
from pathlib import Path
from typing import Any

_PROJECTS = {
    "avcodec": "ffmpeg",
    "avformat": "ffmpeg",
    "avutil": "ffmpeg",
    "crypto": "openssl",
    "jpeg": "libjpeg-turbo",
    "openblasp": "openblas",
    "openjp2": "openjpeg",
    "png16": "libpng",
    "scipy_openblas": "openblas",
    "scipy_openblas64_": "openblas",
    "ssl": "openssl",
    "swresample": "ffmpeg",
    "swscale": "ffmpeg",
}
"""Projects by the names of their files, without `lib`; others are named as their file."""
_TEXTS = {
    "openssl": rb"OpenSSL (\d+\.\d+\.\d+[a-z]*)[ \0]",
    "ffmpeg": rb"FFmpeg version n?(\d+\.\d+(?:\.\d+)?)",
    "libpng": rb"libpng version (\d+\.\d+\.\d+)",
    "zlib": rb"(?:deflate|inflate) (\d+\.\d+(?:\.\d+)*) Copyright",
    "libcurl": rb"libcurl/(\d+\.\d+\.\d+)",
    "libjpeg-turbo": rb"libjpeg-turbo (?:version |\(ver )(\d+\.\d+\.\d+)",
    "libtiff": rb"(?:LIBTIFF, Version |TIFF: +build \(ver \d+ - )(\d+\.\d+\.\d+)",
    "openjpeg": rb"JPEG 2000: +build \(ver (\d+\.\d+\.\d+)\)",
    "protobuf": rb"Protobuf: +build \((\d+\.\d+\.\d+)\)",
    "openblas": rb"OpenBLAS (\d+\.\d+\.\d+)",
    "libkrb5": rb"krb5-(\d+\.\d+(?:\.\d+)?)-",
    "libaom": rb"AOMedia Project AV1 (?:En|De)coder v?(\d+\.\d+\.\d+)",
    "libvpx": rb"WebM Project VP8 Encoder v(\d+\.\d+\.\d+)",
}
"""Texts that libraries leave in what they are linked into, OpenCV also in its account of how it was built."""


def native_libraries(package: Distribution) -> list[dict[str, Any]]:
    """Return the CycloneDX components of a package's native libraries, each with the first file that has it."""
    found: dict[str, dict[str, Any]] = {}
    for file in sorted(package.files or [], key=str):
        path = Path(str(file.locate()))
        if re.search(r"\.so(\.|$)", file.name) and path.is_file():
            content = path.read_bytes()
            for name, version in _libraries(file.parts[0], file.name, content).items():
                if version or not any(each["name"] == name for each in found.values()):
                    found.setdefault(
                        f"{name}" + (f"@{version}" if version else ""),
                        _component(package, str(file), content, name, version),
                    )
    return list(found.values())


def _libraries(folder: str, name: str, content: bytes) -> dict[str, str]:
    """Return the versions of the libraries in a file by their names; empty if it leaves none."""
    texts = {
        project: match[1].decode("ascii") for project, text in _TEXTS.items() if (match := re.search(text, content))
    }
    brought = re.match(r"lib(\w+?)-[0-9a-f]{8}\b", name) if folder.endswith(".libs") else None
    if brought is None:
        return texts
    return {_PROJECTS.get(brought[1], f"lib{brought[1]}"): ""} | texts


def _component(package: Distribution, file: str, content: bytes, name: str, version: str) -> dict[str, Any]:
    return {
        "bom-ref": f"{package.name}=={package.version}/{name}" + (f"@{version}" if version else ""),
        "hashes": [{"alg": "SHA-256", "content": hashlib.sha256(content).hexdigest()}],
        "name": name,
        "properties": [{"name": "file", "value": file}],
        "type": "library",
        **({"version": version} if version else {}),
    }
