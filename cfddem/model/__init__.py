"""What a simulation is made of: features and their kinds."""
