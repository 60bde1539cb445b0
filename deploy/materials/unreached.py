"""Libraries that ship past their end of life, and why nothing of the station reaches them (VEX)."""

from typing import Any

OPENSSL = "/openssl@1.1.1k"
"""In every OpenCV wheel with FFmpeg, for its network protocols; the end of life of 1.1.1 was 2023-09-11."""
WHY = (
    "OpenCV's wheel brings this OpenSSL for FFmpeg's https, rtmps and tls protocols alone. The station opens videos by "
    "the paths of existing files (station analyze, a replayed camera), and FFmpeg lets what is in a file name other "
    "files, but no address: tests/analysis/test_analyze_command.py, "
    "test_a_playlist_in_place_of_a_video_asks_nobody. The camera is read by Video4Linux, without FFmpeg. TLS of the "
    "station is Python's, cryptography's and psycopg's, each with an OpenSSL of its own."
)
CVES = (
    "CVE-2021-3711",
    "CVE-2021-3712",
    "CVE-2022-0778",
    "CVE-2022-2097",
    "CVE-2022-4304",
    "CVE-2022-4450",
    "CVE-2023-0215",
    "CVE-2023-0286",
    "CVE-2023-0464",
    "CVE-2023-0465",
    "CVE-2023-0466",
    "CVE-2023-2650",
    "CVE-2023-3446",
    "CVE-2023-3817",
    "CVE-2023-5678",
    "CVE-2024-0727",
)
"""Published for OpenSSL 1.1.1k; the analysis does not depend on which they are."""


def analyses(refs: list[str]) -> list[dict[str, Any]]:
    """Return the analyses of what is known to be out of reach among the bill's components, by their refs."""
    affects = [{"ref": ref} for ref in refs if ref.endswith(OPENSSL)]
    analysis = {"detail": WHY, "justification": "code_not_reachable", "state": "not_affected"}
    return [{"affects": affects, "analysis": analysis, "id": cve} for cve in CVES] if affects else []
