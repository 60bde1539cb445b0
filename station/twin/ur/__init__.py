"""An emulated Universal Robots controller with a UR10e on it, on the real wire protocols."""
