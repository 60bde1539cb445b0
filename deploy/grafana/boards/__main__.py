"""Generator of the dashboards' JSON: `python -m deploy.grafana.boards`, in a checkout; a test compares them."""

from deploy.grafana.boards.export import exported

if __name__ == "__main__":
    for path, text in exported().items():
        path.write_text(text, encoding="utf-8")
