"""Images from files in; results, masks, curves, plots and a report out."""
