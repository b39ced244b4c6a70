"""What a simulation is made of: declared fields, tables of them, and features of its kinds."""
