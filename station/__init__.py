"""Quality-inspection station for soft fruit."""
