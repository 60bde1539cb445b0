"""The tests; a package, so that a folder of them may have the name of what it tests."""
