"""Support bundle: what a maker or integrator needs to see of a station, without anything secret."""
