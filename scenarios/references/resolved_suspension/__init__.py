"""Resolved reference: free spheres in a periodic box, with the flow around each sphere resolved."""
