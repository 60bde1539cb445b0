"""What people write in YAML: the station's configuration and the recipes, checked at the door."""
