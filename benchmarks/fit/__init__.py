"""Fit of the robust method's constants: data sets, cost, sensitivity, stages, search, reliability."""
