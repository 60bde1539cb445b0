"""Generator of files from the settings models: `python -m station.settings.export`, in a checkout.

The JSON Schemas, the example configuration and the recipe guide's table of fields; a test compares them.
"""

import json
from collections.abc import Iterator
from pathlib import Path

from pydantic import BaseModel

from station.settings.configuration import Configuration
from station.settings.problems import dotted
from station.settings.recipe import APPROVED_NAME, approved_list
from station.settings.recipe_model import Recipe
from station.settings.schema import Leaf, Node, expectation, leaves, resolved, schema_of

ROOT = Path(__file__).resolve().parents[2]
BEGIN, END = "<!-- fields: made by python -m station.settings.export -->\n", "<!-- end of fields -->\n"


def exported(root: Path = ROOT) -> dict[Path, str]:
    """Return the content of each file of the checkout; the recipe guide's text around the table is retained."""
    recipe_guide = root / "docs" / "recipes.md"
    return {
        root / "recipes" / "recipe.schema.json": json_schema(Recipe, "A recipe of the fruit-inspection station"),
        root / "recipes" / APPROVED_NAME: approved_list(root / "recipes"),
        root / "deploy" / "station.schema.json": json_schema(Configuration, "station.yaml"),
        root / "deploy" / "station.yaml": example(),
        recipe_guide: _with_table(recipe_guide.read_text(encoding="utf-8"), recipe_table()),
    }


def json_schema(model: type[BaseModel], title: str) -> str:
    """Return a model's JSON Schema as a file."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema_of(model), "title": title}
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def recipe_table() -> str:
    """The recipe's fields as a Markdown table."""
    root = schema_of(Recipe)
    head = [["field", "takes", "default", "meaning"], ["---"] * 4]
    rows = ([f"`{dotted(leaf.path)}`", *_columns(leaf, root)] for leaf in leaves(root, into_lists=True))
    return "".join(_row(cells) for cells in (*head, *rows))


def example() -> str:
    """A `station.yaml` with every default, commented out: `## ` explains, `# ` is a setting."""
    return "".join(
        [
            "# yaml-language-server: $schema=station.schema.json\n\n",
            "## The station's configuration with all its defaults: take the `# ` away from what is to change,\n",
            "## and from the line of its section. Guide: docs/configuration.md\n",
            *_section(schema_of(Configuration), schema_of(Configuration), 0),
        ]
    )


def _section(node: Node, root: Node, depth: int) -> Iterator[str]:
    """Return the lines of one section's fields."""
    indent = "  " * depth
    for name, child in resolved(node, root)["properties"].items():
        field = resolved(child, root)
        yield "\n" if depth == 0 else ""
        yield f"## {indent}{field['description']}\n"
        if "properties" in field:
            yield f"# {indent}{name}:\n"
            yield from _section(field, root, depth + 1)
        else:
            yield f"## {indent}Takes {expectation(field, root)}.\n"
            yield f"# {indent}{name}: {json.dumps(field.get('default'), ensure_ascii=False)}\n"


def _columns(leaf: Leaf, root: Node) -> list[str]:
    """Return a field's accepted values, default and meaning."""
    default = f"`{json.dumps(leaf.node['default'], ensure_ascii=False)}`" if "default" in leaf.node else "required"
    of_mappings = "properties" in resolved(leaf.node.get("items") or {}, root)
    takes = "a list of the following" if of_mappings else str(expectation(leaf.node, root))
    return [takes, default, leaf.node.get("description", "")]


def _row(cells: list[str]) -> str:
    """One row of a table."""
    escaped = [cell.replace("|", "\\|") for cell in cells]
    return f"| {' | '.join(escaped)} |\n"


def _with_table(text: str, table: str) -> str:
    """Replace the table between the document's two marks."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}{table}{END}{after}"


def main() -> None:
    """Write every file that is made from the models."""
    for path, text in exported().items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
