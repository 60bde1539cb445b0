"""Exports of the settings' models: schemas, example and tables agree with the models."""

import importlib
import json
import re

import pytest
from pydantic import ValidationError

from station.settings.configuration import Configuration, load_configuration
from station.settings.export import exported, recipe_table
from station.settings.recipe import load_recipe, load_recipes
from station.settings.recipe_model import Recipe
from station.settings.schema import branches, leaves, resolved, schema_of


def test_schemas_example_and_tables_are_fresh(root):
    stale = [path.name for path, text in exported(root).items() if path.read_text(encoding="utf-8") != text]
    assert not stale, "run: python -m station.settings.export"


def test_every_field_has_a_title_a_description_and_where_it_has_one_a_unit():
    for model in (Recipe, Configuration):
        for leaf in leaves(schema_of(model), into_lists=True):
            assert leaf.node.get("title"), leaf.path
            assert leaf.node.get("description"), leaf.path
            suffix = re.search(r"_(mm|s|n|px|mm2|mm_s|mm2_per_mm)$", str(leaf.path[-1]))
            assert bool(suffix) <= ("unit" in leaf.node), leaf.path


def test_every_number_has_bounds():
    found = 0
    for model in (Recipe, Configuration):
        root = schema_of(model)
        nodes = [branch for leaf in leaves(root, into_lists=True) for branch in branches(leaf.node, root)]
        for node in nodes:
            nodes += [resolved(each, root) for each in (node.get("items"), *node.get("prefixItems", ())) if each]
            if node.get("type") in {"integer", "number"} and not {"enum", "const"} & set(node):
                found += 1
                assert {"minimum", "exclusiveMinimum"} & set(node), node
                assert {"maximum", "exclusiveMaximum"} & set(node), node
    assert found > 50


def test_the_schema_shows_bounds_and_units_to_an_editor(root):
    schema = json.loads((root / "recipes" / "recipe.schema.json").read_text())
    step = schema["$defs"]["WidthSteps"]["properties"]["step_mm"]
    assert {key: step[key] for key in ("unit", "minimum", "maximum")} == {"unit": "mm", "minimum": 0.4, "maximum": 5.0}
    assert schema["additionalProperties"] is False


def test_an_editor_takes_what_is_shipped_and_marks_a_mistake(root):
    schemas = importlib.import_module("jsonschema").Draft202012Validator  # its import takes seconds of every worker
    validator = schemas(json.loads((root / "recipes" / "recipe.schema.json").read_text()))
    for recipe in load_recipes().values():
        values = json.loads(recipe.model_dump_json())
        assert not list(validator.iter_errors(values))
        values["steps"]["step_mm"] = "fine"
        values["steps"]["stop"] = 1
        assert {error.validator for error in validator.iter_errors(values)} == {"type", "additionalProperties"}
    schemas.check_schema(json.loads((root / "deploy" / "station.schema.json").read_text()))


def test_the_example_with_nothing_commented_out_is_the_default(root, write):
    text = (root / "deploy" / "station.yaml").read_text()
    assert load_configuration(write(text), {}).model_dump() == load_configuration(None, {}).model_dump()
    settings = re.sub(r"^# (?!yaml-language-server)", "", text, flags=re.MULTILINE)
    found = load_configuration(write(settings), {}).model_dump(exclude={"home"})
    assert found == Configuration().model_dump(exclude={"home"})


def test_the_table_lists_fields_inside_lists():
    assert "| `damage.area[].area_mm2` | a number above 0 and at most 260 mm² | required |" in recipe_table()


def test_a_model_made_in_python_says_what_contradicts(small, write):
    values = load_recipe(write(small)).model_dump()
    values["early_stop"]["area_mm2"] = 1.0
    with pytest.raises(ValidationError, match=r"early_stop\.area_mm2: expected no less than"):
        Recipe.model_validate(values)
