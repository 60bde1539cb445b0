"""Generator of documents, import files for other tools and PLC code from the register map."""
