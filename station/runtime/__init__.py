"""The running station: the process that inspects with the station's devices."""
