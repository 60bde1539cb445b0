"""Station service: the process that inspects with the station's devices."""
