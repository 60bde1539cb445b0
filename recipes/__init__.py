"""The recipes shipped with the station, as YAML files, and the JSON Schema of a recipe."""
