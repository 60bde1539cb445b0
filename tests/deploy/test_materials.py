"""Bill of materials: it is that of the lock, and no licence in it forbids a packhouse's use."""

import importlib.metadata
import importlib.util
import json
import re

import pytest

RUNTIME_EXCEPTION = "GPL-3.0-with-GCC-exception"
"""Of GCC's own runtime library, which wheels of numpy and scipy bring: it does not reach what is linked to it."""
FORBIDDEN = re.compile(
    r"(?<!L)(?<!LESSER )GPL|GENERAL PUBLIC|NON.?COMMERCIAL|BY-NC|PROPRIETARY|SSPL|BUSL", re.IGNORECASE
)


@pytest.fixture
def sbom(root, monkeypatch):
    monkeypatch.syspath_prepend(root / "deploy")
    spec = importlib.util.spec_from_file_location("sbom", root / "deploy/sbom.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def bill(sbom):
    return json.loads(sbom.BILL.read_text())


@pytest.fixture
def hashes(sbom, root):
    return sbom.locked((root / sbom.BUILD_LOCK).read_text()) | sbom.locked((root / sbom.LOCK).read_text())


def names_of(licence: str) -> str:
    """A licence without its parts on the lesser one and on GCC's runtime."""
    for allowed in (
        RUNTIME_EXCEPTION,
        "Lesser General Public",
        "Library General Public",
        "Library or Lesser General Public",
    ):
        licence = re.sub(re.escape(allowed), "", licence, flags=re.IGNORECASE)
    return licence


def test_the_bill_is_of_the_lock(sbom, bill, hashes, root):
    texts = [(root / lock).read_text() for lock in (sbom.BUILD_LOCK, sbom.LOCK)]
    pins = {sbom.normal(pin["name"]): pin["version"] for text in texts for pin in sbom.PIN.finditer(text)}
    billed = {sbom.normal(each["name"]): each["version"] for each in bill["components"]}
    only_elsewhere = {name for name in pins.keys() - billed.keys() if not installed(name)}
    assert len(billed) > 50
    assert billed == {name: version for name, version in pins.items() if name not in only_elsewhere}, (
        "renew: deploy/sbom.py"
    )
    for each in bill["components"]:
        found = {one["content"] for one in each["externalReferences"][0]["hashes"]}
        assert found == set(hashes[sbom.normal(each["name"])])
        assert found


def test_what_only_builds_the_release_is_marked(sbom, bill, root):
    running = sbom.locked((root / sbom.LOCK).read_text())
    excluded = {sbom.normal(each["name"]) for each in bill["components"] if each.get("scope") == "excluded"}
    assert excluded == sbom.locked((root / sbom.BUILD_LOCK).read_text()).keys() - running.keys()
    assert "hatchling" in excluded


def test_the_native_libraries_of_the_wheels_are_in_the_bill(bill):
    found = {
        (each["name"], library["name"]): library.get("version")
        for each in bill["components"]
        for library in each.get("components", ())
    }
    opencv = "opencv-contrib-python-headless"
    assert {(opencv, "ffmpeg"), ("psycopg-binary", "openssl"), ("psycopg-binary", "libpq")} <= found.keys()
    assert found[opencv, "openssl"] == "1.1.1k"


@pytest.mark.parametrize("name", ["opencv-contrib-python-headless", "psycopg-binary", "cryptography"])
def test_a_wheel_here_brings_what_the_bill_says(sbom, bill, name):
    (billed,) = (each for each in bill["components"] if sbom.normal(each["name"]) == name)
    assert sbom.native_libraries(importlib.metadata.distribution(name)) == billed["components"], "renew: deploy/sbom.py"


def test_what_is_past_its_end_of_life_is_said_to_be_out_of_reach(bill):
    refs = {library["bom-ref"] for each in bill["components"] for library in each.get("components", ())}
    old = {ref for ref in refs if re.search(r"openssl@(0|1)\.", ref)}
    analysed = {each["ref"] for found in bill["vulnerabilities"] for each in found["affects"]}
    assert old == analysed
    assert {found["analysis"]["justification"] for found in bill["vulnerabilities"]} == {"code_not_reachable"}


def test_the_bill_is_cyclonedx(sbom):
    # Two seconds of every process that collects this file.
    from cyclonedx.schema import SchemaVersion  # noqa: PLC0415
    from cyclonedx.validation.json import JsonStrictValidator  # noqa: PLC0415

    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(sbom.BILL.read_text()) is None


def test_every_licence_is_known_and_lets_a_packhouse_use_it(bill):
    for each in bill["components"]:
        licences = json.dumps(each.get("licenses", []))
        assert each.get("licenses"), f"{each['name']} names no licence"
        assert not FORBIDDEN.search(names_of(licences)), f"{each['name']}: {licences}"


def test_the_packages_here_say_the_same(hashes):
    for name in hashes:
        if not installed(name):
            continue
        about = importlib.metadata.metadata(name)
        classifiers = [each for each in about.get_all("Classifier") or [] if each.startswith("License ::")]
        fields = [*(about.get_all("License-Expression") or []), *classifiers, *(about.get_all("License") or [])]
        licence = fields[0].split("\n")[0] if fields else ""
        assert licence, f"{name} names no licence"
        assert not FORBIDDEN.search(names_of(licence)), f"{name}: {licence}"


@pytest.mark.parametrize("licence", ["GPL-3.0-only", "AGPL-3.0", "CC-BY-NC-4.0", "GNU General Public License v3"])
def test_what_is_forbidden_is_found(licence):
    assert FORBIDDEN.search(names_of(licence))


@pytest.mark.parametrize("licence", ["LGPL-3.0-or-later", "BSD-3-Clause AND GPL-3.0-with-GCC-exception", "MIT"])
def test_what_is_allowed_is_not(licence):
    assert not FORBIDDEN.search(names_of(licence))


def installed(name: str) -> bool:
    try:
        importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True
