"""A copy of the records falsified in twelve ways: found each time, without the station, by its public key."""

import json
import shutil
import sqlite3
from dataclasses import replace
from hashlib import sha256

import pytest

from station.records.audit import AuditRow, canonical
from station.records.audit_head import Head, save_head
from station.records.backup import MANIFEST_NAME, hash_of
from station.records.database import FILE_NAME
from station.records.seals import part_hash

TRIGGERS = ("audit_no_update", "audit_no_delete", "audit_only_after")


@pytest.fixture
def key_and_anchor(opened, scenario, folder, trigger, passed, failed, noise, settled, run_records, tmp_path):
    """The records of three fruit, and what a person keeps elsewhere: the public key, an anchor, a backup."""

    async def steps():
        async with opened() as records:
            for record in (passed, replace(failed, images=(noise(), noise(step=1))), passed):
                outcome = await records.conclude(await records.begin(trigger), record)
                await records.published(outcome)
                await settled(records)

    scenario(steps)
    key = tmp_path / "site.pem"
    shutil.copy(folder / "public_key.pem", key)
    output = run_records("backup", tmp_path / "copy").output
    anchor = output.split()[-1]
    assert run_records("check", "--public-key", key, "--anchor", anchor).exit_code == 0
    (folder / "signing_key.pem").unlink()  # a copy of the records elsewhere is without it
    return key, anchor


def change(folder, *statements):
    """Change the database as anyone with the file can: its triggers are put back afterwards."""
    connection = sqlite3.connect(folder / FILE_NAME)
    triggers = [connection.execute("SELECT sql FROM sqlite_master WHERE name = ?", (name,)) for name in TRIGGERS]
    texts = [found.fetchone()[0] for found in triggers]
    for name in TRIGGERS:
        connection.execute(f"DROP TRIGGER {name}")
    for statement in statements:
        connection.execute(*(statement if isinstance(statement, tuple) else (statement,)))
    for text in texts:
        connection.execute(text)
    connection.commit()
    connection.close()


def rewrite_chain(folder, then=lambda row: row):
    """Write the whole trail anew, all hashes right."""
    connection = sqlite3.connect(folder / FILE_NAME)
    rows = [AuditRow(*found) for found in connection.execute("SELECT * FROM audit ORDER BY seq")]
    connection.close()
    before, statements = rows[0].previous_hash, []
    for row in rows:
        changed = replace(then(row), previous_hash=before)
        before = changed.true_hash
        values = (changed.new, changed.who, changed.previous_hash, before, row.seq)
        statements.append(("UPDATE audit SET new = ?, who = ?, previous_hash = ?, hash = ? WHERE seq = ?", values))
    change(folder, *statements)
    return Head(rows[-1].seq, before)


def an_outcome(folder):
    change(
        folder,
        "UPDATE inspections SET outcome = 'PASS', judged = 'PASS', reasons = '[]', "
        "standing = json_set(standing, '$.outcome', 'PASS', '$.reasons', json('[]')) WHERE sequence = 2",
    )


def a_curve(folder):
    change(folder, "UPDATE curve_points SET area_mm2 = area_mm2 / 2 WHERE sequence = 2 AND step = 3")


def a_deleted_inspection(folder):
    connection = sqlite3.connect(folder / FILE_NAME)
    connection.execute("PRAGMA foreign_keys = ON")
    connection.execute("DELETE FROM inspections WHERE sequence = 2")
    connection.commit()
    connection.close()


def dropped_triggers(folder):
    connection = sqlite3.connect(folder / FILE_NAME)
    connection.execute("DROP TRIGGER audit_no_delete")
    connection.close()


def a_changed_trigger(folder):
    connection = sqlite3.connect(folder / FILE_NAME)
    connection.execute("DROP TRIGGER audit_no_update")
    connection.execute("CREATE TRIGGER audit_no_update BEFORE UPDATE ON audit BEGIN SELECT 1; END")
    connection.close()


def a_swapped_image(folder):
    (path, _) = sorted((folder / "images").glob("*/*.png"))
    content = b"another image"
    name = sha256(content).hexdigest()
    (folder / "images" / name[:2]).mkdir(exist_ok=True)
    (folder / "images" / name[:2] / f"{name}.png").write_bytes(content)
    change(folder, ("UPDATE images SET sha256 = ?, size_bytes = ? WHERE sha256 = ?", (name, len(content), path.stem)))
    path.unlink()


def a_deleted_image(folder):
    (path, _) = sorted((folder / "images").glob("*/*.png"))
    change(folder, f"DELETE FROM images WHERE sha256 = '{path.stem}'")
    path.unlink()


def a_cut_chain(folder):
    """The last fruit is taken away with its rows, and the head fits the row that is the last now."""
    change(folder, "DELETE FROM audit WHERE seq > 4", "DELETE FROM curve_points WHERE sequence = 3",
           "DELETE FROM inspections WHERE sequence = 3")  # fmt: skip
    connection = sqlite3.connect(folder / FILE_NAME)
    head = Head(*connection.execute("SELECT seq, hash FROM audit ORDER BY seq DESC LIMIT 1").fetchone())
    connection.close()
    (folder / "audit_head").unlink()
    save_head(folder, head)  # signed by a key made for it


def a_rewritten_chain(folder):
    """The seals are made to fit the changed outcome, and the head to fit the chain."""
    an_outcome(folder)
    database = sqlite3.connect(folder / FILE_NAME)
    fitting = {part: part_hash(database, 2, part) for part in ("record", "outcome")}
    database.close()

    def forged(row):
        ours = row.subject == "inspection 2" and "record" in row.new
        return replace(row, new=canonical(fitting)) if ours else row

    (folder / "audit_head").unlink()
    save_head(folder, rewrite_chain(folder, forged))


def a_removed_head(folder):
    (folder / "audit_head").unlink()
    change(folder, "DELETE FROM audit WHERE seq > 4")


FALSIFIED = [
    (an_outcome, "inspection 2: record changed"),
    (an_outcome, "inspection 2: outcome changed"),
    (a_curve, "inspection 2: record changed"),
    (a_deleted_inspection, "inspection 2: it is missing; row"),
    (a_deleted_inspection, "inspection 2 is missing, and the audit trail does not say why"),
    (dropped_triggers, "trigger audit_no_delete is missing"),
    (a_changed_trigger, "trigger audit_no_update was changed"),
    (a_swapped_image, "inspection 2: images changed"),
    (a_deleted_image, "inspection 2: images changed"),
    (a_cut_chain, "is not signed by the station's key"),
    (a_rewritten_chain, "is not signed by the station's key"),
    (a_removed_head, "the head kept beside the database is missing"),
]


@pytest.mark.parametrize(("falsify", "message"), FALSIFIED, ids=lambda value: getattr(value, "__name__", ""))
def test_a_falsified_copy_is_found_by_the_public_key(key_and_anchor, folder, run_records, falsify, message):
    key, anchor = key_and_anchor
    falsify(folder)
    result = run_records("check", "--public-key", key)
    assert result.exit_code == 1
    assert message in result.output
    if falsify in {a_cut_chain, a_rewritten_chain, a_removed_head}:
        result = run_records("check", "--public-key", key, "--anchor", anchor)
        assert f"row {anchor.split(':')[0]}: " in result.output
        assert "the anchor names" in result.output


def test_a_rewritten_anchor_is_found(key_and_anchor, folder, run_records):
    """The chain is written anew, and the noted anchor made to fit it."""
    key, anchor = key_and_anchor
    head = rewrite_chain(folder, lambda row: replace(row, who="Eve"))
    result = run_records("check", "--public-key", key, "--anchor", f"{head.seq}:{head.hash}:{anchor.split(':')[2]}")
    assert result.exit_code == 1
    assert f"row {head.seq}: the anchor is not signed by the station's key" in result.output
    result = run_records("check", "--public-key", key, "--anchor", f"{head.seq}:{head.hash}")
    assert "with --public-key an anchor needs its signature" in str(result.exception)


def test_a_backup_with_an_added_trigger_and_a_new_hash_is_not_put_back(key_and_anchor, folder, run_records, tmp_path):
    key, _ = key_and_anchor
    copy = tmp_path / "copy"
    connection = sqlite3.connect(copy / FILE_NAME)
    connection.execute("CREATE TRIGGER later AFTER INSERT ON audit BEGIN DELETE FROM inspections; END")
    connection.commit()
    connection.close()
    manifest = json.loads((copy / MANIFEST_NAME).read_text())
    manifest["database_sha256"] = hash_of(copy / FILE_NAME)
    (copy / MANIFEST_NAME).write_text(json.dumps(manifest))
    before = (folder / FILE_NAME).read_bytes()
    result = run_records("restore", copy, "--public-key", key)
    assert result.exit_code == 1
    assert "is not signed by the key" in str(result.exception)
    result = run_records("restore", copy, "--unverified")
    assert result.exit_code == 1
    assert "trigger later is not the station's" in str(result.exception)
    assert (folder / FILE_NAME).read_bytes() == before
