"""What is made from the register map: documents, import files for other tools, PLC code."""
