"""Offline analysis of image files: results, masks, curves, plots and a report."""
