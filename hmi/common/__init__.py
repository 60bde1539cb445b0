"""Common parts of all pages: layout, templates, styles, scripts, texts."""
