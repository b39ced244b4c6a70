"""The paper's own method: incompressible smoothed particles in three dimensions, a quarter with two mirror planes."""
