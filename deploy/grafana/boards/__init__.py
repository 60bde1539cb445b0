"""The dashboards, made by code: `python -m deploy.grafana.boards` in a checkout writes the JSON beside this package."""
