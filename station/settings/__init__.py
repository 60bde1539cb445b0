"""Settings models: the station's configuration and the recipes in YAML, validated when they are read."""
