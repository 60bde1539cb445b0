#!/usr/bin/env python3
"""Write deploy/sbom.cdx.json, the bill of materials of what ships: deploy/sbom.py PYTHON.

PYTHON is that of an environment with the packages of `requirements.lock`, as an installed release's: names, versions,
licences and what needs what come from the packages themselves, read by cyclonedx-py; the hashes are the lock's, of all
files that it takes.
"""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
BILL = ROOT / "deploy" / "sbom.cdx.json"
LOCK = "requirements.lock"
PIN = re.compile(r"^(?P<name>[A-Za-z0-9._-]+)==(?P<version>[^ ;]+)(?P<rest>(?:[^\n]*\\\n)*[^\n]*)", re.MULTILINE)


def normal(name: str) -> str:
    """Return a package's name in its normal form (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def locked(text: str) -> dict[str, list[str]]:
    """Return the hashes of a lock, by the packages' names."""
    return {normal(pin["name"]): re.findall(r"sha256:([0-9a-f]{64})", pin["rest"]) for pin in PIN.finditer(text)}


def shipped(bill: dict[str, Any], hashes: dict[str, list[str]]) -> dict[str, Any]:
    """Return the bill of an environment with only the packages in the lock, and the lock's hashes."""
    root = bill["metadata"]["component"]
    components = [each for each in bill["components"] if normal(each["name"]) in hashes]
    kept = {each["bom-ref"] for each in components} | {root["bom-ref"]}
    for each in components:
        found = [{"alg": "SHA-256", "content": content} for content in hashes[normal(each["name"])]]
        comment = "one of these files, by the hashes of the lock"
        each["externalReferences"] = [{"comment": comment, "hashes": found, "type": "distribution", "url": LOCK}]
    needs = [
        {**each, **({"dependsOn": [ref for ref in each["dependsOn"] if ref in kept]} if "dependsOn" in each else {})}
        for each in bill["dependencies"]
        if each["ref"] in kept
    ]
    return {**bill, "metadata": {"component": root}, "components": components, "dependencies": needs}


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
    bill = shipped(json.loads(done.stdout), locked((ROOT / LOCK).read_text(encoding="utf-8")))
    BILL.write_text(written(bill), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
