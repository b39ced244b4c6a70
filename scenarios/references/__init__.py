"""What only tests and comparisons use: resolved simulations, and second solutions of collisions of a few spheres."""
