"""What other systems are told of the station's records: a process of its own, which only reads them."""
