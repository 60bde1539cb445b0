"""The mutants of the pure rooms: which changes are made, and what the page reports of their fates."""

import ast
import gc
import json
import types
from pathlib import Path

import pytest

from benchmarks.mutation.document import page
from benchmarks.mutation.operators import mutants
from benchmarks.mutation.results import Outcome, equal
from benchmarks.mutation.rooms import ROOMS
from benchmarks.mutation.runner import Changed, _put_in_place, fates

ROOT = Path(__file__).resolve().parents[2]
CODE = '''
__all__ = ["within"]
TABLE = {"a": 1, "b": -2}

def within(value: int, high: int) -> bool:
    """Say so."""
    if value < 0:
        raise ValueError("it is below nothing")
    return value <= high
'''


def changes() -> dict[str, str]:
    """Each mutant's name with the code that it makes."""
    found = {}
    for place, mutant in enumerate(mutants("m", ast.parse(CODE))):
        tree = ast.parse(CODE)
        again = list(mutants("m", tree))[place]
        again.apply()
        found[mutant.name] = ast.unparse(tree)
    return found


def test_each_mutant_is_one_change_of_code_or_table_and_none_of_what_is_no_behaviour():
    made = changes()
    assert {name.removeprefix("m:") for name in made} == {
        "-: 'a' → (left out)", "-: 'a' → 'aXX'", "-: 1 → 2", "-: 'b' → (left out)", "-: 'b' → 'bXX'", "-: -2 → 2",
        "-: 2 → 3", "within: value < 0 → value <= 0", "within: value < 0 → value >= 0", "within: 0 → 1",
        "within: value <= high → value < high", "within: value <= high → value > high",
        "within: return value <= high → return None",
    }  # fmt: skip
    assert len(set(made.values()) | {ast.unparse(ast.parse(CODE))}) == len(made) + 1
    assert "TABLE = {'b': -2}" in made["m:-: 'a' → (left out)"]


def test_the_page_gives_an_interval_for_a_sample_and_none_where_all_were_tested():
    sampled = Outcome({"killed": 45, "late": 1, "alive": 4, "no module": 2}, ["m:f: 0 → 1"] * 4, "abc", 520)
    whole = Outcome({"killed": 30, "no module": 2}, [], "abc", 32)
    rows = page({"judge": sampled, "codec": whole}).splitlines()
    assert "| judge | 520 | 2 | 50 | 46 | 0 | 4 | 92.0 % | 81.2 to 96.8 % | 92.0 % | abc |" in rows
    assert "| codec | 32 | 2 | 30 | 30 | 0 | 0 | 100.0 % | all tested | 100.0 % | abc |" in rows


@pytest.mark.parametrize("room", ROOMS.values(), ids=ROOMS)
def test_a_room_has_its_modules_and_tests(room):
    for path in (*(f"{module.replace('.', '/')}.py" for module in room.modules), *room.tests):
        assert (ROOT / path).exists()


def test_what_is_listed_as_equal_is_a_mutant_of_the_code_as_it_is():
    known = {
        mutant.name
        for room in ROOMS.values()
        for module in room.modules
        for mutant in mutants(module, ast.parse((ROOT / f"{module.replace('.', '/')}.py").read_text(encoding="utf-8")))
    }
    assert set(equal()) <= known


def test_a_function_gets_its_changed_code_also_where_the_collector_was_told_to_leave_it_out(tmp_path):
    file = tmp_path / "m.py"
    file.write_text(CODE)
    module = types.ModuleType("m")
    exec(compile(CODE, str(file), "exec"), module.__dict__)
    gc.freeze()
    try:
        changed = compile(CODE.replace("value <= high", "value < high"), str(file), "exec")
        assert _put_in_place(changed, file)
    finally:
        gc.freeze()  # as the conftest has left it for the other tests
    assert not module.within(1, 1)


def test_a_module_that_is_imported_already_is_refused_since_no_test_would_meet_its_mutants():
    [mutant, *_] = mutants(json.__name__, ast.parse(CODE))
    with pytest.raises(SystemExit, match="json: imported already"):
        next(fates([Changed(mutant, Path(json.__file__), ast.parse(CODE))], []))
