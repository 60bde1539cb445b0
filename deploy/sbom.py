#!/usr/bin/env python3
"""Write deploy/sbom.cdx.json, the bill of materials of what ships: deploy/sbom.py PYTHON.

PYTHON is that of an environment with the packages of both locks, as an installed release's: names, versions, licences
and what needs what come from the packages themselves, read by cyclonedx-py; the hashes are the locks', of all files
that they take. Packages that only build the release have the scope `excluded`. A package has its native libraries
inside, and what is known to be out of reach is among the vulnerabilities, with the reason.
"""

import json
import re
import subprocess
import sys
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

from materials.native_libraries import native_libraries
from materials.unreached import analyses

ROOT = Path(__file__).resolve().parents[1]
BILL = ROOT / "deploy" / "sbom.cdx.json"
LOCK, BUILD_LOCK = "requirements.lock", "requirements-build.lock"
PIN = re.compile(r"^(?P<name>[A-Za-z0-9._-]+)==(?P<version>[^ ;]+)(?P<rest>(?:[^\n]*\\\n)*[^\n]*)", re.MULTILINE)


def normal(name: str) -> str:
    """Return a package's name in its normal form (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def locked(text: str) -> dict[str, list[str]]:
    """Return the hashes of a lock, by the packages' names."""
    return {normal(pin["name"]): re.findall(r"sha256:([0-9a-f]{64})", pin["rest"]) for pin in PIN.finditer(text)}


def shipped(bill: dict[str, Any], locks: dict[str, dict[str, list[str]]]) -> dict[str, Any]:
    """Return the bill of an environment with only the packages in the locks, and the locks' hashes.

    Args:
        locks: each lock's hashes, by its name; what is in the first alone or in both runs.
    """
    hashes = {name: (lock, found) for lock, pins in reversed(locks.items()) for name, found in pins.items()}
    root = bill["metadata"]["component"]
    components = [each for each in bill["components"] if normal(each["name"]) in hashes]
    kept = {each["bom-ref"] for each in components} | {root["bom-ref"]}
    for each in components:
        lock, contents = hashes[normal(each["name"])]
        found = [{"alg": "SHA-256", "content": content} for content in contents]
        comment = "one of these files, by the hashes of the lock"
        each["externalReferences"] = [{"comment": comment, "hashes": found, "type": "distribution", "url": lock}]
        if lock == BUILD_LOCK:
            each["scope"] = "excluded"
    needs = [
        {**each, **({"dependsOn": [ref for ref in each["dependsOn"] if ref in kept]} if "dependsOn" in each else {})}
        for each in bill["dependencies"]
        if each["ref"] in kept
    ]
    return {**bill, "metadata": {"component": root}, "components": components, "dependencies": needs}


def with_native(bill: dict[str, Any], site_packages: str) -> dict[str, Any]:
    """Return the bill with the native libraries in the packages of an environment, and what is known of them."""
    refs = []
    for package in distributions(path=[site_packages]):
        for each in bill["components"]:
            if normal(each["name"]) == normal(package.name) and (found := native_libraries(package)):
                each["components"] = found
                refs += [library["bom-ref"] for library in found]
    return {**bill, "vulnerabilities": analyses(refs)}


def written(bill: dict[str, Any]) -> str:
    """Return a bill as JSON, one line per component, which shows the changes of a lock."""
    parts = []
    for key, value in sorted(bill.items()):
        text = json.dumps(value, sort_keys=True)
        if isinstance(value, list):
            text = "[\n " + ",\n ".join(json.dumps(each, sort_keys=True) for each in value) + "]"
        parts.append(f"{json.dumps(key)}: {text}")
    return "{" + ",\n".join(parts) + "}\n"


def main() -> int:
    """Run cyclonedx-py, and write the file."""
    if len(sys.argv) != 2:
        sys.stderr.write(f"{__doc__}\n")
        return 2
    options = ("--pyproject", ROOT / "pyproject.toml", "--output-reproducible", "--of", "JSON", "-o", "-")
    tool = Path(sys.executable).with_name("cyclonedx-py")
    command = [tool, "environment", *options, sys.argv[1]]
    done = subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603 (the developer's own arguments)
    locks = {name: locked((ROOT / name).read_text(encoding="utf-8")) for name in (LOCK, BUILD_LOCK)}
    where = [sys.argv[1], "-c", "import sysconfig; print(sysconfig.get_path('platlib'))"]
    site = subprocess.run(where, check=True, capture_output=True, text=True).stdout.strip()  # noqa: S603 (likewise)
    BILL.write_text(written(with_native(shipped(json.loads(done.stdout), locks), site)), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
