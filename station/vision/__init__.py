"""Images in, contact out: pure functions over arrays."""
