"""Parts of the bill of materials: native libraries in the wheels, and what is known to be out of reach."""
