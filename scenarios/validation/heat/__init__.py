"""Heat and drying: exact solutions, measured drops, and beds beside balances of heat and water."""
