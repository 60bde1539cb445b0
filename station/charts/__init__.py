"""Charts as SVG, for the operators' pages and for reports in one file."""
